/* One level of hierarchical screen-space light: samples of a disc or crown around each texel (HSS Sec. 3.2, Eq. 4). */
#include "json.h"
#include "stages.h"

static float turn(double x) {
    float y = (float)(x - floor(x));
    return y < 1.0f ? y : 0.0f;
}

/* Points of the sequence and the shift of texel n of a tile; the manifest asks for double precision here. */
void shifts_stage(Case *c) {
    const char *steps = fact(c, "steps");
    double step[2] = {json_number(json_first(steps), 0), json_number(json_next(json_first(steps)), 0)};
    const float *shift = get(c, ".start")->f;
    Array *points = make(c, ".points"), *shifts = make(c, ".shifts");
    double crown = number(c, "crown");
    int disc = (int)number(c, "inner");
    for (int k = 0; k < points->shape[0]; k++) {
        int j = k < disc ? k : k - disc; /* of the disc and of the crown, both counted from 0 */
        double v = 0.5 + j * step[1];
        v -= floor(v);
        points->f[3 * k] = turn(0.5 + j * step[0]);
        points->f[3 * k + 1] = (float)cos(2 * 3.14159265358979323846 * v);
        points->f[3 * k + 2] = (float)sin(2 * 3.14159265358979323846 * v);
    }
    for (int k = 0; k < shifts->size; k++) shifts->f[k] = turn(shift[k % 2] + k / 2 * crown * step[k % 2]);
}

void samples_stage(Case *c) {
    const Array *points = get(c, ".points"), *shifts = get(c, ".shifts");
    int n = points->shape[0], texels = shifts->size / 2, disc = (int)number(c, "inner"), crown = n - disc;
    int uniform = json_is(fact(c, "density"), "uniform"), *offset = make(c, ".offsets")->i;
    float r = number(c, "radius");
    Array *weight = make(c, ".weight");
    for (int k = 0; k < texels * n; k++) {
        const float *point = points->f + k % n * 3, *shift = shifts->f + k / n * 2;
        int inner = k % n < disc;
        float u = point[0] + shift[0], angle = 2.0f * PI * shift[1], x, y;
        u = u >= 1.0f ? u - 1.0f : u;
        float d = r * (uniform ? sqrtf(inner ? u : 1.0f + 3.0f * u) : inner ? u : 1.0f + u);
        x = d * (point[1] * cosf(angle) - point[2] * sinf(angle));
        y = d * (point[1] * sinf(angle) + point[2] * cosf(angle));
        offset[2 * k] = (int)floorf(x + 0.5f);
        offset[2 * k + 1] = (int)floorf(y + 0.5f);
        if (k >= weight->size) continue;
        float count = (float)(inner ? disc : crown);
        weight->f[k] = uniform ? (inner ? 1.0f : 3.0f) * PI * r * r / count : 2.0f * PI * r * d / count;
    }
}

/* HSS Eq. 4 with its pi: the form factor of a disc of the sample's surface (E-HSS-04). */
static float disc_factor(vec3 x, vec3 n, vec3 sender, vec3 facing, float area) {
    vec3 d = sub(sender, x);
    float square = dot(d, d), root = sqrtf(square);
    if (square == 0.0f) return 0.0f;
    float received = dot(n, d) / root, sent = -dot(facing, d) / root;
    if (received <= 0.0f || sent <= 0.0f) return 0.0f;
    float disc = sent * area / PI;
    return PI * received * disc / (square + disc);
}

void gather_stage(Case *c) {
    const Array *areas = get(c, ".area"), *offsets = get(c, ".offsets"), *weights = get(c, ".weight");
    const float *position = get(c, ".position")->f, *normal = get(c, ".normal")->f, *radiance = get(c, ".radiance")->f;
    float *out = make(c, "")->f;
    int h = areas->shape[0], w = areas->shape[1], n = offsets->shape[2], plane = h * w;
    for (int k = 0; k < plane; k++) {
        if (areas->f[k] <= 0.0f) continue;
        int row = k / w, column = k % w;
        int tile = row % offsets->shape[0] * offsets->shape[1] + column % offsets->shape[1];
        const int *offset = offsets->i + tile * n * 2;
        const float *weight = weights->f + (weights->size > n ? tile * n : 0);
        vec3 x = plane3(position, plane, k), facing = plane3(normal, plane, k), total = v3(0, 0, 0);
        for (int j = 0; j < n; j++) {
            int y = row + offset[2 * j + 1], z = column + offset[2 * j], at = y * w + z;
            if (y < 0 || z < 0 || y >= h || z >= w || at == k || areas->f[at] <= 0.0f) continue;
            float factor = disc_factor(x, facing, plane3(position, plane, at), plane3(normal, plane, at),
                                       areas->f[at] * weight[j]);
            total = add(total, scale(plane3(radiance, plane, at), factor));
        }
        put3(out, plane, k, total);
    }
}
