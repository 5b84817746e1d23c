/* A case of a kit: its manifest, its arrays by name, and what the port has written. */
#ifndef CASE_H
#define CASE_H
#include "npy.h"
#include "vec.h"

typedef struct {
    const char *kit, *out;
    char id[80];
    const char *manifest; /* JSON text */
    const char *arrays, *facts; /* its objects of these names */
    const char *stage;    /* the manifest's entry of the stage that runs */
    int chained;          /* stages read what the port has written */
    struct Kept *kept;
} Case;

/* Names are printf formats: get(c, "%s.depth", map). */
Array *get(Case *c, const char *name, ...);          /* of the kit or, chained, of the port; ends where there is none */
Array *made(Case *c, const char *name, ...);         /* what the port has made in this stage */
int has(Case *c, const char *name, ...);
Array *make(Case *c, const char *name, ...);         /* zeros in the shape and type that the manifest expects */
Array *make_of(Case *c, char kind, int ndim, const int *shape, const char *name, ...);
const char *fact(Case *c, const char *name, ...);    /* JSON value among the manifest's facts, or NULL */
void case_open(Case *c, const char *kit, const char *out, const char *id, int chained);
void case_store(Case *c); /* write the arrays made since the last call */
void case_close(Case *c);
char *text_of(const char *path); /* a whole file; ends the program where it cannot be read */

#endif
