/* Percentage closer filtering: tests of texels around a receiver's own against its tangent plane (E-VAL-14). */
#include "json.h"
#include "stages.h"

typedef struct { vec3 center, place, normal; const float *frame, *depth; int n; float slack; } Test;

/* Whether the map holds a direction of the hemisphere there: the unit disc. */
static int in_disc(const Test *t, int row, int column) {
    float s = 2.0f * ((float)column + 0.5f) / (float)t->n - 1.0f, r = 2.0f * ((float)row + 0.5f) / (float)t->n - 1.0f;
    return row >= 0 && column >= 0 && row < t->n && column < t->n && s * s + r * r <= 1.0f;
}

/* Whether what a texel holds lies on the light's side of the receiver's plane, and before the receiver, by more than
   the slack. */
static int hides(const Test *t, int row, int column) {
    float s = 2.0f * ((float)column + 0.5f) / (float)t->n - 1.0f, r = 2.0f * ((float)row + 0.5f) / (float)t->n - 1.0f;
    float q = 1.0f + s * s + r * r, z = t->depth[row * t->n + column];
    if (z == INFINITY) return 0;
    vec3 w = scale(add(add(scale(row3(t->frame), 2.0f * s), scale(row3(t->frame + 3), 2.0f * r)),
                       scale(row3(t->frame + 6), 2.0f - q)), 1.0f / q);
    float height = dot(t->normal, sub(t->center, t->place)), along = dot(t->normal, w);
    if (height < 0.0f) height = -height, along = -along;
    if (z >= length(sub(t->place, t->center)) * (1.0f - t->slack)) return 0;
    return along >= 0.0f || z < height / -along * (1.0f - t->slack);
}

static float share_of(const Test *t, int side) {
    vec3 away = sub(t->place, t->center);
    float d = length(away), forward = dot(row3(t->frame + 6), away);
    float s = dot(row3(t->frame), away) / (d + forward), r = dot(row3(t->frame + 3), away) / (d + forward);
    int column = (int)(0.5f * (s + 1.0f) * (float)t->n), row = (int)(0.5f * (r + 1.0f) * (float)t->n), hidden = 0, count = 0;
    for (int y = row - side / 2; y <= row + side / 2; y++)
        for (int x = column - side / 2; x <= column + side / 2; x++) {
            if (!in_disc(t, y, x) && (y != row || x != column)) continue; /* the receiver's own counts always */
            hidden += hides(t, y, x);
            count++;
        }
    return count ? 1.0f - (float)hidden / (float)count : 1.0f;
}

/* `points_only`: one test, of lights without extent alone. */
void depth_tests_stage(Case *c) {
    const Array *depth = get(c, "depth_maps"), *id = get(c, "_triangles");
    const float *facing = get(c, has(c, "facing") ? "facing" : ".normal")->f;
    Array *share = make(c, "");
    int plane = id->size, side = (int)number(c, "texels"), hard = *fact(c, "points_only") == 't';
    for (int k = 0; k < share->size; k++) {
        int map = k / plane, pixel = k % plane;
        float delta = get(c, ".delta")->f[map];
        Test t = {row3(get(c, ".center")->f + 3 * map), plane3(get(c, ".position")->f, plane, pixel),
                  plane3(facing, plane, pixel), get(c, ".frame")->f + 9 * map,
                  depth->f + map * depth->shape[1] * depth->shape[2], depth->shape[1],
                  number(c, "slack, of the distance")};
        share->f[k] = 1.0f;
        if (id->i[pixel] < 0 || get(c, ".near")->f[map] == INFINITY || (hard && delta > 0.0f)) continue;
        if (dot(row3(t.frame + 6), sub(t.place, t.center)) <= 0.0f) continue;
        share->f[k] = share_of(&t, delta > 0.0f ? side : 1);
    }
}

void facing_stage(Case *c) {
    const Array *id = get(c, "_triangles");
    const float *normal = get(c, ".normal")->f;
    float *out = make(c, "")->f;
    for (int k = 0; k < id->size; k++)
        if (id->i[k] >= 0) put3(out, id->size, k, face_normal(c, id->i[k], scale(plane3(normal, id->size, k), -1.0f)));
}
