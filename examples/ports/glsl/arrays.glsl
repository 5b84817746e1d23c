// Arrays as storage buffers: planes of one component each, as the kit's .npy files hold them.
// STORED arrays are half floats, two to a word, where HALF is defined; places stay float32 unless HALF_PLACES is.
// WRITTEN arrays hold what ROUNDED makes, a half float alone in its word: unpacked again at once it would be no rounding,
// as a driver may take both steps for none.

#ifdef HALF
#define STORED uint
#define AT(array, i) (((i) & 1u) == 0u ? unpackHalf2x16(array[(i) >> 1]).x : unpackHalf2x16(array[(i) >> 1]).y)
#define WRITTEN uint
#define ROUNDED(v) packHalf2x16(vec2(v, 0.0))
#else
#define STORED float
#define AT(array, i) array[i]
#define WRITTEN float
#define ROUNDED(v) (v)
#endif

#ifdef HALF_PLACES
#define PLACE uint
#define PLACE_AT(array, i) AT(array, i)
#else
#define PLACE float
#define PLACE_AT(array, i) array[i]
#endif

#define VECTOR(array, i, count) vec3(AT(array, i), AT(array, (i) + (count)), AT(array, (i) + 2u * (count)))
#define PLACE_VECTOR(array, i, count) \
    vec3(PLACE_AT(array, i), PLACE_AT(array, (i) + (count)), PLACE_AT(array, (i) + 2u * (count)))
