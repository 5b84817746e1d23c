// Stage cluster.basis: channels of a convolution shadow map for each texel's depth t (E-VAL-02):
// sin(c_k t) for all k, cos(c_k t), t sin(c_k t), t cos(c_k t), t, with c_k = (2k - 1) pi. Empty maps hold 0.
layout(local_size_x = 64) in;
#include "arrays.glsl"
#include "turns.glsl"

layout(std430, binding = 0) readonly buffer Depths { float maps_t[]; };
layout(std430, binding = 1) writeonly buffer Basis { WRITTEN basis[]; };
uniform int maps, texels, terms;

void main() {
    int i = int(gl_GlobalInvocationID.x), map = i / texels, texel = i % texels;
    if (map >= maps) return;
    bool empty = true;
    for (int j = 0; j < texels; ++j) empty = empty && maps_t[map * texels + j] == 0.0;
    float t = maps_t[i];
    int at = map * (4 * terms + 1) * texels + texel;
    for (int k = 0; k < terms; ++k) {
        vec2 wave = empty ? vec2(0.0) : sin_cos_pi(2 * k + 1, t);
        basis[at + k * texels] = ROUNDED(wave.x);
        basis[at + (terms + k) * texels] = ROUNDED(wave.y);
        basis[at + (2 * terms + k) * texels] = ROUNDED(t * wave.x);
        basis[at + (3 * terms + k) * texels] = ROUNDED(t * wave.y);
    }
    basis[at + 4 * terms * texels] = ROUNDED(t);
}
