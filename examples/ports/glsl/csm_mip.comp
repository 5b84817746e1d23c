// Stage cluster.mip_levels: a level is the mean of 2 x 2 texels of the one before; of an odd side the last counts twice.
layout(local_size_x = 64) in;
#include "arrays.glsl"

layout(std430, binding = 0) readonly buffer Finer { STORED finer[]; };
layout(std430, binding = 1) writeonly buffer Coarser { WRITTEN coarser[]; };
uniform int planes, side;  // of the finer level

float texel(int plane, ivec2 place) {
    place = min(place, ivec2(side - 1));
    return AT(finer, uint((plane * side + place.y) * side + place.x));
}

void main() {
    int half_side = (side + 1) / 2, i = int(gl_GlobalInvocationID.x), plane = i / (half_side * half_side);
    if (plane >= planes) return;
    ivec2 from = 2 * ivec2(i % half_side, i / half_side % half_side);
    coarser[i] = ROUNDED(0.25 * (texel(plane, from) + texel(plane, from + ivec2(1, 0)) + texel(plane, from + ivec2(0, 1))
                                 + texel(plane, from + ivec2(1, 1))));
}
