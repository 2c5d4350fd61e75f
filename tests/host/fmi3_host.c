/* A host of one FMU of FMI 3.0: `LIBRARY TOKEN FILE STEPS H FIRST REFERENCES VALUES [PARAMETER VALUE]...` sets
   parameters, makes steps and writes the outputs of each step to FILE, as doubles. Outputs are REFERENCES value
   references from FIRST, with VALUES values in all. */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#if defined _WIN32
#include <windows.h>
#define dlopen(path, how) ((void *)LoadLibraryA(path))
#define dlsym(library, name) ((void *)GetProcAddress((HMODULE)(library), name))
#else
#include <dlfcn.h>
#endif
#include "resources.h"

enum { MOST = 4096 };

static void say(void *e, int status, const char *category, const char *text) {
    (void)e;
    fprintf(stderr, "%d, %s: %s\n", status, category, text);
}

static void *symbol(void *library, const char *name) {
    void *found = library ? dlsym(library, name) : 0;
    if (!found) fprintf(stderr, "there is no %s\n", name), exit(2);
    return found;
}

int main(int argc, char **argv) {
    void *library = argc > 8 ? dlopen(argv[1], RTLD_NOW) : 0;
    void *(*make)(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *, size_t, void *,
                  void (*)(void *, int, const char *, const char *), void *) = symbol(library, "fmi3InstantiateCoSimulation");
    int (*set)(void *, const uint32_t *, size_t, const double *, size_t) = symbol(library, "fmi3SetFloat64");
    int (*get)(void *, const uint32_t *, size_t, double *, size_t) = symbol(library, "fmi3GetFloat64");
    int (*enter)(void *, bool, double, double, bool, double) = symbol(library, "fmi3EnterInitializationMode");
    int (*leave)(void *) = symbol(library, "fmi3ExitInitializationMode"), (*end)(void *) = symbol(library, "fmi3Terminate");
    int (*step)(void *, double, double, bool, bool *, bool *, bool *, double *) = symbol(library, "fmi3DoStep");
    void (*release)(void *) = symbol(library, "fmi3FreeInstance"), *c;
    double h = atof(argv[5]), y[MOST], last;
    size_t n = strtoul(argv[7], 0, 10), m = strtoul(argv[8], 0, 10);
    uint32_t v[MOST], first = (uint32_t)strtoul(argv[6], 0, 10);
    FILE *file = fopen(argv[3], "wb");
    bool event, stop, early;
    if (n > MOST || m > MOST || !file || !(c = make("one", argv[2], resources_of(argv[1]), 0, 1, 0, 0, 0, 0, 0, say, 0))) return 3;
    for (uint32_t i = 0; i < n; i++) v[i] = first + i;
    for (int i = 9; i + 1 < argc; i += 2) {
        uint32_t reference = (uint32_t)strtoul(argv[i], 0, 10);
        double value = strtod(argv[i + 1], 0);
        if (set(c, &reference, 1, &value, 1)) return 4;
    }
    if (enter(c, 0, 0.0, 0.0, 0, 0.0) || leave(c)) return 5;
    for (int k = 0; k < atoi(argv[4]); k++) {
        if (step(c, k * h, h, 1, &event, &stop, &early, &last) || get(c, v, n, y, m)) return 6;
        fwrite(y, sizeof *y, m, file);
    }
    end(c);
    release(c);
    return fclose(file);
}
