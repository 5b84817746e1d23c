/* Pixel lights: points of the unit square, the texels that they fall on, and what is stored there (SII Sec. 3.1). */
#include "json.h"
#include "stages.h"
#include <stdlib.h>
#include <string.h>

#define BELOW_1 0.99999994f

/* Digits of k in a base, mirrored at the point. */
static float radical_inverse(int k, int base) {
    int mirrored = 0, scale_of = 1;
    for (; k > 0; k /= base) {
        mirrored = mirrored * base + k % base;
        scale_of *= base;
    }
    return (float)mirrored / (float)scale_of;
}

static void points(Case *c, int halton, const float *shift) {
    Array *points = make(c, "");
    int n = points->shape[0], side = (int)lroundf(sqrtf((float)n));
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

/* Each map has a row of the shifts. */
void halton_stage(Case *c) {
    points(c, 1, has(c, ".shifts") ? get(c, ".shifts")->f + 2 * (int)number(c, "number") : NULL);
}

void grid_stage(Case *c) { points(c, 0, 0); }

void importance_stage(Case *c) {
    Array *importance = make(c, "");
    const float *flux = get(c, ".flux")->f, *lobe = has(c, ".lobe_flux") ? get(c, ".lobe_flux")->f : 0;
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

void texels_stage(Case *c) {
    int rows = (int)(number(c, "maps") * number(c, "rows")), columns = (int)number(c, "columns");
    const float *points = get(c, "")->f, *own = has(c, ".density_weight") ? get(c, ".density_weight")->f : 0;
    int *texel = make(c, ".texel")->i;
    Array *weight = make(c, ".weight");
    float share = number(c, "T") / number(c, "N");
    for (int k = 0; k < weight->size; k++) {
        texel[k] = cell_of(points[2 * k + 1], rows) * columns + cell_of(points[2 * k], columns);
        weight->f[k] = share * (own ? own[k] : 1.0f);
    }
}

static const float *of_lamp(Case *c, int k, const char *field) {
    for (int j = 0; j < c->reads; j++) { /* rsm.reflected_flux0.lamp.place */
        const char *end = strstr(c->read[j].name, ".lamp."), *digit = strpbrk(c->read[j].name, "0123456789");
        if (end && digit && atoi(digit) == k && !strcmp(end + 6, field)) return get_at(c, "", j)->f;
    }
    return NULL;
}

Lamp lamp_of(Case *c, int k) {
    Lamp lamp = {of_lamp(c, k, "strength"), of_lamp(c, k, "place"), of_lamp(c, k, "direction"),
                 of_lamp(c, k, "half_angles")};
    return lamp;
}

/* Maps whose points and numbers of texels are the same share their list, of which there is one alone. */
static Array *listed(Case *c, const char *end, int map) {
    int lists = has(c, end);
    return get_at(c, end, map < lists ? map : lists - 1);
}

int sends(Case *c, int map, int texel) {
    static const char *kinds[2] = {".flux", ".lobe_flux"};
    for (int kind = 0; kind < 2; kind++) {
        if (!has(c, kinds[kind])) continue;
        const Array *flux = get_at(c, kinds[kind], map);
        for (int channel = 0; channel < 3; channel++)
            if (flux->f[channel * (flux->size / 3) + texel] > 0.0f) return 1;
    }
    return 0;
}

/* Fill one channel of all lights from the maps' texels; fluxes are multiplied by T/N w. */
static void gather(Case *c, const char *channel, int lights, const int *map, const int *texel, const float *weight) {
    int flux = strstr(channel, "flux") != NULL, channels = strcmp(channel, ".lobe_exponent") ? 3 : 1;
    int shape[2] = {3, lights};
    float *target = make_of(c, 'f', channels == 3 ? 2 : 1, channels == 3 ? shape : shape + 1, channel)->f;
    for (int k = 0; k < lights; k++) {
        const Array *source = get_at(c, channel, map[k]);
        int plane = source->size / channels;
        for (int j = 0; j < channels; j++)
            target[j * lights + k] = source->f[j * plane + texel[k]] * (flux ? weight[k] : 1.0f);
    }
}

void lights_stage(Case *c) {
    static const char *channels[6] = {".position", ".normal", ".flux", ".lobe_flux", ".lobe_axis", ".lobe_exponent"};
    int maps = has(c, ".position"), most = 0, lights = 0;
    for (int map = 0; map < maps; map++) most += listed(c, ".texel", map)->size;
    int *from_map = calloc((size_t)most, sizeof *from_map), *from = calloc((size_t)most, sizeof *from);
    float *weight = calloc((size_t)most, sizeof *weight);
    for (int map = 0; map < maps; map++) {
        const Array *texel = listed(c, ".texel", map);
        for (int k = 0; k < texel->size; k++) {
            if (!sends(c, map, texel->i[k])) continue;
            from_map[lights] = map;
            from[lights] = texel->i[k];
            weight[lights++] = listed(c, ".weight", map)->f[k];
        }
    }
    for (int k = 0; k < (has(c, ".lobe_flux") ? 6 : 3); k++) gather(c, channels[k], lights, from_map, from, weight);
    memcpy(make_of(c, 'i', 1, &lights, ".texel")->i, from, (size_t)lights * sizeof *from);
    memcpy(make_of(c, 'i', 1, &lights, ".map_index")->i, from_map, (size_t)lights * sizeof *from);
    free(from_map);
    free(from);
    free(weight);
}

/* Surface that each light stands for, Omega d^2 / cos; of a directional light Omega is the area across it. */
void footprints_stage(Case *c) {
    const int *map = get(c, ".map_index")->i, *texel = get(c, "_lights.texel")->i;
    const float *position = get(c, ".position")->f, *normal = get(c, ".normal")->f;
    int lights = get(c, ".map_index")->size, point = 0;
    float *area = make_of(c, 'f', 1, &lights, "")->f;
    for (int k = 0; k < lights; k++) {
        if (k > 0 && map[k] != map[k - 1]) point = 0;
        /* The lists of lights and of points have one order, but points without flux have no light. */
        while (listed(c, "texels.texel", map[k])->i[point] != texel[k]) point++;
        Lamp lamp = lamp_of(c, map[k]);
        float far = lamp.place != NULL;
        vec3 away = far ? sub(row3(lamp.place), plane3(position, lights, k)) : row3(lamp.direction);
        float square = dot(away, away);
        float cosine = fabsf(dot(away, plane3(normal, lights, k))) / sqrtf(square);
        area[k] = get_at(c, ".solid_angle", map[k])->f[texel[k]] * listed(c, ".weight", map[k])->f[point++]
                  * (far ? square : 1.0f) / fmaxf(cosine, 1e-3f);
    }
}
