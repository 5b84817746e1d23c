/* Every stage of the port. Each reads its arrays from the case and makes those that the manifest says it writes. */
#ifndef STAGES_H
#define STAGES_H
#include "case.h"

/* A camera or a map of a light: `maps` pictures of rows x columns, stacked along rows. */
typedef struct {
    enum { PERSPECTIVE, ORTHOGRAPHIC } kind;
    int maps, rows, columns;
    const float *origin, *frame, *half;
} View;

typedef struct { vec3 origin, direction; } Ray;

typedef struct { const float *strength, *place, *direction, *half_angles; } Lamp; /* NULL: it has none */

View view_of(Case *c); /* that of the projection which the stage reads */
Ray texel_ray(const View *v, int map, float row, float column); /* through a place; centres lie at + 1/2 */
vec3 view_point(const View *v, int map, vec3 world);            /* along right, down, forward */
vec3 face_normal(Case *c, int triangle, vec3 seen_along);       /* unit, on the side that a ray sees */
vec3 normal_at(Case *c, int triangle, Ray ray);                 /* interpolated where there are vertex normals */
Lamp lamp_of(Case *c, int k);
int sends(Case *c, int map, int texel);                         /* whether a texel of a map has flux */

/* Every stage by its kind, and the function that runs it, file by file. */
#define STAGES(row) \
    /* buffers.c */ \
    row("rsm.visible_triangles", ids) row("rsm.map_triangles", ids) row("rsm.surface", surface) \
    row("rsm.map_surface", surface) \
    /* flux.c, levels.c, pcf.c, clusters.c */ \
    row("rsm.reflected_flux", flux) row("rsm.direct_irradiance", direct) row("rsm.facing", facing) \
    row("rsm.visible_extent", visible_extent) row("rsm.illuminated_extent", illuminated_extent) \
    /* lights.c, warp.c */ \
    row("lights.halton_points", halton) row("lights.grid_points", grid) row("lights.importance", importance) \
    row("lights.texels", texels) row("lights.pixel_lights", lights) row("lights.footprints", footprints) \
    row("lights.warp", warp) \
    /* sums.c */ \
    row("pairs.pairs", pairs) row("pairs.sum", sum) row("multires.subsplat_irradiance", subsplat_irradiance) \
    /* multires.c */ \
    row("multires.depth_ranges", depth_ranges) row("multires.normal_ranges", normal_ranges) \
    row("multires.discontinuities", discontinuities) row("multires.states", states) \
    row("multires.subsplats", subsplats) \
    /* subsplats.c */ \
    row("multires.points", subsplat_points) row("multires.upsample_level", upsample_level) \
    row("multires.upsample_at_once", upsample_nearest) row("multires.detail", detail) \
    /* levels.c, crown.c, bilateral.c */ \
    row("sssil.first_level", level) row("sssil.coarser_level", level) row("sssil.points_and_shifts", shifts) \
    row("sssil.crown_samples", samples) row("sssil.gather_samples", gather) row("sssil.blur", blur) \
    row("sssil.upsample", upsample) \
    /* clusters.c */ \
    row("cluster.kmeans_start", kmeans_start) row("cluster.kmeans_assign", kmeans_assign) \
    row("cluster.kmeans_means", kmeans_means) row("cluster.kmeans_rounds", kmeans_rounds) \
    row("cluster.kmeans_each", kmeans_each) row("cluster.shadowed", shared_sum) \
    /* csm.c, pcf.c */ \
    row("cluster.series", series) row("cluster.depth_scale", scale) row("cluster.map_depths", depths) \
    row("cluster.basis", basis) row("cluster.mip_levels", mip) row("cluster.search", search) \
    row("cluster.mip_means", means) row("cluster.csm_penumbra", penumbra) row("cluster.csm", csm_visibility) \
    row("cluster.depth_tests", depth_tests)

#define DECLARED(kind, run) void run##_stage(Case *c);
STAGES(DECLARED)

float spot_integral(float x0, float x1, float y0, float y1, float inner, float outer, int squared); /* spot.c */
float lobe_norm(vec3 normal, vec3 axis, float exponent);                               /* lobes.c */
float lobe_shape(vec3 axis, vec3 direction, float exponent);

#endif
