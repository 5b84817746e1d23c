// Stage pairs.sum: irradiance of every pixel light at every pixel, without visibility and albedo / pi.
// An invocation takes a pixel and runs through the lights; where TREE is defined a work group takes a pixel, and
// its invocations add up every 64th light each, then one another in pairs.
layout(local_size_x = 64) in;
#include "pair.glsl"

#ifdef TREE
shared vec3 part[64];
#endif

void main() {
#ifdef TREE
    uint i = gl_WorkGroupID.x, first = gl_LocalInvocationID.x, step = 64u;
#else
    uint i = gl_GlobalInvocationID.x, first = 0u, step = 1u;
    if (i >= receiver_count) return;
#endif
    bool covered = gbuffer_triangle_id[i] >= 0;
    Receiver at = receiver_at(i);
    vec3 total = vec3(0.0);
    if (covered) {
        for (uint k = first; k < light_count; k += step) {
#ifdef REVERSED
            total += pair_irradiance(light_at(light_count - 1u - k), at);
#else
            total += pair_irradiance(light_at(k), at);
#endif
        }
    }
#ifdef TREE
    part[first] = total;
    barrier();
    for (uint width = 32u; width > 0u; width >>= 1) {
        if (first < width) part[first] += part[first + width];
        barrier();
    }
    if (first != 0u) return;
    total = part[0];
#endif
    for (uint c = 0u; c < 3u; ++c) irradiance[c * receiver_count + i] = ROUNDED(total[c]);
}
