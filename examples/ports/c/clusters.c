/* Clusters of pixel lights by k-means over position and normal (VAL Sec. 5.1, E-VAL-11), and their shared visibility. */
#include "json.h"
#include "stages.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct { int lights, count; const float *position, *normal; float *center, *axis; float wx, wa, diagonal; } Clusters;

static float number(Case *c, const char *object, const char *key) {
    return (float)json_number(json_at(fact(c, "%s", object), key), 0);
}

static void widen(float *box, vec3 p) {
    const float xyz[3] = {p.x, p.y, p.z};
    for (int k = 0; k < 3; k++) {
        box[k] = fminf(box[k], xyz[k]);
        box[3 + k] = fmaxf(box[3 + k], xyz[k]);
    }
}

void extents_stage(Case *c) {
    const Array *id = get(c, "gbuffer.triangle_id");
    float *visible = make(c, "extents.visible")->f, *lit = make(c, "extents.illuminated")->f;
    for (int k = 0; k < 3; k++) visible[k] = lit[k] = INFINITY, visible[3 + k] = lit[3 + k] = -INFINITY;
    for (int k = 0; k < id->size; k++)
        if (id->i[k] >= 0) widen(visible, plane3(get(c, "gbuffer.position")->f, id->size, k));
    for (int map = 0; fact(c, "rsm%d", map); map++) {
        const Array *position = get(c, "rsm%d.position", map);
        for (int k = 0; k < position->size / 3; k++)
            if (sends(c, map, k)) widen(lit, plane3(position->f, position->size / 3, k));
    }
}

static Clusters clusters_of(Case *c, int round) {
    Clusters k = {get(c, "lights.position")->shape[1], (int)number(c, "kmeans", "clusters"), get(c, "lights.position")->f,
                  get(c, "lights.normal")->f, 0, 0, number(c, "kmeans", "w_x"), number(c, "kmeans", "w_a"), 1.0f};
    if (round >= 0) k.center = get(c, "kmeans.center%d", round)->f, k.axis = get(c, "kmeans.normal%d", round)->f;
    if (!has(c, "kmeans.center0")) return k;
    const float *box = get(c, "extents.illuminated")->f;
    k.diagonal = length(sub(row3(box + 3), row3(box)));
    return k;
}

/* d = w_x dx / diagonal + w_a angle / pi; the lowest index of equally near clusters. */
static int nearest(const Clusters *k, int light, float *least) {
    vec3 p = plane3(k->position, k->lights, light), n = plane3(k->normal, k->lights, light);
    int best = 0;
    *least = INFINITY;
    for (int j = 0; j < k->count; j++) {
        vec3 axis = plane3(k->axis, k->count, j);
        float angle = atan2f(length(cross(n, axis)), dot(n, axis));
        float d = k->wx * length(sub(p, plane3(k->center, k->count, j))) / k->diagonal + k->wa * angle / PI;
        if (d < *least) *least = d, best = j;
    }
    return best;
}

static void means(const Clusters *k, const int *of, float *center, float *axis) {
    for (int j = 0; j < k->count; j++) {
        vec3 place = v3(0, 0, 0), normal = v3(0, 0, 0);
        int members = 0;
        for (int light = 0; light < k->lights; light++) {
            if (of[light] != j) continue;
            place = add(place, plane3(k->position, k->lights, light));
            normal = add(normal, plane3(k->normal, k->lights, light));
            members++;
        }
        put3(center, k->count, j, members ? scale(place, 1.0f / (float)members) : plane3(k->center, k->count, j));
        put3(axis, k->count, j, length(normal) > 0.0f ? normalize(normal) : plane3(k->axis, k->count, j));
    }
}

void kmeans_start_stage(Case *c) {
    Clusters k = clusters_of(c, -1);
    float *center = make(c, "kmeans.center0")->f, *axis = make(c, "kmeans.normal0")->f;
    for (int j = 0; j < k.count; j++) {
        int light = j * k.lights / k.count;
        put3(center, k.count, j, plane3(k.position, k.lights, light));
        put3(axis, k.count, j, plane3(k.normal, k.lights, light));
    }
}

void kmeans_assign_stage(Case *c, int round) {
    Clusters k = clusters_of(c, round);
    int *of = make(c, "kmeans.of%d", round)->i;
    float *distance = make(c, "kmeans.distance%d", round)->f;
    for (int light = 0; light < k.lights; light++) of[light] = nearest(&k, light, distance + light);
}

void kmeans_means_stage(Case *c, int round) {
    Clusters k = clusters_of(c, round - 1);
    means(&k, get(c, "kmeans.of%d", round - 1)->i, make(c, "kmeans.center%d", round)->f, make(c, "kmeans.normal%d", round)->f);
}

/* Rounds from the second on, until no light changes its cluster. */
void kmeans_stage(Case *c) {
    int rounds = has(c, "kmeans.center2");
    Clusters k = clusters_of(c, rounds ? 2 : -1);
    float *center = make(c, "clusters.center")->f, *axis = make(c, "clusters.normal")->f, distance;
    int *of = make(c, "clusters.of")->i, changed = rounds;
    size_t size = 3 * (size_t)k.count * sizeof(float);
    for (int light = 0; light < k.lights; light++) of[light] = rounds ? nearest(&k, light, &distance) : light;
    memcpy(center, rounds ? k.center : k.position, size);
    memcpy(axis, rounds ? k.axis : k.normal, size);
    for (int round = 2; changed && round < (int)number(c, "kmeans", "most rounds"); round++) {
        k.center = center;
        k.axis = axis;
        means(&k, of, center, axis);
        changed = 0;
        for (int light = 0; light < k.lights; light++) {
            int now = nearest(&k, light, &distance);
            changed |= now != of[light];
            of[light] = now;
        }
    }
}

/* E = sum V_m E_m over all clusters. */
void shared_sum_stage(Case *c) {
    const Array *parts = get(c, "parts.irradiance"), *share = get(c, "visibility.share");
    Array *made = make(c, "sum.irradiance");
    int plane = made->size / 3;
    for (int k = 0; k < parts->size; k++)
        made->f[k % made->size] += parts->f[k] * share->f[k / made->size * plane + k % plane];
}
