/* Arrays by name. Isolated, every stage reads the kit's; chained, the port's own where it has made them. */
#include "case.h"
#include "json.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct Kept {
    char name[96];
    Array *array;
    int own, written;
    struct Kept *next;
};

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

static Array *loaded(Case *c, const char *name) {
    struct Kept *own = c->chained ? find(c, name, 1) : NULL, *kit = find(c, name, 0);
    if (own || kit) return own ? own->array : kit->array;
    char file[160], path[1024];
    json_string(json_at(json_at(c->arrays, name), "file"), file, sizeof file);
    snprintf(path, sizeof path, "%s/cases/%s/%s", c->kit, c->id, file);
    return keep(c, name, 0, npy_read(path));
}

static int ends(const char *name, const char *end) {
    size_t n = strlen(name), m = strlen(end);
    return n >= m && !strcmp(name + n - m, end);
}

static int count(const Named *list, int n, const char *end) {
    int found = 0;
    for (int j = 0; j < n; j++) found += ends(list[j].kind, end);
    return found;
}

static Named *at(Case *c, Named *list, int n, const char *end, int k) {
    for (int j = 0; j < n; j++)
        if (ends(list[j].kind, end) && k-- == 0) return list + j;
    fprintf(stderr, "%s: %s has no array ...%s\n", c->id, c->stage, end);
    exit(2);
}

int has(Case *c, const char *end) { return count(c->read, c->reads, end); }
int writes(Case *c, const char *end) { return count(c->write, c->writes, end); }

Array *get_at(Case *c, const char *end, int k) {
    Named *one = at(c, c->read, c->reads, end, k);
    return one->array ? one->array : (one->array = loaded(c, one->name));
}

Array *get(Case *c, const char *end) { return get_at(c, end, 0); }

Array *make_of(Case *c, char kind, int ndim, const int *shape, const char *end) {
    return keep(c, at(c, c->write, c->writes, end, 0)->name, 1, npy_new(kind, ndim, shape));
}

Array *make_at(Case *c, const char *end, int k) {
    const char *name = at(c, c->write, c->writes, end, k)->name, *entry = json_at(c->arrays, name);
    int shape[4], ndim = 0;
    for (const char *p = json_first(json_at(entry, "shape")); p; p = json_next(p))
        shape[ndim++] = (int)json_number(p, 0);
    return keep(c, name, 1, npy_new(json_is(json_at(entry, "dtype"), "<f4") ? 'f' : 'i', ndim, shape));
}

Array *make(Case *c, const char *end) { return make_at(c, end, 0); }

const char *fact(Case *c, const char *name) { return json_at(c->known, name); }
float number(Case *c, const char *name) { return (float)json_number(fact(c, name), 0); }

/* cluster.kmeans_assign0.of is one of cluster.kmeans_assign.of, multires.states.2 one of multires.states. */
void kind_of(const char *name, char *kind) {
    for (; *name; name++) {
        int dot = *name == '.' && name[1] >= '0' && name[1] <= '9';
        if (!dot && (*name < '0' || *name > '9')) *kind++ = *name;
    }
    *kind = 0;
}

static int names_of(const char *list, Named *into) {
    int n = 0;
    for (const char *p = json_first(list); p && n < MOST; p = json_next(p), n++) {
        json_string(p, into[n].name, sizeof into[n].name);
        kind_of(into[n].name, into[n].kind);
        into[n].array = NULL;
    }
    return n;
}

void case_stage(Case *c, const char *entry) {
    json_string(json_at(entry, "name"), c->stage, sizeof c->stage);
    kind_of(c->stage, c->kind);
    c->known = json_at(c->facts, c->stage);
    c->reads = names_of(json_at(entry, "reads"), c->read);
    c->writes = names_of(json_at(entry, "writes"), c->write);
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
