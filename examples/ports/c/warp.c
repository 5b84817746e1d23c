/* Points follow the importance of texels (SII Sec. 3.5, Eq. 4 to 6; methods A and B). */
#include "json.h"
#include "stages.h"

#define BELOW_1 0.99999994f

typedef struct {
    const float *importance;
    int rows, columns, depth;
} Map;

/* Cell `index` of a level begins at texel floor(index size / 2^level) of a side, and may be empty. */
static int border(int size, int level, int index) { return index * size >> level; }

/* What a mipmap of sums holds: the importance of cell (i, j) of a level. */
static float cell_sum(const Map *m, int level, int i, int j) {
    if (level < m->depth)
        return (cell_sum(m, level + 1, 2 * i, 2 * j) + cell_sum(m, level + 1, 2 * i, 2 * j + 1))
               + (cell_sum(m, level + 1, 2 * i + 1, 2 * j) + cell_sum(m, level + 1, 2 * i + 1, 2 * j + 1));
    int row = border(m->rows, level, i), column = border(m->columns, level, j);
    int empty = row == border(m->rows, level, i + 1) || column == border(m->columns, level, j + 1);
    return empty ? 0.0f : m->importance[row * m->columns + column];
}

static int depth_of(int size) {
    int levels = 0;
    while (1 << levels < size) levels++;
    return levels;
}

/* Share of the texels of cell `index` that its first half has: the 1/2 of Eq. 5 and 6 where it can be halved. */
static float even_share(int size, int level, int index) {
    int start = border(size, level, index), end = border(size, level, index + 1);
    return (float)(border(size, level + 1, 2 * index + 1) - start) / (float)(end - start);
}

/* Eq. 4 to 6 for one coordinate; returns the half that it goes to. */
static int halve(float *x, float *weight, float even, float first, float second) {
    float sum = first + second, share = sum > 0.0f ? first / sum : even;
    int half = *x >= share;
    float kept = sum > 0.0f ? (half ? second : first) / sum : half ? 1.0f - even : even;
    *weight *= (half ? 1.0f - even : even) / kept;
    *x = fminf((half ? *x - share : *x) / kept, BELOW_1);
    return half;
}

static void warp_in_map(const Map *m, int method, int levels, float *u, float *v, float *weight) {
    int i = 0, j = 0;
    if (levels > m->depth) levels = m->depth;
    for (int level = 0; level < levels; level++) {
        float cell[2][2];
        for (int k = 0; k < 4; k++) cell[k / 2][k % 2] = cell_sum(m, level + 1, 2 * i + k / 2, 2 * j + k % 2);
        int down = halve(v, weight, even_share(m->rows, level, i), cell[0][0] + cell[0][1], cell[1][0] + cell[1][1]);
        float left = method == 'A' ? cell[down][0] : cell[0][0] + cell[1][0];
        float right = method == 'A' ? cell[down][1] : cell[0][1] + cell[1][1];
        j = 2 * j + halve(u, weight, even_share(m->columns, level, j), left, right);
        i = 2 * i + down;
    }
    int row = border(m->rows, levels, i), column = border(m->columns, levels, j);
    *u = ((float)column + *u * (float)(border(m->columns, levels, j + 1) - column)) / (float)m->columns;
    *v = ((float)row + *v * (float)(border(m->rows, levels, i + 1) - row)) / (float)m->rows;
}

/* One of the stacked maps, in proportion to their importance; v becomes the place within it. */
static int choose_map(const Map *maps, int count, float *v, float *weight) {
    float sum[6], total = 0.0f, below = 0.0f;
    for (int k = 0; k < count; k++) total += sum[k] = cell_sum(maps + k, 0, 0, 0);
    for (int k = 0; k < count; k++) {
        float share = total > 0.0f ? sum[k] / total : 1.0f / (float)count;
        if (share > 0.0f && (*v < below + share || k == count - 1)) {
            *weight *= 1.0f / ((float)count * share);
            *v = clampf((*v - below) / share, 0.0f, BELOW_1);
            return k;
        }
        below += share;
    }
    return count - 1;
}

void warp_stage(Case *c) {
    Map maps[6];
    const Array *importance = get(c, ".importance");
    int method = json_is(fact(c, "method"), "A") ? 'A' : 'B', levels = (int)number(c, "levels");
    int count = (int)number(c, "maps"), rows = importance->shape[0] / count, columns = importance->shape[1];
    const float *points = get(c, "points")->f;
    for (int k = 0; k < count; k++) {
        Map one = {importance->f + k * rows * columns, rows, columns, depth_of(rows > columns ? rows : columns)};
        maps[k] = one;
    }
    float *warped = make(c, ".warped")->f;
    Array *weight = make(c, ".density_weight");
    for (int k = 0; k < weight->size; k++) {
        float u = points[2 * k], v = points[2 * k + 1], w = 1.0f;
        int map = count > 1 ? choose_map(maps, count, &v, &w) : 0;
        warp_in_map(maps + map, method, levels, &u, &v, &w);
        warped[2 * k] = fminf(u, BELOW_1);
        warped[2 * k + 1] = fminf(((float)map + v) / (float)count, BELOW_1);
        weight->f[k] = w;
    }
}
