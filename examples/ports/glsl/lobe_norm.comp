// (P + 1) / (2 pi K) of each lobe. K is the share of a lobe <r.w>^P that lies above the surface (E-SII-03):
// K = 1 - I_x(a, 1/2) / 2 with x = sin^2, a = (P + 1) / 2 and the regularised incomplete beta function I, here by its
// continued fraction (DLMF 8.17.22), which converges fast for x < (a + 1) / (a + 5/2); else I_x(a, b) = 1 - I_(1-x)(b, a).
// An axis below the surface has what the opposite one has below it. A lobe with next to nothing above is dark.
layout(local_size_x = 64) in;
#include "elementary.glsl"
#include "arrays.glsl"

layout(std430, binding = 0) readonly buffer Normals { STORED lights_normal[]; };
layout(std430, binding = 1) readonly buffer Axes { STORED lights_lobe_axis[]; };
layout(std430, binding = 2) readonly buffer Exponents { STORED lights_lobe_exponent[]; };
layout(std430, binding = 3) writeonly buffer Peaks { float lobe_peak[]; };
uniform uint light_count;

// Gamma(a + 1/2) / Gamma(a): steps up to a >= 8, then its asymptotic series
float gamma_ratio(float a) {
    float factor = 1.0;
    for (; a < 8.0; a += 1.0) factor *= a / (a + 0.5);
    float t = 1.0 / a;
    return factor * sqrt(a) * (1.0 + t * (-0.125 + t * (0.0078125 + t * (0.0048828125 - t * 0.000640869140625))));
}

// 1 / (1 + d_1 / (1 + d_2 / (1 + ...))) from its tail
float fraction(float x, float a, float b) {
    float f = 1.0;
    for (int m = 24; m >= 1; --m) {
        float even = float(m) * (b - float(m)) * x / ((a + float(2 * m - 1)) * (a + float(2 * m)));
        float n = float(m - 1), odd = -(a + n) * (a + b + n) * x / ((a + 2.0 * n) * (a + 2.0 * n + 1.0));
        f = 1.0 + odd / (1.0 + even / f);
    }
    return 1.0 / f;
}

void main() {
    uint k = gl_GlobalInvocationID.x;
    if (k >= light_count) return;
    float exponent = AT(lights_lobe_exponent, k), a = 0.5 * (exponent + 1.0);
    float c = clamp(dot(VECTOR(lights_normal, k, light_count), VECTOR(lights_lobe_axis, k, light_count)), -1.0, 1.0);
    float cc = c * c, x = 1.0 - cc;
    float share = 0.0;  // of a lobe that lies below the surface, for c >= 0
    if (x > 0.0) {
        // x^a (1 - x)^(1/2) / B(a, 1/2)
        float front = exp2_accurate(a * log2_of_1_minus(cc)) * abs(c) * gamma_ratio(a) / 1.77245385090552;
        share = x < (a + 1.0) / (a + 2.5) ? 0.5 * front * fraction(x, a, 0.5) / a
                                          : 0.5 - front * fraction(cc, 0.5, a);
    }
    float above = c >= 0.0 ? 1.0 - share : share;
    lobe_peak[k] = above > 1e-12 ? (exponent + 1.0) / (6.28318530717959 * above) : 0.0;
}
