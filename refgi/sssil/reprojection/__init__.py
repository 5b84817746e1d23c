"""Values that one view holds, found again for surface points that another view sees.

`look_up` projects each point, takes the texels around it and drops those whose depth or normal is another surface's.
The temporal filter asks the view of the frame before; several cameras ask one another.
"""
