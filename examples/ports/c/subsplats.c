/* Light of subsplats, and its way from cells to pixels (AMS Sec. 3.4, 3.5). */
#include "json.h"
#include "stages.h"
#include <stdlib.h>

#define LIGHT 4 /* among what a stage reads: after ids, level, row and column of subsplats */

/* Mean of a cell's surface, or its representative pixel. */
void subsplat_points_stage(Case *c) {
    const Array *id = get(c, "_triangles"), *level = get(c, ".level");
    const float *position = get(c, ".position")->f, *normal = get(c, ".normal")->f;
    const int *row = get(c, ".row")->i, *column = get(c, ".column")->i, *pixel = get(c, ".pixel")->i;
    int mean = json_is(fact(c, "representative"), "mean"), shape[2] = {3, level->size};
    float *point = make_of(c, 'f', 2, shape, ".point")->f, *facing = make_of(c, 'f', 2, shape, ".normal")->f;
    for (int k = 0; k < level->size; k++) {
        vec3 p = plane3(position, id->size, pixel[k]), n = plane3(normal, id->size, pixel[k]);
        int size = 1 << level->i[k], count = 0, w = id->shape[1];
        vec3 sum_p = v3(0, 0, 0), sum_n = v3(0, 0, 0);
        for (int y = row[k] * size; mean && y < (row[k] + 1) * size && y < id->shape[0]; y++)
            for (int x = column[k] * size; x < (column[k] + 1) * size && x < w; x++) {
                if (id->i[y * w + x] < 0) continue;
                sum_p = add(sum_p, plane3(position, id->size, y * w + x));
                sum_n = add(sum_n, plane3(normal, id->size, y * w + x));
                count++;
            }
        if (count) p = scale(sum_p, 1.0f / (float)count), n = normalize(sum_n);
        put3(point, level->size, k, p);
        put3(facing, level->size, k, n);
    }
}

/* Irradiance that cells of one level hold: evaluated here, doubled from the coarser level, or none. */
typedef struct {
    int rows, columns;
    float *light, *out; /* before and after the filter */
    int *known, *own;
} Level;

static Level level_of(Case *c) {
    Array *out = make(c, ".light"), *known = make(c, ".known");
    Level made = {known->shape[0], known->shape[1], calloc((size_t)out->size, sizeof(float)), out->f, known->i,
                  calloc((size_t)known->size, sizeof(int))};
    return made;
}

static int surface_in(const Array *id, int level, int row, int column) {
    for (int y = row << level; y < (row + 1) << level && y < id->shape[0]; y++)
        for (int x = column << level; x < (column + 1) << level && x < id->shape[1]; x++)
            if (id->i[y * id->shape[1] + x] >= 0) return 1;
    return 0;
}

static void fill(Case *c, Level *l, int level, int top) {
    const Array *levels = get(c, ".level"), *light = get_at(c, "", LIGHT), *id = get(c, "_triangles");
    int cells = l->rows * l->columns, lists = levels->size;
    for (int k = 0; k < cells && !top; k++) {
        int row = k / l->columns, column = k % l->columns;
        const Array *known = get(c, ".known"), *coarse = get(c, ".light");
        int from = row / 2 * known->shape[1] + column / 2;
        if (!known->i[from] || !surface_in(id, level, row, column)) continue;
        l->known[k] = 1;
        put3(l->light, cells, k, plane3(coarse->f, known->size, from));
    }
    for (int k = 0; k < lists; k++) {
        if (levels->i[k] != level) continue;
        int to = get(c, ".row")->i[k] * l->columns + get(c, ".column")->i[k];
        l->known[to] = l->own[to] = 1;
        put3(l->light, cells, to, plane3(light->f, lists, k));
    }
}

static int within(int k, int count) { return k < 0 ? 0 : k >= count ? count - 1 : k; }

/* Beyond the picture its rim goes on. */
static int cell_at(const Level *l, int row, int column) {
    return within(row, l->rows) * l->columns + within(column, l->columns);
}

/* Masked mean of weights (1, 2, 1) x (1, 2, 1); across a corner only beside another. */
static vec3 tent(const Level *l, int row, int column, int corner_rule) {
    vec3 sum = v3(0, 0, 0);
    float weights = 0.0f;
    for (int y = -1; y <= 1; y++)
        for (int x = -1; x <= 1; x++) {
            int at = cell_at(l, row + y, column + x);
            int beside = l->known[cell_at(l, row + y, column)] || l->known[cell_at(l, row, column + x)];
            if (!l->known[at] || (corner_rule && x && y && !beside)) continue;
            float weight = (y ? 1.0f : 2.0f) * (x ? 1.0f : 2.0f);
            sum = add(sum, scale(plane3(l->light, l->rows * l->columns, at), weight));
            weights += weight;
        }
    return scale(sum, 1.0f / weights);
}

void upsample_level_stage(Case *c) {
    int top = !has(c, ".light"), all = *fact(c, "filter_all") == 't', corners = *fact(c, "corner_rule") == 't';
    Level l = level_of(c);
    fill(c, &l, (int)number(c, "at"), top);
    for (int k = 0; k < l.rows * l.columns; k++) {
        vec3 here = plane3(l.light, l.rows * l.columns, k);
        int kept = top || (l.own[k] && !all);
        if (l.known[k]) put3(l.out, l.rows * l.columns, k, kept ? here : tent(&l, k / l.columns, k % l.columns, corners));
    }
    free(l.light);
    free(l.own);
}

/* Without a filter each pixel has the light of its subsplat. */
void upsample_nearest_stage(Case *c) {
    const Array *level = get(c, ".level"), *light = get_at(c, "", LIGHT), *id = get(c, "_triangles");
    float *out = make(c, "")->f;
    for (int k = 0; k < level->size; k++) {
        int size = 1 << level->i[k], row = get(c, ".row")->i[k] * size, column = get(c, ".column")->i[k] * size;
        for (int y = row; y < row + size && y < id->shape[0]; y++)
            for (int x = column; x < column + size && x < id->shape[1]; x++)
                if (id->i[y * id->shape[1] + x] >= 0)
                    put3(out, id->size, y * id->shape[1] + x, plane3(light->f, level->size, k));
    }
}

/* Eq. 3: E (a <V, N> + 1 - a). */
void detail_stage(Case *c) {
    const Array *id = get(c, "_triangles");
    const float *light = get(c, "")->f, *position = get(c, ".position")->f;
    const float *normal = get(c, ".normal")->f, a = number(c, "a");
    float *out = make(c, "")->f;
    vec3 eye = row3(get(c, ".origin")->f);
    for (int k = 0; k < id->size; k++) {
        if (id->i[k] < 0) continue;
        float facing = fmaxf(0.0f, dot(normalize(sub(eye, plane3(position, id->size, k))), plane3(normal, id->size, k)));
        put3(out, id->size, k, scale(plane3(light, id->size, k), a * facing + 1.0f - a));
    }
}
