/* Vectors of three floats, as a shader has them. */
#ifndef VEC_H
#define VEC_H
#include <math.h>

#define PI 3.14159265358979f

typedef struct { float x, y, z; } vec3;

static inline vec3 v3(float x, float y, float z) { vec3 r = {x, y, z}; return r; }
static inline vec3 add(vec3 a, vec3 b) { return v3(a.x + b.x, a.y + b.y, a.z + b.z); }
static inline vec3 sub(vec3 a, vec3 b) { return v3(a.x - b.x, a.y - b.y, a.z - b.z); }
static inline vec3 scale(vec3 a, float s) { return v3(a.x * s, a.y * s, a.z * s); }
static inline float dot(vec3 a, vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline float length(vec3 a) { return sqrtf(dot(a, a)); }
static inline vec3 normalize(vec3 a) { return scale(a, 1.0f / length(a)); }
static inline vec3 cross(vec3 a, vec3 b) {
    return v3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
static inline vec3 row3(const float *p) { return v3(p[0], p[1], p[2]); }
/* Element k of channels that are planes of `plane` elements each. */
static inline vec3 plane3(const float *p, int plane, int k) { return v3(p[k], p[plane + k], p[2 * plane + k]); }
static inline void put3(float *p, int plane, int k, vec3 a) { p[k] = a.x; p[plane + k] = a.y; p[2 * plane + k] = a.z; }
static inline float clampf(float x, float low, float high) { return x < low ? low : x > high ? high : x; }

#endif
