// sin and cos of pi n t for whole n < 4096, to about two units of 2^-24. GLSL says nothing of how exact sin and cos are,
// and pi n t rounded is off by up to n t / 2 units. BUILT_IN takes them all the same.

vec2 sin_cos_pi(int n, float t) {
#ifdef BUILT_IN
    float angle = float(n) * 3.14159265358979 * t;
    return vec2(sin(angle), cos(angle));
#else
    float high = uintBitsToFloat(floatBitsToUint(t) & 0xfffff000u), low = t - high;  // n high is exact
    float quarter = roundEven(2.0 * float(n) * t);
    float f = ((float(n) * high - 0.5 * quarter) + float(n) * low) * 3.14159265358979, ff = f * f;  // |f| <= pi / 4
    float s = f * (1.0 + ff * (-1.0 / 6.0 + ff * (1.0 / 120.0 + ff * (-1.0 / 5040.0 + ff / 362880.0))));
    float c = 1.0 + ff * (-0.5 + ff * (1.0 / 24.0 + ff * (-1.0 / 720.0 + ff * (1.0 / 40320.0 - ff / 3628800.0))));
    int turn = int(quarter) & 3;
    vec2 turned = (turn & 1) == 0 ? vec2(s, c) : vec2(c, -s);
    return (turn & 2) == 0 ? turned : -turned;
#endif
}
