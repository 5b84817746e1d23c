/* Irradiance of pixel lights at receivers, SII Eq. 2 and 3 with unit directions over r^2, without visibility. */
#include "json.h"
#include "stages.h"
#include <stdlib.h>

typedef struct {
    int count;
    const float *position, *normal, *flux, *lobe_flux, *lobe_axis, *lobe_exponent, *area;
    float *norm; /* of each light's lobe */
} Lights;

/* Position and normal stand first of receivers, then of lights. */
static Lights lights_of(Case *c, int first, int clamped) {
    const Array *position = get_at(c, "", first);
    Lights l = {position->shape[1], position->f, get_at(c, "", first + 1)->f, get(c, ".flux")->f, 0, 0, 0,
                clamped ? get(c, "footprints")->f : 0, 0};
    if (!has(c, ".lobe_flux")) return l;
    l.lobe_flux = get(c, ".lobe_flux")->f;
    l.lobe_axis = get(c, ".lobe_axis")->f;
    l.lobe_exponent = get(c, ".lobe_exponent")->f;
    l.norm = calloc((size_t)l.count + 1, sizeof *l.norm);
    for (int k = 0; k < l.count; k++)
        l.norm[k] = lobe_norm(plane3(l.normal, l.count, k), plane3(l.lobe_axis, l.count, k), l.lobe_exponent[k]);
    return l;
}

static vec3 pair(const Lights *l, int k, vec3 x, vec3 n) {
    vec3 d = sub(x, plane3(l->position, l->count, k));
    float square = dot(d, d);
    if (square == 0.0f) return v3(0.0f, 0.0f, 0.0f);
    vec3 w = scale(d, 1.0f / sqrtf(square));
    float sent = dot(plane3(l->normal, l->count, k), w), received = -dot(n, w);
    if (sent <= 0.0f || received <= 0.0f) return v3(0.0f, 0.0f, 0.0f);
    float fall = received / (square + (l->area ? l->area[k] / PI : 0.0f));
    vec3 total = scale(plane3(l->flux, l->count, k), sent * fall / PI);
    if (!l->lobe_flux) return total;
    float shape = lobe_shape(plane3(l->lobe_axis, l->count, k), w, l->lobe_exponent[k]);
    return add(total, scale(plane3(l->lobe_flux, l->count, k), l->norm[k] * shape * fall));
}

/* At receivers whose `id`, where there is one, is not -1; `own`: light k meets receiver k alone. */
static void irradiance(Case *c, Array *made, const int *id, int own, int clamped) {
    Lights l = lights_of(c, id ? 3 : 2, clamped);
    const float *position = get_at(c, "", 0)->f, *normal = get_at(c, "", 1)->f;
    int n = made->size / 3;
    for (int k = 0; k < n; k++) {
        vec3 total = v3(0.0f, 0.0f, 0.0f);
        for (int j = own ? k : 0; (!id || id[k] >= 0) && j < (own ? k + 1 : l.count); j++)
            total = add(total, pair(&l, j, plane3(position, n, k), plane3(normal, n, k)));
        put3(made->f, n, k, total);
    }
    free(l.norm);
}

void sum_stage(Case *c) { irradiance(c, make(c, ""), get(c, "_triangles")->i, 0, json_is(fact(c, "clamp"), "disc")); }
void pairs_stage(Case *c) { irradiance(c, make(c, ""), 0, 1, 0); }

void subsplat_irradiance_stage(Case *c) {
    const Array *point = get(c, ".point");
    irradiance(c, make_of(c, 'f', 2, point->shape, ""), 0, 0, json_is(fact(c, "clamp"), "disc"));
}
