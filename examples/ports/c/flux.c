/* Flux that each texel of a light's map reflects: Phi_t = albedo * integral of I over the texel (docs/radiometry). */
#include "json.h"
#include "stages.h"

/* Solid angle of the triangle of three points of the plane z = 1 (Van Oosterom and Strackee): all terms are positive. */
static float triangle_angle(vec3 a, vec3 b, vec3 p, float twice_area) {
    float la = length(a), lb = length(b), lp = length(p);
    return 2.0f * atan2f(twice_area, la * lb * lp + dot(a, b) * lp + dot(a, p) * lb + dot(b, p) * la);
}

static float rectangle_angle(float x0, float x1, float y0, float y1, float area) {
    vec3 a = v3(x0, y0, 1.0f), b = v3(x1, y0, 1.0f), p = v3(x1, y1, 1.0f), q = v3(x0, y1, 1.0f);
    return triangle_angle(a, b, p, area) + triangle_angle(a, p, q, area);
}

static vec3 times(const float *reflectance, const float *power, float measure) {
    return v3(reflectance[0] * power[0] * measure, reflectance[1] * power[1] * measure,
              reflectance[2] * power[2] * measure);
}

void flux_stage(Case *c) {
    int spot = json_is(fact(c, "lamp"), "spot"), squared = json_is(fact(c, "falloff"), "squared_ramp");
    int glossy = writes(c, ".lobe_flux");
    View v = view_of(c);
    const int *id = get(c, "_triangles")->i, *material = get(c, "scene.material_of_face")->i;
    const float *power = get(c, "lamp.strength")->f, *cone = spot ? get(c, "lamp.half_angles")->f : 0;
    float *angle = make(c, ".solid_angle")->f, *flux = make(c, ".flux")->f;
    float *lobe_flux = glossy ? make(c, ".lobe_flux")->f : 0;
    float *lobe_axis = glossy ? make(c, ".lobe_axis")->f : 0;
    float *lobe_exponent = glossy ? make(c, ".lobe_exponent")->f : 0;
    float dx = 2.0f * v.half[0] / (float)v.columns, dy = 2.0f * v.half[1] / (float)v.rows;
    int count = v.maps * v.rows * v.columns;
    for (int k = 0; k < count; k++) {
        int row = k / v.columns % v.rows, column = k % v.columns;
        float x0 = (2.0f * (float)column / (float)v.columns - 1.0f) * v.half[0];
        float x1 = (2.0f * (float)(column + 1) / (float)v.columns - 1.0f) * v.half[0];
        float y0 = (2.0f * (float)row / (float)v.rows - 1.0f) * v.half[1];
        float y1 = (2.0f * (float)(row + 1) / (float)v.rows - 1.0f) * v.half[1];
        angle[k] = v.kind == ORTHOGRAPHIC ? dx * dy : rectangle_angle(x0, x1, y0, y1, dx * dy);
        if (id[k] < 0) continue;
        float measure = spot ? spot_integral(x0, x1, y0, y1, cone[0], cone[1], squared) : angle[k];
        int m = material[id[k]];
        put3(flux, count, k, times(get(c, "materials.diffuse")->f + 3 * m, power, measure));
        if (!glossy) continue;
        vec3 kept = times(get(c, "materials.specular")->f + 3 * m, power, measure);
        if (kept.x <= 0.0f && kept.y <= 0.0f && kept.z <= 0.0f) continue;
        Ray ray = texel_ray(&v, k / (v.rows * v.columns), (float)row + 0.5f, (float)column + 0.5f);
        vec3 d = normalize(ray.direction), n = normal_at(c, id[k], ray);
        put3(lobe_flux, count, k, kept);
        put3(lobe_axis, count, k, sub(d, scale(n, 2.0f * dot(n, d))));
        lobe_exponent[k] = get(c, "materials.exponent")->f[m];
    }
}
