/* From level to level: blur along surfaces, and joint bilateral upsampling of 3 x 3 texels (docs/methods/hssil). */
#include "json.h"
#include "stages.h"
#include <stdlib.h>

typedef struct { int h, w; const float *depth, *normal, *position; float tolerance, cosine; int size; } Surface;

static int same_surface(const Surface *s, int k, int at) {
    int plane = s->h * s->w;
    vec3 n = plane3(s->normal, plane, k);
    if (s->depth[at] == INFINITY) return 0;
    float off = fabsf(dot(n, sub(plane3(s->position, plane, at), plane3(s->position, plane, k))));
    return off <= s->tolerance * s->depth[k] && dot(n, plane3(s->normal, plane, at)) >= s->cosine;
}

/* Mean over a box of `size` texels along one axis; of an even number the two at its ends lie in it by half. */
static void blur_along(const Surface *s, const float *in, float *out, int dy, int dx) {
    int plane = s->h * s->w, reach = s->size / 2;
    for (int k = 0; k < plane; k++) {
        vec3 sum = v3(0, 0, 0);
        float weights = 0.0f;
        if (s->depth[k] == INFINITY) continue;
        for (int step = -reach; step <= reach; step++) {
            int y = k / s->w + step * dy, x = k % s->w + step * dx, at = y * s->w + x;
            if (y < 0 || x < 0 || y >= s->h || x >= s->w || (step && !same_surface(s, k, at))) continue;
            float weight = 2 * abs(step) == s->size ? 0.5f : 1.0f;
            sum = add(sum, scale(plane3(in, plane, at), weight));
            weights += weight;
        }
        put3(out, plane, k, scale(sum, 1.0f / weights));
    }
}

void blur_stage(Case *c) {
    const Array *light = get(c, "");
    Surface s = {light->shape[1], light->shape[2], get(c, ".depth")->f, get(c, ".normal")->f, get(c, ".position")->f,
                 number(c, "plane_tolerance"), number(c, "cosine"), (int)number(c, "size")};
    float *between = calloc((size_t)light->size, sizeof *between);
    blur_along(&s, light->f, between, 0, 1);
    blur_along(&s, between, make(c, "")->f, 1, 0);
    free(between);
}

typedef struct {
    int h, w, ch, cw, factor;
    const float *depth, *normal, *coarse_depth, *coarse_normal, *light;
    float sigma, power;
} Upsampling;

static float nearness(const Upsampling *u, int y, int x) {
    return y < 0 || x < 0 || y >= u->h || x >= u->w ? -1.0f : 1.0f / u->depth[y * u->w + x];
}

/* Slope of 1/z along an axis, a pixel: the smaller difference, 0 where signs differ; at the rim that to the inside. */
static float slope(const Upsampling *u, int y, int x, int dy, int dx) {
    float here = nearness(u, y, x), before = nearness(u, y - dy, x - dx), after = nearness(u, y + dy, x + dx);
    if (before < 0.0f && after < 0.0f) return 0.0f;
    if (before < 0.0f) before = 2.0f * here - after;
    if (after < 0.0f) after = 2.0f * here - before;
    float first = here - before, second = after - here;
    if (before <= 0.0f || after <= 0.0f || first * second <= 0.0f) return 0.0f;
    return fabsf(first) < fabsf(second) ? first : second;
}

/* The tent that leaves linear functions linear; t: place from the middle texel's point, texels. */
static float tent(int step, float t) {
    float away = fabsf(t);
    if (step == 0) return away < 0.5f ? (2.0f - away) / 3.0f : 1.0f - away;
    int near = (step > 0) == (t >= 0.0f);
    if (away < 0.5f) return (near ? 1.0f + 4.0f * away : 1.0f - 2.0f * away) / 6.0f;
    return near ? away : 0.0f;
}

static float sign(float x) { return x > 0.0f ? 1.0f : x < 0.0f ? -1.0f : 0.0f; }

static vec3 upsampled(const Upsampling *u, int k) {
    int y = k / u->w, x = k % u->w, row = y / u->factor, column = x / u->factor, texels = u->ch * u->cw, nearest = -1;
    float down = slope(u, y, x, 1, 0), across = slope(u, y, x, 0, 1), corner = 0.5f * (float)(u->factor - 1) / (float)u->factor;
    float ty = ((float)(y % u->factor) + 0.5f) / (float)u->factor - 0.5f - corner * sign(down);
    float tx = ((float)(x % u->factor) + 0.5f) / (float)u->factor - 0.5f - corner * sign(across);
    float z = u->depth[k], weights = 0.0f, least = INFINITY;
    vec3 sum = v3(0, 0, 0), n = plane3(u->normal, u->h * u->w, k);
    for (int step = 0; step < 9; step++) {
        int dy = step / 3 - 1, dx = step % 3 - 1, i = row + dy, j = column + dx, at = i * u->cw + j;
        if (i < 0 || j < 0 || i >= u->ch || j >= u->cw || u->coarse_depth[at] == INFINITY) continue;
        float plane = 1.0f / z + (float)u->factor * (((float)dy - ty) * down + ((float)dx - tx) * across);
        float delta = z * (1.0f / u->coarse_depth[at] - plane);
        float close = 1.0f - delta * delta / (32.0f * u->sigma * u->sigma);
        float cosine = dot(n, plane3(u->coarse_normal, texels, at));
        if (fabsf(delta) < least) least = fabsf(delta), nearest = at;
        if (close <= 0.0f || cosine <= 0.0f) continue;
        float weight = tent(dy, ty) * tent(dx, tx) * powf(close, 16.0f) * powf(cosine, u->power);
        sum = add(sum, scale(plane3(u->light, texels, at), weight));
        weights += weight;
    }
    if (weights >= 1e-20f) return scale(sum, 1.0f / weights);
    return nearest < 0 ? v3(0, 0, 0) : plane3(u->light, texels, nearest);
}

/* Light of a coarser level, its depth and normal, those of the finer one, and what that has gathered itself; the last
   is missing where the finer level is the picture. */
void upsample_stage(Case *c) {
    const Array *light = get(c, ""), *depth = get_at(c, ".depth", 1);
    const float *added = c->reads > 5 ? get_at(c, "", 5)->f : NULL;
    float *out = make(c, "")->f;
    Upsampling u = {depth->shape[0], depth->shape[1], light->shape[1], light->shape[2], (int)number(c, "factor"),
                    depth->f, get_at(c, ".normal", 1)->f, get(c, ".depth")->f, get(c, ".normal")->f, light->f,
                    number(c, "depth_sigma"), number(c, "normal_power")};
    for (int k = 0; k < u.h * u.w; k++) {
        if (u.depth[k] == INFINITY) continue;
        vec3 total = upsampled(&u, k);
        put3(out, u.h * u.w, k, added ? add(total, plane3(added, u.h * u.w, k)) : total);
    }
}
