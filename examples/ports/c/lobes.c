/* Phong lobes of pixel lights (SII Eq. 3), normalised over what lies above the surface (docs/radiometry). */
#include "stages.h"

#define NODES 8
#define PANELS 16
static const float NODE[NODES / 2] = {0.1834346425f, 0.5255324099f, 0.7966664774f, 0.9602898565f};
static const float WEIGHT[NODES / 2] = {0.3626837834f, 0.3137066459f, 0.2223810345f, 0.1012285363f};

/* sin^P at low + range s^4, times the derivative: s^4 smooths the end at 0 for exponents below 1. */
static float integrand(float s, float low, float range, float exponent) {
    float square = s * s;
    return powf(sinf(low + range * square * square), exponent) * square * s;
}

static float integral(float s0, float s1, float low, float range, float exponent) {
    float sum = 0.0f, half = 0.5f * (s1 - s0) / PANELS;
    for (int panel = 0; panel < PANELS; panel++) {
        float middle = s0 + (2.0f * (float)panel + 1.0f) * half;
        for (int k = 0; k < NODES / 2; k++)
            sum += WEIGHT[k] * (integrand(middle - half * NODE[k], low, range, exponent)
                                + integrand(middle + half * NODE[k], low, range, exponent));
    }
    return sum * half;
}

/* K, the share of the lobe above the surface: half of it and what of the other half an axis at `angle` leaves, with
   I = integral of sin^P from 0 to the angle over that to pi/2: 1 - I/2; I/2 of an axis below the surface. */
static float share_above(float angle, float exponent) {
    float low = fmaxf(0.0f, 0.5f * PI - 9.0f / sqrtf(exponent + 1.0f)), range = 0.5f * PI - low;
    float steep = fminf(angle, PI - angle);
    if (steep <= low) return angle < steep + 1.0f ? 1.0f : 1e-30f;
    float at = fminf(1.0f, sqrtf(sqrtf((steep - low) / range)));
    float below = integral(0.0f, at, low, range, exponent), rest = integral(at, 1.0f, low, range, exponent);
    float half = 0.5f * below / (below + rest);
    return angle > steep ? half : 1.0f - half;
}

float lobe_norm(vec3 normal, vec3 axis, float exponent) {
    float angle = atan2f(length(cross(normal, axis)), dot(normal, axis));
    return (exponent + 1.0f) / (2.0f * PI * share_above(angle, exponent));
}

/* <r.w>^P as (1 - h)^P with h = |r - w|^2 / 2, which keeps its digits near the axis. */
float lobe_shape(vec3 axis, vec3 direction, float exponent) {
    vec3 apart = sub(axis, direction);
    float h = 0.5f * dot(apart, apart);
    return h < 1.0f ? expf(exponent * log1pf(-h)) : 0.0f;
}
