/* A case of a kit: the stage that runs, the arrays that it reads and writes, and what the port has written. */
#ifndef CASE_H
#define CASE_H
#include "npy.h"
#include "vec.h"

#define MOST 64 /* arrays that a stage reads or writes */

typedef struct {
    char name[96], kind[96]; /* `kind`: the name without numbers of lamps, levels and rounds */
    Array *array;
} Named;

typedef struct {
    const char *kit, *out;
    char id[80];
    const char *manifest; /* JSON text */
    const char *arrays, *facts; /* its objects of these names */
    const char *known;    /* what the manifest's facts say of the stage */
    char stage[96], kind[96];
    int chained;          /* stages read what the port has written */
    int reads, writes;
    Named read[MOST], write[MOST];
    struct Kept *kept;
} Case;

/* Arrays by the end of their names without numbers, the k-th of several: get_at(c, "levels.depth", 1). */
Array *get(Case *c, const char *end);
Array *get_at(Case *c, const char *end, int k);      /* of the kit or, chained, of the port; ends where there is none */
int has(Case *c, const char *end);                   /* how many arrays the stage reads whose names end so */
int writes(Case *c, const char *end);
Array *make(Case *c, const char *end);               /* zeros in the shape and type that the manifest expects */
Array *make_at(Case *c, const char *end, int k);
Array *make_of(Case *c, char kind, int ndim, const int *shape, const char *end);
const char *fact(Case *c, const char *name);         /* JSON value of what the manifest says of this stage, or NULL */
float number(Case *c, const char *name);             /* 0 where it says nothing */
void kind_of(const char *name, char *kind);
void case_open(Case *c, const char *kit, const char *out, const char *id, int chained);
void case_stage(Case *c, const char *entry); /* of the manifest: the stage that runs now */
void case_store(Case *c); /* write the arrays made since the last call */
void case_close(Case *c);
char *text_of(const char *path); /* a whole file; ends the program where it cannot be read */

#endif
