/* Integral of a spot's falloff over a rectangle of the image plane z = 1 that it looks at along the axis. */
#include "stages.h"

#define NODES 16
static const float NODE[NODES / 2] = {0.0950125098f, 0.2816035508f, 0.4580167777f, 0.6178762444f,
                                      0.7554044084f, 0.8656312024f, 0.9445750231f, 0.9894009350f};
static const float WEIGHT[NODES / 2] = {0.1894506105f, 0.1826034150f, 0.1691565194f, 0.1495959888f,
                                        0.1246289713f, 0.0951585117f, 0.0622535239f, 0.0271524594f};

typedef struct { float x, cos_outer, scale, radius[2]; int squared; } Cone;

/* Smoothstep or squared ramp between the cones (docs/conventions) times the density of solid angle. The difference of cosines that it
   needs is taken from tangents, cos a - cos o = (tan^2 o - tan^2 a) cos^2 a cos^2 o / (cos a + cos o): no digits go. */
static float density(const Cone *s, float y) {
    float tangent = s->x * s->x + y * y, square = 1.0f + tangent, root = sqrtf(square);
    float t = (s->radius[1] * s->radius[1] - tangent) / (square * (1.0f / root + s->cos_outer)) * s->scale;
    t = clampf(t, 0.0f, 1.0f);
    if (s->squared) return t * t / (square * root);
    return t * t * (3.0f - 2.0f * t) / (square * root);
}

static float gauss_y(const Cone *s, float y0, float y1) {
    float sum = 0.0f, middle = 0.5f * (y0 + y1), half = 0.5f * (y1 - y0);
    for (int k = 0; k < NODES / 2; k++)
        sum += WEIGHT[k] * (density(s, middle - half * NODE[k]) + density(s, middle + half * NODE[k]));
    return sum * half;
}

static int cut(float *at, int n, float value, float low, float high) {
    if (value > low && value < high) at[n++] = value;
    return n;
}

static void sort(float *at, int n) {
    for (int i = 1; i < n; i++)
        for (int j = i; j > 0 && at[j] < at[j - 1]; j--) {
            float other = at[j];
            at[j] = at[j - 1];
            at[j - 1] = other;
        }
}

static float column_integral(Cone *s, float x, float y0, float y1) {
    float at[8] = {y0, y1}, sum = 0.0f;
    int n = 2;
    s->x = x;
    for (int k = 0; k < 2; k++) {
        float square = s->radius[k] * s->radius[k] - x * x;
        if (square <= 0.0f) continue;
        n = cut(at, n, -sqrtf(square), y0, y1);
        n = cut(at, n, sqrtf(square), y0, y1);
    }
    sort(at, n);
    for (int k = 0; k + 1 < n; k++) sum += gauss_y(s, at[k], at[k + 1]);
    return sum;
}

/* Both directions are cut where the cones' circles cross, so that each piece is smooth. */
float spot_integral(float x0, float x1, float y0, float y1, float inner, float outer, int squared) {
    float width = 2.0f * sinf(0.5f * (outer - inner)) * sinf(0.5f * (outer + inner)), cosine = cosf(outer);
    Cone s = {0, cosine, cosine * cosine / width, {tanf(inner), tanf(outer)}, squared};
    float at[16] = {x0, x1}, total = 0.0f, edge[3] = {0.0f, y0, y1};
    int n = 2;
    for (int k = 0; k < 2; k++)
        for (int j = 0; j < 3; j++) {
            float square = s.radius[k] * s.radius[k] - edge[j] * edge[j];
            if (square <= 0.0f) continue;
            n = cut(at, n, -sqrtf(square), x0, x1);
            n = cut(at, n, sqrtf(square), x0, x1);
        }
    sort(at, n);
    for (int piece = 0; piece + 1 < n; piece++) {
        float sum = 0.0f, middle = 0.5f * (at[piece] + at[piece + 1]), half = 0.5f * (at[piece + 1] - at[piece]);
        for (int k = 0; k < NODES / 2; k++)
            sum += WEIGHT[k] * (column_integral(&s, middle - half * NODE[k], y0, y1)
                                + column_integral(&s, middle + half * NODE[k], y0, y1));
        total += sum * half;
    }
    return total;
}
