// Eq. 2 and 3 of SII for one pixel light and one receiver, calibrated (Phi / pi, E-SII-01; lobes over 2 pi K, E-SII-03).
// Macros choose variants that a port may well use: FUSED, RSQRT, UNNORMALISED (r^4), POW and POW_DOT (built-in pow).

#include "elementary.glsl"
#include "arrays.glsl"
#include "scalar_product.glsl"

const float PI = 3.14159265358979;

layout(std430, binding = 0) readonly buffer Positions { PLACE gbuffer_position[]; };
layout(std430, binding = 1) readonly buffer Normals { STORED gbuffer_normal[]; };
layout(std430, binding = 2) readonly buffer Triangles { int gbuffer_triangle_id[]; };
layout(std430, binding = 3) readonly buffer LightPositions { PLACE lights_position[]; };
layout(std430, binding = 4) readonly buffer LightNormals { STORED lights_normal[]; };
layout(std430, binding = 5) readonly buffer LightFluxes { STORED lights_flux[]; };
#ifdef LOBES
layout(std430, binding = 6) readonly buffer LobeFluxes { STORED lights_lobe_flux[]; };
layout(std430, binding = 7) readonly buffer LobeAxes { STORED lights_lobe_axis[]; };
layout(std430, binding = 8) readonly buffer LobeExponents { STORED lights_lobe_exponent[]; };
layout(std430, binding = 9) readonly buffer LobePeaks { float lobe_peak[]; };  // lobe_norm.comp
#endif
#ifdef DISC
layout(std430, binding = 10) readonly buffer Areas { STORED lights_area[]; };
#endif
layout(std430, binding = 11) writeonly buffer Irradiance { WRITTEN irradiance[]; };
uniform uint light_count, receiver_count;

struct Receiver {
    vec3 position, normal;
};

struct Light {
    vec3 position, normal, flux, lobe_flux, axis;
    float exponent, peak, area;
};

Receiver receiver_at(uint i) {
    return Receiver(PLACE_VECTOR(gbuffer_position, i, receiver_count), VECTOR(gbuffer_normal, i, receiver_count));
}

Light light_at(uint k) {
    Light light;
    light.position = PLACE_VECTOR(lights_position, k, light_count);
    light.normal = VECTOR(lights_normal, k, light_count);
    light.flux = VECTOR(lights_flux, k, light_count);
#ifdef LOBES
    light.lobe_flux = VECTOR(lights_lobe_flux, k, light_count);
    light.axis = VECTOR(lights_lobe_axis, k, light_count);
    light.exponent = AT(lights_lobe_exponent, k);
    light.peak = lobe_peak[k];
#endif
#ifdef DISC
    light.area = AT(lights_area, k);
#endif
    return light;
}

// <r.w>^P. With 1 - r.w = |r - w|^2 / 2 digits are kept near the axis, where P is large.
float lobe(vec3 axis, vec3 w, float exponent) {
#if defined(POW_DOT)
    float cosine = scalar_product(axis, w);
    return cosine > 0.0 ? pow(cosine, exponent) : 0.0;
#elif defined(ACCURATE_DOT)
    float cosine = scalar_product(axis, w);
    return cosine > 0.0 ? exp2_accurate(exponent * log2_of_1_minus(max(0.0, 1.0 - cosine))) : 0.0;
#else
    vec3 apart = axis - w;
    float h = 0.5 * scalar_product(apart, apart);
#ifdef POW
    return h < 1.0 ? pow(1.0 - h, exponent) : 0.0;
#else
    return h < 1.0 ? exp2_accurate(exponent * log2_of_1_minus(h)) : 0.0;
#endif
#endif
}

vec3 pair_irradiance(Light light, Receiver at) {
    vec3 d = at.position - light.position;
    float square = scalar_product(d, d);
    if (square == 0.0) return vec3(0.0);
#ifdef RSQRT
    vec3 w = d * inversesqrt(square);
#else
    vec3 w = d / sqrt(square);
#endif
    float sent = scalar_product(light.normal, w), received = max(0.0, -scalar_product(at.normal, w));
    if (sent <= 0.0) return vec3(0.0);
#ifdef DISC
    float fall = received / (square + light.area / PI);
#else
    float fall = received / square;
#endif
#ifdef UNNORMALISED
    // Eq. 2 with directions that are not normalised, over r^4
    float long_sent = scalar_product(light.normal, d), long_received = max(0.0, -scalar_product(at.normal, d));
#ifdef DISC
    vec3 total = light.flux / PI * (long_sent * long_received / (square * (square + light.area / PI)));
#else
    vec3 total = light.flux / PI * (long_sent * long_received / (square * square));
#endif
#else
    // Eq. 2
    vec3 total = light.flux / PI * (sent * fall);
#endif
#ifdef LOBES
    // Eq. 3
    total += light.lobe_flux * (light.peak * lobe(light.axis, w, light.exponent) * fall);
#endif
    return total;
}
