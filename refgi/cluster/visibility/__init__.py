"""Visibility of an area light by its map (Sec. 4.1, 4.2): hard shadows, PCF, PCSS and convolution shadow maps."""
