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

View view_of(Case *c, const char *name);
Ray texel_ray(const View *v, int map, float row, float column); /* through a place; centres lie at + 1/2 */
vec3 view_point(const View *v, int map, vec3 world);            /* along right, down, forward */
vec3 face_normal(Case *c, int triangle, vec3 seen_along);       /* unit, on the side that a ray sees */
vec3 normal_at(Case *c, int triangle, Ray ray);                 /* interpolated where there are vertex normals */
int sends(Case *c, int map, int texel);                         /* whether a texel of a map has flux */

void ids_stage(Case *c, const char *name, const char *view);       /* buffers.c */
void surface_stage(Case *c, const char *name, const char *view);
void flux_stage(Case *c, int map);                                 /* flux.c */
void points_stage(Case *c, int map);                               /* lights.c */
void importance_stage(Case *c, int map);
void texels_stage(Case *c, int map);
void lights_stage(Case *c);
void footprints_stage(Case *c);
void warp_stage(Case *c, int map);                                 /* warp.c */
void sum_stage(Case *c);                                           /* sums.c */
void pairs_stage(Case *c);

void ranges_stage(Case *c, const char *what);                      /* multires.c */
void discontinuities_stage(Case *c);
void states_stage(Case *c);
void subsplats_stage(Case *c);
int multires_top(Case *c);
void subsplat_points_stage(Case *c);                               /* subsplats.c */
void upsample_level_stage(Case *c, int level);
void upsample_nearest_stage(Case *c);
void detail_stage(Case *c);
void subsplat_irradiance_stage(Case *c);                           /* sums.c */

void direct_stage(Case *c);                                        /* levels.c */
void level_stage(Case *c, int level);
void shifts_stage(Case *c, int level);                             /* crown.c */
void samples_stage(Case *c, int level);
void gather_stage(Case *c, int level);
void blur_stage(Case *c, int level);                               /* bilateral.c */
void light_stage(Case *c, int level);
void picture_stage(Case *c);

void extents_stage(Case *c);                                       /* clusters.c */
void kmeans_start_stage(Case *c);
void kmeans_assign_stage(Case *c, int round);
void kmeans_means_stage(Case *c, int round);
void kmeans_stage(Case *c);
void shared_sum_stage(Case *c);
void series_stage(Case *c);                                        /* csm.c */
void scale_stage(Case *c);
void depths_stage(Case *c);
void basis_stage(Case *c);
void mip_stage(Case *c);
void search_stage(Case *c);
void means_stage(Case *c, const char *stage, const char *asked);
void penumbra_stage(Case *c);
void csm_visibility_stage(Case *c);
void hard_stage(Case *c);                                          /* pcf.c */
void pcf_stage(Case *c);
void facing_stage(Case *c);

float spot_integral(float x0, float x1, float y0, float y1, float inner, float outer, int squared); /* spot.c */
float lobe_norm(vec3 normal, vec3 axis, float exponent);                               /* lobes.c */
float lobe_shape(vec3 axis, vec3 direction, float exponent);

#endif
