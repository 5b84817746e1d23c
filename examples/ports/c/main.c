/* port KIT OUT [--chained] [CASE ...]: run every stage that the port knows, of all cases of a kit or of some. */
#define _POSIX_C_SOURCE 200809L
#include "case.h"
#include "json.h"
#include "stages.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define ROW(kind, run) {kind, run##_stage},
static const struct { const char *kind; void (*run)(Case *); } TABLE[] = {STAGES(ROW)};

/* Forms of stages that the port does not have, by the same names: they are of the full kit. */
static int is_other_form(Case *c) {
    const char *texel = fact(c, "depth_of_a_texel"), *bytes = fact(c, "in_bytes");
    return has(c, "scene.colours") || has(c, "frames_behind") || has(c, "depth_slopes.high")
           || has(c, "curvatures.high") || json_is(texel, "mean, at its centre") || (bytes && *bytes == 't')
           || json_is(fact(c, "mode"), "demo") || (!strcmp(c->kind, "sssil.crown_samples") && !has(c, "points_and_shifts.shifts"));
}

/* Run the stage; 0 where the port has none of this name. */
static int run(Case *c) {
    for (size_t k = 0; k < sizeof TABLE / sizeof *TABLE && !is_other_form(c); k++)
        if (!strcmp(c->kind, TABLE[k].kind)) return TABLE[k].run(c), 1;
    return 0;
}

static void run_case(const char *kit, const char *out, const char *id, int chained) {
    Case c;
    char folder[1024];
    snprintf(folder, sizeof folder, "%s/%s", out, id);
    mkdir(folder, 0777);
    case_open(&c, kit, out, id, chained);
    for (const char *p = json_first(json_at(c.manifest, "stages")); p; p = json_next(p)) {
        case_stage(&c, p);
        if (run(&c)) printf("%s %s\n", id, c.stage);
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
