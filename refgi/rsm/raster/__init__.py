"""Software rasterizer: the nearest triangle at every texel of a map.

`projection` has the kinds of maps; `batch` draws triangles on perspective and orthographic maps, `paraboloid` on
paraboloid ones, `visibility_buffer` on either kind, several maps at once. `paraboloid_depth_maps` keeps distances
alone.
"""

from refgi.rsm.raster.paraboloid import paraboloid_depth_maps
from refgi.rsm.raster.projection import Projection, camera_projection, project
from refgi.rsm.raster.visibility_buffer import Visibility, rasterize

__all__ = [
    "Projection",
    "Visibility",
    "camera_projection",
    "paraboloid_depth_maps",
    "project",
    "rasterize",
]
