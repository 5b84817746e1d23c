// Stage pairs.pairs: irradiance of light k at receiver k.
layout(local_size_x = 64) in;
#include "pair.glsl"

void main() {
    uint k = gl_GlobalInvocationID.x;
    if (k >= receiver_count) return;
    vec3 total = pair_irradiance(light_at(k), receiver_at(k));
    for (uint c = 0u; c < 3u; ++c) irradiance[c * receiver_count + k] = ROUNDED(total[c]);
}
