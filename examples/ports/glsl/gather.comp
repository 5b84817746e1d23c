// Stage sssil.gather_samples of a level: irradiance of its texels by samples of the crown, HSS Eq. 4 with its pi (E-HSS-04):
// pi L cos R^2 / (r^2 + R^2), R^2 = cos' ds / pi. Samples outside the picture are left out, and the texel itself.
// Its disc covers a share of the texels that a sample stands for, one at least, as often as needed (E-HSS-05).
// An invocation takes a texel; where TREE is defined a work group does, and its invocations one sample each in turn.
layout(local_size_x = 64) in;
#include "arrays.glsl"
#include "scalar_product.glsl"

const float PI = 3.14159265358979;

layout(std430, binding = 0) readonly buffer Positions { PLACE position[]; };
layout(std430, binding = 1) readonly buffer Normals { STORED normal[]; };
layout(std430, binding = 2) readonly buffer Radiances { STORED radiance[]; };
layout(std430, binding = 3) readonly buffer Surfaces { STORED area[]; };
layout(std430, binding = 4) readonly buffer Offsets { ivec2 offsets[]; };  // right, down
layout(std430, binding = 5) readonly buffer Counts { STORED weight[]; };   // texels that a sample stands for
layout(std430, binding = 6) writeonly buffer Irradiance { WRITTEN irradiance[]; };
layout(std430, binding = 7) readonly buffer SenderPositions { PLACE sender_position[]; };
layout(std430, binding = 8) readonly buffer SenderNormals { STORED sender_normal[]; };
uniform ivec2 size, tile, weight_tile;  // columns, rows
uniform int samples;
uniform float share;

#ifdef TREE
shared vec3 part[64];
#endif

int in_tile(ivec2 texel, ivec2 period) {
    ivec2 place = texel % period;
    return (place.y * period.x + place.x) * samples;
}

vec3 sample_irradiance(ivec2 texel, int j) {
    ivec2 from = texel + offsets[in_tile(texel, tile) + j];
    if (any(lessThan(from, ivec2(0))) || any(greaterThanEqual(from, size)) || from == texel) return vec3(0.0);
    uint count = uint(size.x * size.y), at = uint(texel.y * size.x + texel.x), s = uint(from.y * size.x + from.x);
    vec3 d = PLACE_VECTOR(sender_position, s, count) - PLACE_VECTOR(position, at, count);
    float square = scalar_product(d, d);
    if (square == 0.0) return vec3(0.0);
#ifdef RSQRT
    vec3 w = d * inversesqrt(square);
#else
    vec3 w = d / sqrt(square);
#endif
    float received = max(0.0, scalar_product(VECTOR(normal, at, count), w));
    float sent = max(0.0, -scalar_product(VECTOR(sender_normal, s, count), w));
    float texels = AT(weight, uint(in_tile(texel, weight_tile) + j));
    if (texels == 0.0) return vec3(0.0);
    float covered = max(share * texels, min(texels, 1.0)), disc = sent * AT(area, s) * covered / PI;
    return texels / covered * PI * received * (disc / (square + disc)) * VECTOR(radiance, s, count);
}

void main() {
#ifdef TREE
    int i = int(gl_WorkGroupID.x), first = int(gl_LocalInvocationID.x), step = 64;
#else
    int i = int(gl_GlobalInvocationID.x), first = 0, step = 1;
    if (i >= size.x * size.y) return;
#endif
    ivec2 texel = ivec2(i % size.x, i / size.x);
    vec3 total = vec3(0.0);
    for (int j = first; j < samples; j += step) {
#ifdef REVERSED
        total += sample_irradiance(texel, samples - 1 - j);
#else
        total += sample_irradiance(texel, j);
#endif
    }
#ifdef TREE
    part[first] = total;
    barrier();
    for (int width = 32; width > 0; width >>= 1) {
        if (first < width) part[first] += part[first + width];
        barrier();
    }
    if (first != 0) return;
    total = part[0];
#endif
    for (int c = 0; c < 3; ++c) irradiance[c * size.x * size.y + i] = ROUNDED(total[c]);
}
