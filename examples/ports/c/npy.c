/* Reader and writer of .npy: a magic, a length, a header that is a Python dict, then the elements. */
#include "npy.h"
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void fail(const char *path, const char *why) {
    fprintf(stderr, "%s: %s\n", path, why);
    exit(2);
}

Array *npy_new(char kind, int ndim, const int *shape) {
    Array *a = calloc(1, sizeof *a);
    a->ndim = ndim;
    a->size = 1;
    for (int k = 0; k < ndim; k++) {
        a->shape[k] = shape[k];
        a->size *= shape[k];
    }
    if (kind == 'f') a->f = calloc((size_t)a->size + 1, sizeof *a->f);
    else a->i = calloc((size_t)a->size + 1, sizeof *a->i);
    return a;
}

static int read_shape(const char *header, int *shape) {
    const char *p = strchr(strstr(header, "'shape'"), '(') + 1;
    int n = 0;
    while (*p != ')' && n < 4) {
        char *end;
        long value = strtol(p, &end, 10);
        if (end == p) break;
        shape[n++] = (int)value;
        for (p = end; *p == ',' || *p == ' '; p++) {}
    }
    return n;
}

Array *npy_read(const char *path) {
    unsigned char head[12];
    FILE *file = fopen(path, "rb");
    if (!file || fread(head, 1, 10, file) != 10 || memcmp(head, "\x93NUMPY", 6)) fail(path, "no .npy file");
    size_t length = (size_t)head[8] | (size_t)head[9] << 8;
    if (head[6] > 1) {
        if (fread(head + 10, 1, 2, file) != 2) fail(path, "cut short");
        length |= (size_t)head[10] << 16 | (size_t)head[11] << 24;
    }
    char *header = calloc(1, length + 1);
    if (fread(header, 1, length, file) != length) fail(path, "cut short");
    int floats = strstr(header, "<f4") != NULL, truth = strstr(header, "|b1") != NULL;
    if (!floats && !truth && !strstr(header, "<i4")) fail(path, "expected <f4, <i4 or |b1");
    int shape[4] = {0}, ndim = read_shape(header, shape);
    Array *a = npy_new(floats ? 'f' : 'i', ndim, shape);
    size_t got = 0;
    if (truth) {
        uint8_t one;
        for (; got < (size_t)a->size && fread(&one, 1, 1, file) == 1; got++) a->i[got] = one;
    } else got = fread(floats ? (void *)a->f : (void *)a->i, 4, (size_t)a->size, file);
    if (got != (size_t)a->size) fail(path, "cut short");
    free(header);
    fclose(file);
    return a;
}

void npy_write(const char *path, const Array *a) {
    char header[128], shape[64] = "";
    for (int k = 0; k < a->ndim; k++) sprintf(shape + strlen(shape), k + 1 < a->ndim ? "%d, " : "%d,", a->shape[k]);
    int n = sprintf(header, "{'descr': '%s', 'fortran_order': False, 'shape': (%s), }", a->f ? "<f4" : "<i4", shape);
    while ((10 + n + 1) % 64) header[n++] = ' ';
    header[n++] = '\n';
    FILE *file = fopen(path, "wb");
    if (!file) fail(path, "cannot be written");
    fwrite("\x93NUMPY\x01\x00", 1, 8, file);
    fputc(n & 255, file);
    fputc(n >> 8, file);
    fwrite(header, 1, (size_t)n, file);
    fwrite(a->f ? (void *)a->f : (void *)a->i, 4, (size_t)a->size, file);
    fclose(file);
}
