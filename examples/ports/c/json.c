/* Look-ups in JSON text that is known to be well formed. */
#include "json.h"
#include <stdlib.h>
#include <string.h>

static const char *blank(const char *p) {
    while (*p == ' ' || *p == '\n' || *p == '\r' || *p == '\t') p++;
    return p;
}

static const char *skip_string(const char *p) {
    for (p++; *p && *p != '"'; p++)
        if (*p == '\\') p++;
    return p + 1;
}

const char *json_skip(const char *p) {
    int depth = 0;
    do {
        p = blank(p);
        if (*p == '"') p = skip_string(p);
        else if (*p == '{' || *p == '[') depth++, p++;
        else if (*p == '}' || *p == ']') depth--, p++;
        else if (*p == ',' || *p == ':') p++;
        else p += strcspn(p, ",:]} \n\r\t");
    } while (depth > 0 && *p);
    return p;
}

int json_is(const char *value, const char *text) {
    size_t n = strlen(text);
    return value && *value == '"' && !strncmp(value + 1, text, n) && value[1 + n] == '"';
}

const char *json_at(const char *object, const char *key) {
    if (!object || *object != '{') return NULL;
    for (const char *p = blank(object + 1); *p == '"';) {
        const char *value = blank(blank(skip_string(p)) + 1);
        if (json_is(p, key)) return value;
        p = blank(json_skip(value));
        if (*p == ',') p = blank(p + 1);
    }
    return NULL;
}

const char *json_first(const char *list) {
    if (!list || *list != '[') return NULL;
    const char *p = blank(list + 1);
    return *p == ']' ? NULL : p;
}

const char *json_next(const char *element) {
    const char *p = blank(json_skip(element));
    return *p == ',' ? blank(p + 1) : NULL;
}

double json_number(const char *value, double otherwise) {
    return value && (*value == '-' || (*value >= '0' && *value <= '9')) ? strtod(value, NULL) : otherwise;
}

void json_string(const char *value, char *out, int size) {
    int n = 0;
    if (value && *value == '"')
        for (const char *p = value + 1; *p != '"' && n + 1 < size; p++) out[n++] = *p;
    out[n] = 0;
}
