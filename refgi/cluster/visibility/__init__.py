"""How much of an area light a point sees (Sec. 4.1, 4.2): convolution shadow maps and the exact step."""
