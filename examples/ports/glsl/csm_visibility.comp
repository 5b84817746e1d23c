// Stage cluster.csm, visibility by convolution shadow maps (E-VAL-02), from 0 to 1 where there are blockers:
// V = gain (1/2 + sum w_k (cos(c_k d') S_k - sin(c_k d') C_k)), d' = d - b; elsewhere the hard test's, or 1.
layout(local_size_x = 64) in;
#include "arrays.glsl"
#include "turns.glsl"

layout(std430, binding = 0) readonly buffer Shaded { int shaded[]; };
layout(std430, binding = 1) readonly buffer Depths { float penumbra_t[]; };
layout(std430, binding = 2) readonly buffer Means { STORED means[]; };
layout(std430, binding = 3) readonly buffer Weights { float weight[]; };
layout(std430, binding = 4) readonly buffer Otherwise { STORED otherwise[]; };
layout(std430, binding = 5) writeonly buffer Shares { WRITTEN share[]; };
uniform int maps, pixels, terms;
uniform float bias, gain;

void main() {
    int i = int(gl_GlobalInvocationID.x), map = i / pixels, pixel = i % pixels;
    if (map >= maps) return;
    float v = AT(otherwise, uint(i));
    if (shaded[i] != 0) {
        float sum = 0.5;
        for (int k = 0; k < terms; ++k) {
            vec2 wave = sin_cos_pi(2 * k + 1, penumbra_t[i] - bias);
            float sine = AT(means, uint((2 * terms * map + k) * pixels + pixel));
            float cosine = AT(means, uint((2 * terms * map + terms + k) * pixels + pixel));
            sum += weight[k] * (wave.y * sine - wave.x * cosine);
        }
        v = clamp(gain * sum, 0.0, 1.0);
    }
    share[i] = ROUNDED(v);
}
