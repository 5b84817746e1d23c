/* Convolution shadow maps: a series of the depth test over a mip map (VAL Sec. 4.1, E-VAL-02 to 08). */
#include "json.h"
#include "stages.h"
#include <stdlib.h>

#define INSIDE 1.5f
#define STEEPEST 80.0f
#define LEAST_RATIO 1.05f /* of the farthest to the nearest */

static float frequency(int k) { return (2.0f * (float)k + 1.0f) * PI; }

/* Angle c_k t less whole turns: of large angles the product alone would lose digits. */
static float phase(int k, float t) {
    float odd = 2.0f * (float)k + 1.0f, product = odd * t, rest = fmaf(odd, t, -product);
    return PI * ((product - 2.0f * rintf(0.5f * product)) + rest);
}

/* f_M - 1 of depths that differ by x. */
static float series(int m, float x) {
    float f = -0.5f;
    for (int k = 0; k < m; k++) f += 2.0f / frequency(k) * sinf(frequency(k) * x);
    return f;
}

void series_stage(Case *c) {
    int m = (int)number(c, "terms");
    float low = 0.0f, high = 0.5f / (float)m; /* f is 1 for the first time at about 0.305 / M */
    for (int k = 0; k < 40; k++) {
        float middle = 0.5f * (low + high);
        if (series(m, middle) < 0.0f) low = middle;
        else high = middle;
    }
    Array *bias = make(c, ".bias"), *weight = make(c, ".weight");
    for (int k = 0; k < bias->size; k++) bias->f[k] = high;
    for (int k = 0; k < weight->size; k++) weight->f[k] = 2.0f / frequency(k);
    make(c, ".end")->f[0] = 1.0f - 2.0f * high;
}

/* Depth 0 at what is nearest, h = max(2 e - 1, e / 2) at what is farthest; in between by the distance or its log. */
void scale_stage(Case *c) {
    const Array *near = get(c, ".near");
    const float *far = get(c, "ranges.far")->f;
    float e = get(c, ".end")->f[0], *origin = make(c, ".origin")->f, *slope = make(c, ".slope")->f;
    int logarithmic = json_is(fact(c, "kind"), "log_map");
    for (int k = 0; k < near->size; k++) {
        if (near->f[k] == INFINITY) continue;
        origin[k] = near->f[k];
        float ratio = fmaxf(far[k] / near->f[k], LEAST_RATIO);
        slope[k] = fmaxf(2.0f * e - 1.0f, 0.5f * e) / (logarithmic ? log2f(ratio) : near->f[k] * (ratio - 1.0f));
    }
}

typedef struct { float origin, slope, range; int logarithmic; } Scale;

static float depth_of(const Scale *s, float z) {
    float beyond = s->logarithmic ? log2f(z / s->origin) : z - s->origin;
    return z == INFINITY ? s->range : clampf(beyond * s->slope, 0.0f, s->range);
}

static float distance_of(const Scale *s, float t) {
    return s->logarithmic ? s->origin * exp2f(t / s->slope) : s->origin + t / s->slope;
}

static Scale scale_of(Case *c, int map) {
    Scale s = {get(c, ".origin")->f[map], get(c, ".slope")->f[map], get(c, ".end")->f[0],
               *fact(c, "logarithmic") == 't'};
    return s;
}

/* Beyond the disc stands what is mirrored at the light's plane: the texel at (s, t) / (s^2 + t^2). */
void depths_stage(Case *c) {
    const Array *depth = get(c, "depth_maps");
    float *out = make(c, "")->f;
    int n = depth->shape[1];
    for (int k = 0; k < depth->size; k++) {
        Scale scale = scale_of(c, k / (n * n));
        float s = 2.0f * ((float)(k % n) + 0.5f) / (float)n - 1.0f, t = 2.0f * ((float)(k / n % n) + 0.5f) / (float)n - 1.0f;
        float q = s * s + t * t;
        int column = k % n, row = k / n % n;
        if (q > 1.0f) { /* no nearer to the rim than a texel whose centre lies within must be */
            float shrink = fminf(1.0f / sqrtf(q), 1.0f - INSIDE / (float)n) / sqrtf(q);
            column = (int)(0.5f * (s * shrink + 1.0f) * (float)n);
            row = (int)(0.5f * (t * shrink + 1.0f) * (float)n);
        }
        if (scale.origin > 0.0f) out[k] = depth_of(&scale, depth->f[k / (n * n) * n * n + row * n + column]);
    }
}

/* A map with something on it has depths above 0: its texels without are at the far end. */
static int is_empty(const float *t, int texels) {
    while (texels > 0 && t[texels - 1] == 0.0f) texels--;
    return texels == 0;
}

void basis_stage(Case *c) {
    const Array *t = get(c, "map_depths");
    float *out = make(c, "")->f;
    int plane = t->shape[1] * t->shape[2], m = (int)number(c, "terms"), channels = 4 * m + 1;
    for (int k = 0; k < t->size; k++) {
        float *to = out + (k / plane) * channels * plane + k % plane, z = t->f[k];
        if (is_empty(t->f + k / plane * plane, plane)) continue;
        for (int j = 0; j < m; j++) {
            to[j * plane] = sinf(phase(j, z));
            to[(m + j) * plane] = cosf(phase(j, z));
            to[(2 * m + j) * plane] = z * to[j * plane];
            to[(3 * m + j) * plane] = z * to[(m + j) * plane];
        }
        to[4 * m * plane] = z;
    }
}

/* Means of 2 x 2 texels; of an odd side the last counts twice. */
void mip_stage(Case *c) {
    const Array *from = get(c, "basis");
    for (int level = 1; level <= writes(c, ""); level++) {
        Array *to = make_at(c, "", level - 1);
        int n = to->shape[2], side = from->shape[2];
        for (int k = 0; k < to->size; k++) {
            const float *plane = from->f + k / (n * n) * side * side;
            int y = 2 * (k / n % n), x = 2 * (k % n), below = y + 1 < side ? y + 1 : y, right = x + 1 < side ? x + 1 : x;
            to->f[k] = 0.25f * (plane[y * side + x] + plane[y * side + right] + plane[below * side + x] + plane[below * side + right]);
        }
        from = to;
    }
}

typedef struct { vec3 center; const float *frame; float delta, near; } Area;

static Area area_of(Case *c, int map) {
    Area a = {row3(get(c, ".center")->f + 3 * map), get(c, ".frame")->f + 9 * map, get(c, ".delta")->f[map],
              get(c, ".near")->f[map]};
    return a;
}

/* The disc that a cone of half-angle a covers on the map (E-VAL-08); tangent = Delta (d - z) / (2 d z). */
static void put_region(const Area *a, vec3 away, float d, float z, float *region, int plane) {
    float limit = STEEPEST * PI / 180.0f, angle = fminf(atanf(a->delta * (d - z) / (2.0f * d * z)), limit);
    float sum = dot(row3(a->frame + 6), away) / d + cosf(angle);
    region[0] = dot(row3(a->frame), away) / d / sum;
    region[plane] = dot(row3(a->frame + 3), away) / d / sum;
    region[2 * plane] = sinf(angle) / sum;
}

void search_stage(Case *c) {
    Array *pending = make(c, ".pending");
    float *region = make(c, ".region")->f, *distance = make(c, ".distance")->f;
    const int *id = get(c, "_triangles")->i;
    int plane = pending->size / pending->shape[0];
    for (int k = 0; k < pending->size; k++) {
        int map = k / plane, pixel = k % plane;
        Area a = area_of(c, map);
        vec3 away = sub(plane3(get(c, ".position")->f, plane, pixel), a.center);
        float d = length(away);
        if (id[pixel] < 0 || a.near == INFINITY || a.delta <= 0.0f || dot(row3(a.frame + 6), away) <= 0.0f || d <= a.near) continue;
        pending->i[k] = 1;
        distance[k] = d;
        put_region(&a, away, d, a.near, region + 3 * plane * map + pixel, plane);
    }
}

/* Bilinear read of a level at (x, y) in texels of level 0. */
static float bilinear(const float *plane, int side, float x, float y) {
    float fx = clampf(x - 0.5f, 0.0f, (float)(side - 1)), fy = clampf(y - 0.5f, 0.0f, (float)(side - 1));
    int i = (int)fx, j = (int)fy, right = i + 1 < side ? i + 1 : i, below = j + 1 < side ? j + 1 : j;
    float a = fx - (float)i, b = fy - (float)j;
    return (1.0f - b) * ((1.0f - a) * plane[j * side + i] + a * plane[j * side + right])
           + b * ((1.0f - a) * plane[below * side + i] + a * plane[below * side + right]);
}

/* Means of the channels over a disc, by 8 texels of two levels: level max(0, log2(radius side) - 1). */
void means_stage(Case *c) {
    const Array *wanted = get_at(c, "", 0), *region = get(c, ".region"), *level[12] = {get(c, "basis")};
    Array *out = make(c, "");
    int levels = 1, channels = out->shape[1], plane = wanted->size / wanted->shape[0], n = level[0]->shape[2];
    for (; levels < 12 && levels <= has(c, "mip_levels"); levels++) level[levels] = get_at(c, "mip_levels", levels - 1);
    for (int k = 0; k < wanted->size; k++) {
        const float *disc = region->f + 3 * plane * (k / plane) + k % plane;
        if (!wanted->i[k]) continue;
        float x = 0.5f * (disc[0] + 1.0f) * (float)n, y = 0.5f * (disc[plane] + 1.0f) * (float)n;
        float fine = clampf(log2f(disc[2 * plane] * (float)n) - 1.0f, 0.0f, (float)(levels - 1));
        int low = (int)fine, high = low + 1 < levels ? low + 1 : low;
        for (int j = 0; j < channels; j++) {
            float value[2];
            for (int two = 0; two < 2; two++) {
                const Array *at = level[two ? high : low];
                int side = at->shape[2];
                float shrink = 1.0f / (float)(1 << (two ? high : low));
                value[two] = bilinear(at->f + (k / plane * at->shape[1] + j) * side * side, side, x * shrink, y * shrink);
            }
            out->f[(k / plane * channels + j) * plane + k % plane] = value[0] + (fine - (float)low) * (value[1] - value[0]);
        }
    }
}

/* sum w_k (cos(c_k d) S_k - sin(c_k d) C_k), from channel `first` on. */
static float test(Case *c, const Array *means, int k, int plane, int first, float d) {
    int m = get(c, ".weight")->size, channels = means->shape[1];
    const float *at = means->f + (k / plane * channels + first) * plane + k % plane, *weight = get(c, ".weight")->f;
    float sum = 0.0f;
    for (int j = 0; j < m; j++)
        sum += weight[j] * (cosf(phase(j, d)) * at[j * plane] - sinf(phase(j, d)) * at[(m + j) * plane]);
    return sum;
}

void penumbra_stage(Case *c) {
    const Array *pending = get(c, ".pending"), *means = get(c, "_means");
    int *shaded = make(c, ".shaded")->i, plane = pending->size / pending->shape[0], m = get(c, ".weight")->size;
    float *z_avg = make(c, ".z_avg")->f, *region = make(c, ".region")->f, *depth = make(c, ".t")->f;
    float least = number(c, "least blocked share"), bias = get(c, ".bias")->f[0];
    for (int k = 0; k < pending->size; k++) {
        int map = k / plane, pixel = k % plane;
        if (!pending->i[k]) continue;
        Area a = area_of(c, map);
        Scale s = scale_of(c, map);
        vec3 away = sub(plane3(get(c, ".position")->f, plane, pixel), a.center);
        float d = length(away), t = depth[k] = depth_of(&s, d), blocked = 0.5f - test(c, means, k, plane, 0, t - bias);
        if (blocked < least) continue;
        float mean = 0.5f * means->f[(map * means->shape[1] + 4 * m) * plane + pixel];
        float behind = (mean - test(c, means, k, plane, 2 * m, t - bias)) / blocked;
        float z = clampf(distance_of(&s, behind), a.near, d);
        shaded[k] = 1;
        z_avg[k] = z;
        put_region(&a, away, d, z, region + 3 * plane * map + pixel, plane);
    }
}

void csm_visibility_stage(Case *c) {
    const Array *shaded = get(c, ".shaded"), *means = get(c, "_means");
    const float *depth = get(c, ".t")->f, *hard = has(c, "depth_tests") ? get(c, "depth_tests")->f : NULL;
    float *share = make(c, "")->f, gain = number(c, "gain");
    int plane = shaded->size / shaded->shape[0];
    for (int k = 0; k < shaded->size; k++) {
        if (!shaded->i[k] && !hard) { /* every light has an extent */
            share[k] = 1.0f;
            continue;
        }
        float f = shaded->i[k] ? 0.5f + test(c, means, k, plane, 0, depth[k] - get(c, ".bias")->f[1]) : 1.0f;
        share[k] = shaded->i[k] ? clampf(gain * f, 0.0f, 1.0f) : hard[k];
    }
}
