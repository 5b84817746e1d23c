/* Which cells are refined: ranges of depth and normal in cells of 2^level pixels (AMS Sec. 3.2, 3.3). */
#include "json.h"
#include "stages.h"
#include <stdlib.h>

/* Least and largest of one plane of values in every cell, with a rim of pixels around it. */
static void ranges_of(const float *value, const int *id, int h, int w, int level, int rim, const Array *shape,
                      float *least, float *largest) {
    int rows = shape->shape[shape->ndim - 2], columns = shape->shape[shape->ndim - 1], size = 1 << level;
    for (int k = 0; k < rows * columns; k++) {
        int y0 = k / columns * size - rim, x0 = k % columns * size - rim;
        least[k] = INFINITY;
        largest[k] = -INFINITY;
        for (int y = y0 < 0 ? 0 : y0; y < y0 + size + 2 * rim && y < h; y++)
            for (int x = x0 < 0 ? 0 : x0; x < x0 + size + 2 * rim && x < w; x++) {
                if (id[y * w + x] < 0) continue;
                least[k] = fminf(least[k], value[y * w + x]);
                largest[k] = fmaxf(largest[k], value[y * w + x]);
            }
    }
}

static void ranges(Case *c, const Array *value) {
    const Array *id = get(c, "_triangles");
    int rim = (int)number(c, "rim"), h = id->shape[0], w = id->shape[1];
    for (int level = 1; level <= (int)number(c, "top"); level++) {
        Array *least = make_at(c, ".low", level - 1), *largest = make_at(c, ".high", level - 1);
        int channels = least->ndim == 3 ? least->shape[0] : 1, cells = least->size / channels;
        for (int k = 0; k < channels; k++)
            ranges_of(value->f + k * id->size, id->i, h, w, level, rim, least, least->f + k * cells, largest->f + k * cells);
    }
}

void depth_ranges_stage(Case *c) { ranges(c, get(c, ".depth")); }
void normal_ranges_stage(Case *c) { ranges(c, get(c, ".normal")); }

static int depth_differs(Case *c, int level, int k) {
    if (!has(c, "depth_ranges.low")) return 0;
    float least = get_at(c, "depth_ranges.low", level - 1)->f[k];
    float largest = get_at(c, "depth_ranges.high", level - 1)->f[k], threshold = number(c, "depth_threshold");
    return largest - least > (json_is(fact(c, "depth_measure"), "absolute") ? threshold : threshold * least);
}

static int normal_differs(Case *c, int level, int k) {
    if (!has(c, "normal_ranges.low")) return 0;
    const Array *least = get_at(c, "normal_ranges.low", level - 1);
    const Array *largest = get_at(c, "normal_ranges.high", level - 1);
    int components = least->shape[0], cells = least->size / components; /* xyz, or xy as in the authors' demo */
    for (int j = 0; j < components; j++)
        if (largest->f[j * cells + k] - least->f[j * cells + k] > number(c, "normal_threshold")) return 1;
    return 0;
}

void discontinuities_stage(Case *c) {
    for (int level = 1; level <= (int)number(c, "top"); level++) {
        Array *differs = make_at(c, "", level - 1);
        int refinable = level > (int)number(c, "finest");
        for (int k = 0; k < differs->size; k++)
            differs->i[k] = refinable && (depth_differs(c, level, k) || normal_differs(c, level, k));
    }
}

static int marked(const Array *marks, int row, int column) {
    int inside = row >= 0 && column >= 0 && row < marks->shape[0] && column < marks->shape[1];
    return inside && marks->i[row * marks->shape[1] + column];
}

/* Whether a neighbour asks for this cell's refinement (E-AMS-10). */
static int across(const Array *marks, const char *rule, int row, int column) {
    int full = json_is(rule, "full8"), corner = json_is(rule, "corner");
    if (json_is(rule, "off")) return 0;
    for (int y = -1; y <= 1; y++)
        for (int x = -1; x <= 1; x++) {
            if (!(x && y) && !(full && (x || y))) continue;
            if (!marked(marks, row + y, column + x)) continue;
            if (!corner || (!marked(marks, row + y, column) && !marked(marks, row, column + x))) return 1;
        }
    return 0;
}

static int any_surface(const Array *id, int level, int row, int column) {
    for (int y = row << level; y < (row + 1) << level && y < id->shape[0]; y++)
        for (int x = column << level; x < (column + 1) << level && x < id->shape[1]; x++)
            if (id->i[y * id->shape[1] + x] >= 0) return 1;
    return 0;
}

void states_stage(Case *c) {
    const Array *id = get(c, "_triangles");
    for (int level = 1; level <= has(c, "discontinuities"); level++) {
        const Array *marks = get_at(c, "discontinuities", level - 1);
        Array *state = make_at(c, "", level - 1);
        for (int row = 0; row < state->shape[0]; row++)
            for (int column = 0; column < state->shape[1]; column++) {
                int refined = marked(marks, row, column) || across(marks, fact(c, "diagonal"), row, column);
                state->i[row * state->shape[1] + column] = !any_surface(id, level, row, column) ? 0 : refined ? 2 : 1;
            }
    }
}

typedef struct {
    Case *c;
    const Array *id;
    int *entry[4]; /* level, row, column, pixel; NULL while counting */
    int count;
} List;

/* The pixel right and below of the centre, or the nearest that shows a surface, the first of several. */
static int representative(const Array *id, int level, int row, int column) {
    int h = id->shape[0], w = id->shape[1], size = 1 << level, best = -1, least = 0;
    int cy = row * size + size / 2, cx = column * size + size / 2;
    for (int y = row * size; y < (row + 1) * size && y < h; y++)
        for (int x = column * size; x < (column + 1) * size && x < w; x++) {
            int apart = (y - cy) * (y - cy) + (x - cx) * (x - cx);
            if (id->i[y * w + x] < 0 || (best >= 0 && apart >= least)) continue;
            best = y * w + x;
            least = apart;
        }
    return best;
}

static void visit(List *list, int level, int row, int column) {
    int w = list->id->shape[1], rows = (list->id->shape[0] + (1 << level) - 1) >> level, columns = (w + (1 << level) - 1) >> level;
    if (row >= rows || column >= columns) return;
    int state = level ? get_at(list->c, "states", level - 1)->i[row * columns + column]
                      : list->id->i[row * w + column] >= 0;
    if (state == 0) return;
    if (state == 2) {
        for (int k = 0; k < 4; k++) visit(list, level - 1, 2 * row + k / 2, 2 * column + k % 2);
        return;
    }
    if (list->entry[0]) {
        int found[4] = {level, row, column, representative(list->id, level, row, column)};
        for (int k = 0; k < 4; k++) list->entry[k][list->count] = found[k];
    }
    list->count++;
}

void subsplats_stage(Case *c) {
    static const char *names[4] = {".level", ".row", ".column", ".pixel"};
    List list = {c, get(c, "_triangles"), {0}, 0};
    int top = has(c, "states"), rows = (list.id->shape[0] + (1 << top) - 1) >> top;
    int columns = (list.id->shape[1] + (1 << top) - 1) >> top;
    for (int pass = 0; pass < 2; pass++) {
        for (int k = 0; pass && k < 4; k++) list.entry[k] = make_of(c, 'i', 1, &list.count, names[k])->i;
        list.count = 0;
        for (int k = 0; k < rows * columns; k++) visit(&list, top, k / columns, k % columns);
    }
}
