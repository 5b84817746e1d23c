/* Pixel lights: points of the unit square, the texels that they fall on, and what is stored there (SII Sec. 3.1). */
#include "json.h"
#include "stages.h"
#include <stdlib.h>
#include <string.h>

#define BELOW_1 0.99999994f

static int count_of(Case *c, const char *name, int map) {
    return (int)json_number(json_at(fact(c, "rsm%d.lights", map), name), 0);
}

/* Digits of k in a base, mirrored at the point. */
static float radical_inverse(int k, int base) {
    int mirrored = 0, scale_of = 1;
    for (; k > 0; k /= base) {
        mirrored = mirrored * base + k % base;
        scale_of *= base;
    }
    return (float)mirrored / (float)scale_of;
}

void points_stage(Case *c, int map) {
    Array *points = make(c, "rsm%d.points", map);
    char what[80];
    json_string(json_at(c->stage, "what"), what, sizeof what);
    int halton = !strncmp(what, "Halton", 6), n = points->shape[0], side = (int)lroundf(sqrtf((float)n));
    const float *shift = has(c, "rsm%d.shift", map) ? get(c, "rsm%d.shift", map)->f : 0;
    for (int k = 0; k < n; k++)
        for (int axis = 0; axis < 2; axis++) {
            float x = ((float)(axis ? k / side : k % side) + 0.5f) / (float)side;
            if (halton) {
                x = radical_inverse(k, axis ? 3 : 2) + (shift ? shift[axis] : 0.0f);
                x = x >= 1.0f ? x - 1.0f : x;
            }
            points->f[2 * k + axis] = fminf(x, BELOW_1);
        }
}

void importance_stage(Case *c, int map) {
    Array *importance = make(c, "rsm%d.importance", map);
    const float *flux = get(c, "rsm%d.flux", map)->f;
    const float *lobe = has(c, "rsm%d.lobe_flux", map) ? get(c, "rsm%d.lobe_flux", map)->f : 0;
    int n = importance->size;
    for (int k = 0; k < n; k++)
        for (int channel = 0; channel < 3; channel++) {
            int at = channel * n + k;
            importance->f[k] = fmaxf(importance->f[k], flux[at] + (lobe ? lobe[at] : 0.0f));
        }
}

/* floor(x n) without the rounding of the product. */
static int cell_of(float x, int n) {
    int k = (int)floorf(x * (float)n);
    if (fmaf(x, (float)n, -(float)k) < 0.0f) k--;
    return k < 0 ? 0 : k >= n ? n - 1 : k;
}

void texels_stage(Case *c, int map) {
    char name[16] = {'r', 's', 'm', (char)('0' + map), 0};
    View v = view_of(c, name);
    int warped = has(c, "%s.warped", name), rows = v.maps * v.rows;
    const float *points = get(c, warped ? "%s.warped" : "%s.points", name)->f;
    const float *own = warped ? get(c, "%s.density_weight", name)->f : 0;
    int *texel = make(c, "%s.texel", name)->i;
    Array *weight = make(c, "%s.weight", name);
    float share = (float)count_of(c, "T", map) / (float)count_of(c, "N", map);
    for (int k = 0; k < weight->size; k++) {
        texel[k] = cell_of(points[2 * k + 1], rows) * v.columns + cell_of(points[2 * k], v.columns);
        weight->f[k] = share * (own ? own[k] : 1.0f);
    }
}

static int maps_of(Case *c) {
    int maps = 0;
    while (fact(c, "light%d", maps)) maps++;
    return maps;
}

int sends(Case *c, int map, int texel) {
    static const char *kinds[2] = {"flux", "lobe_flux"};
    for (int kind = 0; kind < 2; kind++) {
        if (!has(c, "rsm%d.%s", map, kinds[kind])) continue;
        const Array *flux = get(c, "rsm%d.%s", map, kinds[kind]);
        for (int channel = 0; channel < 3; channel++)
            if (flux->f[channel * (flux->size / 3) + texel] > 0.0f) return 1;
    }
    return 0;
}

/* Fill one channel of all lights from the maps' texels; fluxes are multiplied by T/N w. */
static void gather(Case *c, const char *channel, int lights, const int *map, const int *texel, const float *weight) {
    int flux = strstr(channel, "flux") != NULL, channels = strcmp(channel, "lobe_exponent") ? 3 : 1;
    int shape[2] = {3, lights};
    float *target = make_of(c, 'f', channels == 3 ? 2 : 1, channels == 3 ? shape : shape + 1, "lights.%s", channel)->f;
    for (int k = 0; k < lights; k++) {
        const Array *source = get(c, "rsm%d.%s", map[k], channel);
        int plane = source->size / channels;
        for (int j = 0; j < channels; j++)
            target[j * lights + k] = source->f[j * plane + texel[k]] * (flux ? weight[k] : 1.0f);
    }
}

void lights_stage(Case *c) {
    static const char *channels[6] = {"position", "normal", "flux", "lobe_flux", "lobe_axis", "lobe_exponent"};
    int maps = maps_of(c), most = 0, lights = 0;
    for (int map = 0; map < maps; map++) most += get(c, "rsm%d.texel", map)->size;
    int *from_map = calloc((size_t)most, sizeof *from_map), *from = calloc((size_t)most, sizeof *from);
    float *weight = calloc((size_t)most, sizeof *weight);
    for (int map = 0; map < maps; map++) {
        const Array *texel = get(c, "rsm%d.texel", map);
        for (int k = 0; k < texel->size; k++) {
            if (!sends(c, map, texel->i[k])) continue;
            from_map[lights] = map;
            from[lights] = texel->i[k];
            weight[lights++] = get(c, "rsm%d.weight", map)->f[k];
        }
    }
    for (int k = 0; k < (has(c, "lights.lobe_flux") ? 6 : 3); k++) gather(c, channels[k], lights, from_map, from, weight);
    memcpy(make_of(c, 'i', 1, &lights, "lights.texel")->i, from, (size_t)lights * sizeof *from);
    memcpy(make_of(c, 'i', 1, &lights, "lights.map")->i, from_map, (size_t)lights * sizeof *from);
    free(from_map);
    free(from);
    free(weight);
}

/* Surface that each light stands for, Omega d^2 / cos; of a directional light Omega is the area across it. */
void footprints_stage(Case *c) {
    const int *map = get(c, "lights.map")->i, *texel = get(c, "lights.texel")->i;
    const float *position = get(c, "lights.position")->f, *normal = get(c, "lights.normal")->f;
    int lights = get(c, "lights.map")->size, point = 0;
    float *area = make_of(c, 'f', 1, &lights, "lights.area")->f;
    for (int k = 0; k < lights; k++) {
        if (k > 0 && map[k] != map[k - 1]) point = 0;
        /* The lists of lights and of points have one order, but points without flux have no light. */
        while (get(c, "rsm%d.texel", map[k])->i[point] != texel[k]) point++;
        float far = !json_is(fact(c, "light%d", map[k]), "directional");
        vec3 away = far ? sub(row3(get(c, "light%d.position", map[k])->f), plane3(position, lights, k))
                        : row3(get(c, "light%d.direction", map[k])->f);
        float square = dot(away, away);
        float cosine = fabsf(dot(away, plane3(normal, lights, k))) / sqrtf(square);
        area[k] = get(c, "rsm%d.solid_angle", map[k])->f[texel[k]] * get(c, "rsm%d.weight", map[k])->f[point++]
                  * (far ? square : 1.0f) / fmaxf(cosine, 1e-3f);
    }
}
