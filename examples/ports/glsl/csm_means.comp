// Stage cluster.mip_means: means of a map's channels over a disc, by a trilinear read of the level whose
// texels are half the disc's diameter wide: level max(0, log2(radius side) - 1), the radius in units of [-1, 1].
layout(local_size_x = 64) in;
#include "arrays.glsl"

layout(std430, binding = 0) readonly buffer Asked { int asked[]; };
layout(std430, binding = 1) readonly buffer Regions { float region[]; };  // s, t, radius of each map
layout(std430, binding = 2) readonly buffer Chain { STORED chain[]; };    // all levels, the finest first
layout(std430, binding = 3) writeonly buffer Means { WRITTEN means[]; };
uniform int maps, pixels, levels, stored_channels, channels, side;

float texel(int first, int level_side, int plane, ivec2 place) {
    place = clamp(place, ivec2(0), ivec2(level_side - 1));
    return AT(chain, uint(first + (plane * level_side + place.y) * level_side + place.x));
}

float bilinear(int level, int plane, vec2 share) {
    int first = 0, level_side = side;
    for (int k = 0; k < level; ++k) {
        first += maps * stored_channels * level_side * level_side;
        level_side = (level_side + 1) / 2;
    }
    // texel i of a level covers the texels i 2^level .. (i + 1) 2^level - 1 of the map, also where its side is odd; a
    // sampler's coordinates are shares of the level's own side and would have to be scaled
    vec2 place = share * (float(side) / float(1 << level)) - 0.5, corner = floor(place), f = place - corner;
    ivec2 c = ivec2(corner);
    float upper = mix(texel(first, level_side, plane, c), texel(first, level_side, plane, c + ivec2(1, 0)), f.x);
    float lower = mix(texel(first, level_side, plane, c + ivec2(0, 1)), texel(first, level_side, plane, c + 1), f.x);
    return mix(upper, lower, f.y);
}

void main() {
    int i = int(gl_GlobalInvocationID.x), map = i / pixels, pixel = i % pixels;
    if (map >= maps) return;
    vec2 share = vec2(region[3 * map * pixels + pixel], region[(3 * map + 1) * pixels + pixel]) * 0.5 + 0.5;
    float radius = region[(3 * map + 2) * pixels + pixel];
    float level = clamp(log2(max(radius * float(side), 1e-30)) - 1.0, 0.0, float(levels - 1));
    int finer = int(floor(level)), coarser = min(finer + 1, levels - 1);
    for (int k = 0; k < channels; ++k) {
        int plane = map * stored_channels + k;
        float mean = asked[i] == 0 ? 0.0
                   : mix(bilinear(finer, plane, share), bilinear(coarser, plane, share), level - float(finer));
        means[(map * channels + k) * pixels + pixel] = ROUNDED(mean);
    }
}
