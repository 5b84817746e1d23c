// a.b; where FUSED is defined with fused operations, rounded once each. fma() would be rounded once or twice, as an
// implementation likes.

#ifdef FUSED
float fused(float a, float b, float c) {
    return float(double(a) * double(b) + double(c));
}
#endif

float scalar_product(vec3 a, vec3 b) {
#ifdef FUSED
    return fused(a.x, b.x, fused(a.y, b.y, a.z * b.z));
#else
    return dot(a, b);
#endif
}
