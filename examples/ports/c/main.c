/* port KIT OUT [--chained] [CASE ...]: run every stage that the port knows, of all cases of a kit or of some. */
#define _POSIX_C_SOURCE 200809L
#include "case.h"
#include "json.h"
#include "stages.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static const struct { const char *end; void (*run)(Case *, int); } OF_MAPS[] = {
    {"flux", flux_stage}, {"points", points_stage}, {"importance", importance_stage}, {"warp", warp_stage},
    {"texels", texels_stage},
};
static const struct { const char *format; void (*run)(Case *, int); } OF_LEVELS[] = {
    {"multires.upsample.%d%n", upsample_level_stage}, {"level%d%n", level_stage}, {"shifts of samples%d%n", shifts_stage},
    {"samples%d%n", samples_stage}, {"gather%d%n", gather_stage}, {"blur%d%n", blur_stage}, {"light%d%n", light_stage},
    {"kmeans.assign%d%n", kmeans_assign_stage}, {"kmeans.means%d%n", kmeans_means_stage},
};
static const struct { const char *name; void (*run)(Case *); } STAGES[] = {
    {"multires.discontinuities", discontinuities_stage}, {"multires.states", states_stage},
    {"multires.subsplats", subsplats_stage}, {"multires.points", subsplat_points_stage},
    {"multires.irradiance", subsplat_irradiance_stage}, {"multires.upsample", upsample_nearest_stage},
    {"multires.detail", detail_stage}, {"direct", direct_stage}, {"picture", picture_stage}, {"extents", extents_stage}, {"kmeans.start", kmeans_start_stage}, {"kmeans", kmeans_stage}, {"series", series_stage},
    {"scale", scale_stage}, {"maps.t", depths_stage}, {"basis", basis_stage}, {"mip", mip_stage}, {"search", search_stage},
    {"hard", hard_stage}, {"facing", facing_stage}, {"lights", lights_stage}, {"footprints", footprints_stage}, {"sum", sum_stage}, {"pairs", pairs_stage},
};
#define COUNT(list) (sizeof(list) / sizeof *(list))

static int begins(const char *name, const char *with) { return !strncmp(name, with, strlen(with)); }

/* Forms of stages that the port does not have, by the same names: they are of the full kit. */
static int is_other_form(Case *c, const char *name) {
    if (begins(name, "level")) return has(c, "level0.count") || !has(c, "level0.pixel");
    if (begins(name, "samples")) return !has(c, "samples0.shifts");
    if ((begins(name, "light") && strcmp(name, "lights")) || !strcmp(name, "picture"))
        return json_is(json_at(fact(c, "upsampling"), "depth_of_a_texel"), "mean, at its centre");
    if (!strcmp(name, "basis") || !strcmp(name, "mip")) return fact(c, "basis.stored") != NULL;
    if (!strcmp(name, "visibility") && !has(c, "penumbra.means"))
        return has(c, "maps.behind") || !json_at(fact(c, "visibility.test"), "side of the kernel, texels");
    return !strcmp(name, "multires.irradiance") && has(c, "multires.visible");
}

/* Run the stage; 0 where the port has none of this name. Stages of maps are named rsm0.flux and so on. */
static int run(Case *c, const char *name) {
    if (is_other_form(c, name)) return 0;
    char group[64], end[64] = "";
    int map = 0, of_map = sscanf(name, "rsm%d.%63s", &map, end) == 2;
    if (sscanf(name, "%63[^.].%63s", group, end) == 2 && (of_map || !strcmp(group, "gbuffer"))) {
        const char *view = of_map ? group : "camera";
        if (!strcmp(end, "ids")) return ids_stage(c, group, view), 1;
        if (!strcmp(end, "surface")) return surface_stage(c, group, view), 1;
    }
    for (size_t k = 0; of_map && k < COUNT(OF_MAPS); k++)
        if (!strcmp(end, OF_MAPS[k].end)) return OF_MAPS[k].run(c, map), 1;
    int level = 0;
    if (!strcmp(name, "multires.depth_ranges")) return ranges_stage(c, "depth"), 1;
    if (!strcmp(name, "multires.normal_ranges")) return ranges_stage(c, "normal"), 1;
    if (!strcmp(name, "search.means")) return means_stage(c, "search", "pending"), 1;
    if (!strcmp(name, "penumbra.means")) return means_stage(c, "penumbra", "shaded"), 1;
    /* Stages of one name differ in what they read. */
    if (!strcmp(name, "sum") && has(c, "visibility.share")) return has(c, "parts.irradiance") && (shared_sum_stage(c), 1);
    if (!strcmp(name, "penumbra")) return has(c, "search.means") && (penumbra_stage(c), 1);
    if (!strcmp(name, "visibility") && has(c, "penumbra.means")) return csm_visibility_stage(c), 1;
    if (!strcmp(name, "visibility")) return fact(c, "visibility.test") && (pcf_stage(c), 1);
    for (size_t k = 0; k < COUNT(OF_LEVELS); k++) {
        int length = 0;
        if (sscanf(name, OF_LEVELS[k].format, &level, &length) == 1 && !name[length]) return OF_LEVELS[k].run(c, level), 1;
    }
    for (size_t k = 0; k < COUNT(STAGES); k++)
        if (!strcmp(name, STAGES[k].name)) return STAGES[k].run(c), 1;
    return 0;
}

static void run_case(const char *kit, const char *out, const char *id, int chained) {
    Case c;
    char folder[1024], name[96];
    snprintf(folder, sizeof folder, "%s/%s", out, id);
    mkdir(folder, 0777);
    case_open(&c, kit, out, id, chained);
    for (const char *p = json_first(json_at(c.manifest, "stages")); p; p = json_next(p)) {
        c.stage = p;
        json_string(json_at(p, "name"), name, sizeof name);
        if (run(&c, name)) printf("%s %s\n", id, name);
        case_store(&c);
    }
    case_close(&c);
}

static int asked(int argc, char **argv, const char *id) {
    int any = 0;
    for (int k = 3; k < argc; k++) {
        if (!strcmp(argv[k], id)) return 1;
        any |= strcmp(argv[k], "--chained") != 0;
    }
    return !any;
}

int main(int argc, char **argv) {
    int chained = 0;
    if (argc < 3) {
        fprintf(stderr, "usage: port KIT OUT [--chained] [CASE ...]\n");
        return 2;
    }
    for (int k = 3; k < argc; k++) chained |= !strcmp(argv[k], "--chained");
    char path[1024], id[80];
    snprintf(path, sizeof path, "%s/kit.json", argv[1]);
    char *text = text_of(path);
    mkdir(argv[2], 0777);
    for (const char *p = json_first(json_at(text, "cases")); p; p = json_next(p)) {
        json_string(json_at(p, "id"), id, sizeof id);
        if (asked(argc, argv, id)) run_case(argv[1], argv[2], id, chained);
    }
    free(text);
    return 0;
}
