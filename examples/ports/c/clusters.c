/* Clusters of pixel lights by k-means over position and normal (VAL Sec. 5.1, E-VAL-11), and their shared visibility. */
#include "json.h"
#include "stages.h"
#include <string.h>

typedef struct { int lights, count; const float *position, *normal; float *center, *axis; float wx, wa, diagonal; } Clusters;

typedef struct { float *low, *high; } Box;

static Box box_of(Case *c) {
    Box box = {make(c, ".low")->f, make(c, ".high")->f};
    for (int k = 0; k < 3; k++) box.low[k] = INFINITY, box.high[k] = -INFINITY;
    return box;
}

static void widen(Box box, vec3 p) {
    const float xyz[3] = {p.x, p.y, p.z};
    for (int k = 0; k < 3; k++) {
        box.low[k] = fminf(box.low[k], xyz[k]);
        box.high[k] = fmaxf(box.high[k], xyz[k]);
    }
}

void visible_extent_stage(Case *c) {
    const Array *id = get(c, "_triangles");
    Box visible = box_of(c);
    for (int k = 0; k < id->size; k++)
        if (id->i[k] >= 0) widen(visible, plane3(get(c, ".position")->f, id->size, k));
}

/* Of maps of at most 96 x 96 texels: every texel. */
void illuminated_extent_stage(Case *c) {
    Box lit = box_of(c);
    for (int map = 0; map < has(c, ".position"); map++) {
        const Array *position = get_at(c, ".position", map);
        for (int k = 0; k < position->size / 3; k++)
            if (sends(c, map, k)) widen(lit, plane3(position->f, position->size / 3, k));
    }
}

static Clusters clusters_of(Case *c) {
    const Array *position = get(c, ".position"), *center = has(c, ".center") ? get(c, ".center") : NULL;
    Clusters k = {position->shape[1], (int)number(c, "count"), position->f, get(c, ".normal")->f, 0, 0,
                  number(c, "w_x"), number(c, "w_a"), 1.0f};
    if (center) k.count = center->shape[1], k.center = center->f, k.axis = get(c, ".axis")->f;
    if (has(c, ".low")) k.diagonal = length(sub(row3(get(c, ".high")->f), row3(get(c, ".low")->f)));
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
    Clusters k = clusters_of(c);
    float *center = make(c, ".center")->f, *axis = make(c, ".axis")->f;
    for (int j = 0; j < k.count; j++) {
        int light = j * k.lights / k.count;
        put3(center, k.count, j, plane3(k.position, k.lights, light));
        put3(axis, k.count, j, plane3(k.normal, k.lights, light));
    }
}

void kmeans_assign_stage(Case *c) {
    Clusters k = clusters_of(c);
    int *of = make(c, ".of")->i;
    float *distance = make(c, ".distance")->f;
    for (int light = 0; light < k.lights; light++) of[light] = nearest(&k, light, distance + light);
}

void kmeans_means_stage(Case *c) {
    Clusters k = clusters_of(c);
    means(&k, get(c, ".of")->i, make(c, ".center")->f, make(c, ".axis")->f);
}

/* Each light is a cluster where as many are asked for. */
void kmeans_each_stage(Case *c) {
    const Array *position = get(c, ".position"), *normal = get(c, ".normal");
    int *of = make(c, ".of")->i, lights = position->shape[1];
    for (int light = 0; light < lights; light++) of[light] = light;
    memcpy(make(c, ".center")->f, position->f, (size_t)position->size * sizeof(float));
    memcpy(make(c, ".normal")->f, normal->f, (size_t)normal->size * sizeof(float));
}

/* Further rounds, until no light changes its cluster. */
void kmeans_rounds_stage(Case *c) {
    Clusters k = clusters_of(c);
    float *center = make(c, ".center")->f, *axis = make(c, ".normal")->f, distance;
    int *of = make(c, ".of")->i, changed = 1;
    size_t size = 3 * (size_t)k.count * sizeof(float);
    for (int light = 0; light < k.lights; light++) of[light] = nearest(&k, light, &distance);
    memcpy(center, k.center, size);
    memcpy(axis, k.axis, size);
    for (int round = 0; changed && round < (int)number(c, "rounds"); round++) {
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
    const Array *parts = get_at(c, "", 0), *share = get_at(c, "", 1);
    Array *made = make(c, "");
    int plane = made->size / 3;
    for (int k = 0; k < parts->size; k++)
        made->f[k % made->size] += parts->f[k] * share->f[k / made->size * plane + k % plane];
}
