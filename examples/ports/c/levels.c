/* Direct light, and levels of the closest of four texels (HSS Sec. 4, Eq. 2). */
#include "json.h"
#include "stages.h"

#define SHADOWS 3 /* among what direct light reads: after position, normal and ids */

/* Smoothstep or squared ramp of a spot; the difference of cosines as one of tangents, which keeps its digits in float32. */
static float spot_share(vec3 axis, vec3 to_point, float inner, float outer, int squared) {
    float along = dot(axis, to_point) / length(axis), tangent, limit = tanf(outer), cosine = cosf(outer);
    if (along <= 0.0f) return 0.0f;
    tangent = length(cross(axis, to_point)) / (length(axis) * along);
    float square = 1.0f + tangent * tangent, width = 2.0f * sinf(0.5f * (outer - inner)) * sinf(0.5f * (outer + inner));
    float t = (limit - tangent) * (limit + tangent) * cosine * cosine / (square * (1.0f / sqrtf(square) + cosine) * width);
    t = clampf(t, 0.0f, 1.0f);
    if (squared) return t * t;
    return t * t * (3.0f - 2.0f * t);
}

void direct_stage(Case *c) {
    const Array *id = get(c, "_triangles");
    const float *position = get(c, ".position")->f, *normal = get(c, ".normal")->f;
    const char *falloff = json_first(fact(c, "falloff"));
    float *out = make(c, "")->f;
    for (int lamp = 0; lamp < has(c, "lamp.strength"); lamp++, falloff = json_next(falloff)) {
        Lamp l = lamp_of(c, lamp);
        int squared = json_is(falloff, "squared_ramp"), spot = l.half_angles != 0, far = !l.place;
        const int *visible = get_at(c, "", SHADOWS + lamp)->i;
        const float *power = l.strength, *cone = l.half_angles;
        vec3 place = far ? v3(0, 0, 0) : row3(l.place), axis = spot || far ? row3(l.direction) : v3(0, 0, 0);
        for (int k = 0; k < id->size; k++) {
            if (id->i[k] < 0 || !visible[k]) continue;
            vec3 d = far ? axis : sub(plane3(position, id->size, k), place);
            float square = dot(d, d), cosine = -dot(plane3(normal, id->size, k), d) / sqrtf(square);
            if (cosine <= 0.0f) continue;
            float share = (spot ? spot_share(axis, d, cone[0], cone[1], squared) : 1.0f) * cosine / (far ? 1.0f : square);
            put3(out, id->size, k, add(plane3(out, id->size, k), scale(row3(power), share)));
        }
    }
}

/* Nearer, or as near and nearer to the vertical centre line, or upper, or left. */
static int nearer(float depth, int pixel, float other, int than, int w) {
    if (depth != other) return depth < other;
    int off = 2 * (pixel % w) + 1 - w, off_than = 2 * (than % w) + 1 - w;
    off = off < 0 ? -off : off;
    off_than = off_than < 0 ? -off_than : off_than;
    return off != off_than ? off < off_than : pixel < than;
}

/* Pixels that a texel of 2^size pixels a side covers: fewer at the rim of the picture. */
static int covered(int h, int w, int size, int row, int column) {
    int y = h - (row << size), x = w - (column << size), side = 1 << size;
    return (y < side ? y : side) * (x < side ? x : side);
}

typedef struct { float *position, *depth, *normal, *radiance, *area; int *pixel, h, w; } Texels;

static Texels texels_of(Case *c, Array *(*of)(Case *, const char *)) {
    Array *depth = of(c, ".depth");
    Texels t = {of(c, ".position")->f, depth->f, of(c, ".normal")->f, of(c, ".radiance")->f, of(c, ".area")->f,
                of(c, ".pixel")->i, depth->shape[0], depth->shape[1]};
    return t;
}

/* A pixel as a texel: its place from the eye, what it reflects, and Eq. 2 with half angles for one pixel. */
static void put_pixel(Case *c, const View *v, Texels *t, int to, int pixel, int pixels) {
    int plane = t->h * t->w, count = v->rows * v->columns;
    float depth = get(c, ".depth")->f[pixel];
    Ray ray = texel_ray(v, 0, (float)(pixel / v->columns) + 0.5f, (float)(pixel % v->columns) + 0.5f);
    vec3 p = scale(ray.direction, depth), n = plane3(get(c, ".normal")->f, count, pixel);
    vec3 albedo = plane3(get(c, ".albedo")->f, count, pixel);
    vec3 light = scale(plane3(get(c, "direct_irradiance")->f, count, pixel), 1.0f / PI);
    put3(t->position, plane, to, p);
    put3(t->normal, plane, to, n);
    put3(t->radiance, plane, to, v3(albedo.x * light.x, albedo.y * light.y, albedo.z * light.z));
    t->depth[to] = depth;
    t->pixel[to] = pixel;
    t->area[to] = (float)pixels * 4.0f * depth * depth * v->half[0] * v->half[1] / (float)count * depth / fabsf(dot(n, p));
}

static void put_texel(Texels *t, int to, const Texels *from, int k, int pixels, int pixels_from) {
    int plane = t->h * t->w, source = from->h * from->w;
    put3(t->position, plane, to, plane3(from->position, source, k));
    put3(t->normal, plane, to, plane3(from->normal, source, k));
    put3(t->radiance, plane, to, plane3(from->radiance, source, k));
    t->depth[to] = from->depth[k];
    t->pixel[to] = from->pixel[k];
    t->area[to] = from->area[k] * (float)pixels / (float)pixels_from;
}

void level_stage(Case *c) {
    int level = !has(c, "direct_irradiance"), size = (int)number(c, "number"); /* level 0 or a coarser one */
    Texels t = texels_of(c, make), fine = {0};
    View v = {0};
    const float *depth = level ? 0 : get(c, ".depth")->f;
    if (level) {
        const char *picture = json_first(fact(c, "size"));
        fine = texels_of(c, get);
        v.rows = (int)json_number(picture, 0);
        v.columns = (int)json_number(json_next(picture), 0);
    } else v = view_of(c);
    int side = level ? 2 : 1 << size, h = level ? fine.h : v.rows, w = level ? fine.w : v.columns;
    for (int k = 0; k < t.h * t.w; k++) {
        int row = k / t.w, column = k % t.w, best = -1;
        float least = INFINITY;
        t.depth[k] = INFINITY;
        t.pixel[k] = -1;
        for (int j = 0; j < side * side; j++) {
            int y = row * side + j / side, x = column * side + j % side, at = y * w + x;
            if (y >= h || x >= w) continue;
            float here = level ? fine.depth[at] : depth[at];
            int pixel = level ? fine.pixel[at] : at, than = best < 0 ? 0 : level ? fine.pixel[best] : best;
            if (here < INFINITY && (best < 0 || nearer(here, pixel, least, than, v.columns))) best = at, least = here;
        }
        if (best < 0) continue;
        int pixels = covered(v.rows, v.columns, size, row, column);
        if (level) put_texel(&t, k, &fine, best, pixels, covered(v.rows, v.columns, size - 1, best / w, best % w));
        else put_pixel(c, &v, &t, k, best, pixels);
    }
}
