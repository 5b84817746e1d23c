/* What each texel of a camera or map sees: the nearest triangle, and depth, position, normal, albedo there. */
#include "json.h"
#include "stages.h"
#include <string.h>

/* The manifest says at the stage of its ids what a view is: rsm.map_triangles0.projection.origin. */
View view_of(Case *c) {
    char name[96] = "";
    for (int k = 0; k < c->reads; k++)
        if (strstr(c->read[k].name, ".projection.origin")) strcpy(name, c->read[k].name);
    *strstr(name, ".projection") = 0;
    const char *known = json_at(c->facts, name);
    View v;
    v.kind = json_is(json_at(known, "projection"), "parallel") ? ORTHOGRAPHIC : PERSPECTIVE;
    v.maps = (int)json_number(json_at(known, "maps"), 1);
    v.rows = (int)json_number(json_at(known, "rows"), 0);
    v.columns = (int)json_number(json_at(known, "columns"), 0);
    v.origin = get(c, "projection.origin")->f;
    v.frame = get(c, "projection.frame")->f;
    v.half = get(c, "projection.half")->f;
    return v;
}

/* Of a perspective view the direction has the length 1 along the axis, so that the ray's parameter is the depth. */
Ray texel_ray(const View *v, int map, float row, float column) {
    const float *axes = v->frame + 9 * map;
    float x = (2.0f * column / (float)v->columns - 1.0f) * v->half[0];
    float y = (2.0f * row / (float)v->rows - 1.0f) * v->half[1];
    vec3 across = add(scale(row3(axes), x), scale(row3(axes + 3), y)), origin = row3(v->origin + 3 * map);
    Ray ray = {origin, row3(axes + 6)};
    if (v->kind == ORTHOGRAPHIC) ray.origin = add(origin, across);
    else ray.direction = add(across, ray.direction);
    return ray;
}

vec3 view_point(const View *v, int map, vec3 world) {
    const float *axes = v->frame + 9 * map;
    vec3 p = sub(world, row3(v->origin + 3 * map));
    return v3(dot(row3(axes), p), dot(row3(axes + 3), p), dot(row3(axes + 6), p));
}

static void corners(Case *c, int triangle, vec3 *corner) {
    const float *vertices = get(c, "scene.vertices")->f;
    const int *face = get(c, "scene.faces")->i + 3 * triangle;
    for (int k = 0; k < 3; k++) corner[k] = row3(vertices + 3 * face[k]);
}

vec3 face_normal(Case *c, int triangle, vec3 seen_along) {
    vec3 p[3];
    corners(c, triangle, p);
    vec3 normal = normalize(cross(sub(p[1], p[0]), sub(p[2], p[0])));
    return dot(normal, seen_along) > 0.0f ? scale(normal, -1.0f) : normal;
}

/* Interpolated between the corners where there are vertex normals, on the visible side of the face. */
static vec3 shading_normal(Case *c, int triangle, vec3 face, vec3 point) {
    if (!has(c, "scene.vertex_normals")) return face;
    const float *normals = get(c, "scene.vertex_normals")->f;
    const int *corner = get(c, "scene.faces")->i + 3 * triangle;
    vec3 p[3], sum = v3(0, 0, 0);
    corners(c, triangle, p);
    for (int k = 0; k < 3; k++) {
        float share = dot(face, cross(sub(p[(k + 1) % 3], point), sub(p[(k + 2) % 3], point)));
        sum = add(sum, scale(row3(normals + 3 * corner[k]), share));
    }
    return normalize(dot(sum, face) < 0.0f ? scale(sum, -1.0f) : sum);
}

/* A centre on an edge belongs to the triangle whose first coefficient that is not 0 is positive (docs/rasterizer). */
static int inside(vec3 edge, vec3 place, float sign) {
    float e = dot(edge, place) * sign;
    if (e != 0.0f) return e > 0.0f;
    float first = edge.x != 0.0f ? edge.x : edge.y != 0.0f ? edge.y : edge.z;
    return first * sign > 0.0f;
}

/* Edge functions in homogeneous coordinates: (x w, y w, w), with w the depth, 1 in parallel projection. */
static float nearness(const View *v, const vec3 *corner, vec3 place) {
    vec3 p[3], edge[3];
    for (int k = 0; k < 3; k++) {
        p[k] = corner[k];
        if (v->kind == ORTHOGRAPHIC) p[k].z = 1.0f;
    }
    for (int k = 0; k < 3; k++) edge[k] = cross(p[(k + 1) % 3], p[(k + 2) % 3]);
    float det = dot(p[0], edge[0]), sign = det > 0.0f ? 1.0f : -1.0f, sum = 0.0f, depth = 0.0f;
    if (det == 0.0f) return -INFINITY;
    for (int k = 0; k < 3; k++) {
        if (!inside(edge[k], place, sign)) return -INFINITY;
        sum += dot(edge[k], place);
        depth += dot(edge[k], place) * corner[k].z;
    }
    return v->kind == ORTHOGRAPHIC ? -depth / sum : sum / det;
}

static float ray_depth(Case *c, int triangle, vec3 normal, Ray ray) {
    vec3 p[3];
    corners(c, triangle, p);
    return dot(normal, sub(p[0], ray.origin)) / dot(normal, ray.direction);
}

vec3 normal_at(Case *c, int triangle, Ray ray) {
    vec3 face = face_normal(c, triangle, ray.direction);
    return shading_normal(c, triangle, face, add(ray.origin, scale(ray.direction, ray_depth(c, triangle, face, ray))));
}

void ids_stage(Case *c) {
    View v = view_of(c);
    int *id = make(c, "")->i, triangles = get(c, "scene.faces")->shape[0];
    for (int map = 0; map < v.maps; map++)
        for (int row = 0; row < v.rows; row++)
            for (int column = 0; column < v.columns; column++, id++) {
                vec3 place = v3((2.0f * ((float)column + 0.5f) / (float)v.columns - 1.0f) * v.half[0],
                                (2.0f * ((float)row + 0.5f) / (float)v.rows - 1.0f) * v.half[1], 1.0f);
                float nearest = v.kind == ORTHOGRAPHIC ? -INFINITY : 0.0f;
                *id = -1;
                for (int k = 0; k < triangles; k++) {
                    vec3 corner[3];
                    corners(c, k, corner);
                    for (int j = 0; j < 3; j++) corner[j] = view_point(&v, map, corner[j]);
                    float here = nearness(&v, corner, place);
                    if (here > nearest) nearest = here, *id = k;
                }
            }
}

void surface_stage(Case *c) {
    View v = view_of(c);
    const int *id = get(c, "_triangles")->i, *material = get(c, "scene.material_of_face")->i;
    const float *diffuse = get(c, "materials.diffuse")->f;
    int count = v.maps * v.rows * v.columns;
    float *depth = make(c, ".depth")->f, *position = make(c, ".position")->f;
    float *normal = make(c, ".normal")->f, *albedo = make(c, ".albedo")->f;
    for (int k = 0; k < count; k++) {
        depth[k] = INFINITY;
        if (id[k] < 0) continue;
        int map = k / (v.rows * v.columns), row = k / v.columns % v.rows;
        Ray ray = texel_ray(&v, map, (float)row + 0.5f, (float)(k % v.columns) + 0.5f);
        vec3 n = face_normal(c, id[k], ray.direction);
        depth[k] = ray_depth(c, id[k], n, ray);
        put3(position, count, k, add(ray.origin, scale(ray.direction, depth[k])));
        put3(normal, count, k, shading_normal(c, id[k], n, plane3(position, count, k)));
        put3(albedo, count, k, row3(diffuse + 3 * material[id[k]]));
    }
}
