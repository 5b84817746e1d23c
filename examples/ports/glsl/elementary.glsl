// exp2 and log2 to about two units in the last place of float32. GLSL 4.5 (section 4.7.1) asks less of the built-in
// ones than float32 holds: 3 + 2|x| units for exp2(x), 3 units outside of [0.5, 2] for log2(x) and 2^-21 absolute inside,
// and of pow(x, y) what exp2(y * log2(x)) gives. With y = 1000 that is too little for bounds of tier T1.

float exp2_accurate(float x) {
    if (x < -149.5) return 0.0;
    float whole = roundEven(x), f = x - whole;  // f in [-1/2, 1/2], exact
    float g = f * 0.693147180559945;            // 2^f = e^g, Taylor to g^7
    float p = 1.0 / 5040.0;
    p = p * g + 1.0 / 720.0;
    p = p * g + 1.0 / 120.0;
    p = p * g + 1.0 / 24.0;
    p = p * g + 1.0 / 6.0;
    p = p * g + 0.5;
    p = p * g + 1.0;
    p = p * g + 1.0;
    int n = int(whole), half_n = n / 2;  // in two steps, so that subnormal results need no subnormal factor
    return p * uintBitsToFloat(uint(half_n + 127) << 23) * uintBitsToFloat(uint(n - half_n + 127) << 23);
}

// log2(1 - h) for 0 <= h < 1, which keeps the digits of a small h
float log2_of_1_minus(float h) {
    float u = 1.0 - h;
    int n = int(floatBitsToUint(u) >> 23) - 127;  // u = m 2^n
    float m = uintBitsToFloat(floatBitsToUint(u) - uint(n << 23));
    if (m > 1.41421356) {
        m *= 0.5;
        n += 1;
    }
    float f = n == 0 ? -h : m - 1.0;
    float z = f / (2.0 + f), zz = z * z;  // log(1 + f) = 2 atanh(z), |z| < 0.172
    float p = 1.0 / 11.0;
    p = p * zz + 1.0 / 9.0;
    p = p * zz + 1.0 / 7.0;
    p = p * zz + 0.2;
    p = p * zz + 1.0 / 3.0;
    return float(n) + 2.88539008177793 * (z + z * zz * p);  // 2 / ln 2
}
