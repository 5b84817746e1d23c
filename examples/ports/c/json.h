/* Look-ups in JSON text, without a tree: a value is a pointer to its first character. */
#ifndef JSON_H
#define JSON_H

const char *json_skip(const char *value);                   /* what follows a value */
const char *json_at(const char *object, const char *key);   /* NULL where there is no such key, or no object */
const char *json_first(const char *list);                   /* first element; NULL where empty */
const char *json_next(const char *element);                 /* next element; NULL at the end */
double json_number(const char *value, double otherwise);    /* `otherwise` where value is NULL or no number */
int json_is(const char *value, const char *text);           /* 1 where value is this string */
void json_string(const char *value, char *out, int size);   /* copy a string without escapes */

#endif
