/* Arrays by name. Isolated, every stage reads the kit's; chained, the port's own where it has made them. */
#include "case.h"
#include "json.h"
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct Kept {
    char name[96];
    Array *array;
    int own, written;
    struct Kept *next;
};

#define NAMED(name, format)                          \
    char name[96];                                   \
    do {                                             \
        va_list list;                                \
        va_start(list, format);                      \
        vsnprintf(name, sizeof name, format, list);  \
        va_end(list);                                \
    } while (0)

static struct Kept *find(Case *c, const char *name, int own) {
    for (struct Kept *k = c->kept; k; k = k->next)
        if (k->own == own && !strcmp(k->name, name)) return k;
    return NULL;
}

static Array *keep(Case *c, const char *name, int own, Array *array) {
    struct Kept *k = calloc(1, sizeof *k);
    strcpy(k->name, name);
    k->array = array;
    k->own = own;
    k->next = c->kept;
    c->kept = k;
    return array;
}

static const char *entry(Case *c, const char *name) { return json_at(c->arrays, name); }

int has(Case *c, const char *format, ...) {
    NAMED(name, format);
    return entry(c, name) != NULL;
}

Array *get(Case *c, const char *format, ...) {
    NAMED(name, format);
    struct Kept *own = c->chained ? find(c, name, 1) : NULL, *kit = find(c, name, 0);
    if (own || kit) return own ? own->array : kit->array;
    char file[160], path[1024];
    if (!entry(c, name)) {
        fprintf(stderr, "%s: no array %s\n", c->id, name);
        exit(2);
    }
    json_string(json_at(entry(c, name), "file"), file, sizeof file);
    snprintf(path, sizeof path, "%s/cases/%s/%s", c->kit, c->id, file);
    return keep(c, name, 0, npy_read(path));
}

Array *made(Case *c, const char *format, ...) {
    NAMED(name, format);
    return find(c, name, 1)->array;
}

Array *make_of(Case *c, char kind, int ndim, const int *shape, const char *format, ...) {
    NAMED(name, format);
    return keep(c, name, 1, npy_new(kind, ndim, shape));
}

Array *make(Case *c, const char *format, ...) {
    NAMED(name, format);
    int shape[4], ndim = 0;
    for (const char *p = json_first(json_at(entry(c, name), "shape")); p; p = json_next(p))
        shape[ndim++] = (int)json_number(p, 0);
    return keep(c, name, 1, npy_new(json_is(json_at(entry(c, name), "dtype"), "<f4") ? 'f' : 'i', ndim, shape));
}

const char *fact(Case *c, const char *format, ...) {
    NAMED(name, format);
    return json_at(c->facts, name);
}

char *text_of(const char *path) {
    FILE *file = fopen(path, "rb");
    if (!file) {
        fprintf(stderr, "%s: cannot be read\n", path);
        exit(2);
    }
    fseek(file, 0, SEEK_END);
    long size = ftell(file);
    rewind(file);
    char *text = calloc(1, (size_t)size + 1);
    if (fread(text, 1, (size_t)size, file) != (size_t)size) exit(2);
    fclose(file);
    return text;
}

void case_open(Case *c, const char *kit, const char *out, const char *id, int chained) {
    char path[1024];
    memset(c, 0, sizeof *c);
    c->kit = kit;
    c->out = out;
    c->chained = chained;
    snprintf(c->id, sizeof c->id, "%s", id);
    snprintf(path, sizeof path, "%s/cases/%s/manifest.json", kit, id);
    c->manifest = text_of(path);
    c->arrays = json_at(c->manifest, "arrays");
    c->facts = json_at(c->manifest, "facts");
}

void case_store(Case *c) {
    char path[1024];
    for (struct Kept *k = c->kept; k; k = k->next)
        if (k->own && !k->written) {
            snprintf(path, sizeof path, "%s/%s/%s.npy", c->out, c->id, k->name);
            npy_write(path, k->array);
            k->written = 1;
        }
}

void case_close(Case *c) {
    while (c->kept) {
        struct Kept *next = c->kept->next;
        free(c->kept->array->f);
        free(c->kept->array->i);
        free(c->kept->array);
        free(c->kept);
        c->kept = next;
    }
    free((char *)c->manifest);
}
