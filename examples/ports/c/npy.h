/* Arrays in .npy files: <f4, <i4 and |b1, C order. */
#ifndef NPY_H
#define NPY_H

typedef struct {
    int ndim, shape[4], size;
    float *f; /* of floats, else NULL */
    int *i;   /* of whole numbers and truth values, else NULL */
} Array;

/* Read a file; ends the program with a message where it cannot. */
Array *npy_read(const char *path);
Array *npy_new(char kind, int ndim, const int *shape); /* kind 'f' or 'i', filled with 0 */
void npy_write(const char *path, const Array *array);

#endif
