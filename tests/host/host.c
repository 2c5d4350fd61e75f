/* A co-simulation master in C: loads FMU libraries, couples them stage by stage, prints outputs and times.

   It reads lines: `instance LIBRARY GUID STAGE INPUTS OUTPUTS` (the value references of inputs come first, those of
   outputs after them), `connect FROM OUTPUT TO INPUT` (instances by number), `states` (each step saves, serialises and
   restores the state of each instance), and at last `run STEPS H [FILE]`: all outputs of all steps are written to the
   file, as doubles. */
#define _POSIX_C_SOURCE 200809L
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#if defined _WIN32
#include <windows.h>
#define dlopen(path, how) ((void *)LoadLibraryA(path))
#define dlsym(library, name) ((void *)GetProcAddress((HMODULE)(library), name))
#define dlerror() "the library cannot be loaded"
#else
#include <dlfcn.h>
#endif
#include "resources.h"
#if defined COUNTED /* callgrind counts the steps, one dump for each of an instance */
#include <valgrind/callgrind.h>
#else
#define CALLGRIND_TOGGLE_COLLECT
#define CALLGRIND_DUMP_STATS
#endif

enum { INSTANCES = 16, CONNECTIONS = 4096 };

typedef struct { void (*logger)(void *, const char *, int, const char *, const char *, ...); void *rest[4]; } Callbacks;
typedef struct {
    void *c;
    int stage, inputs, outputs;
    unsigned *vr;
    double *u, *y, time;
    int (*set)(void *, const unsigned *, size_t, const double *), (*get)(void *, const unsigned *, size_t, double *);
    int (*step)(void *, double, double, int);
    int (*save)(void *, void **), (*restore)(void *, void *), (*serialise)(void *, void *, char *, size_t);
    void *state;
    char *bytes;
    size_t size;
} Instance;
typedef struct { int from, output, to, input; } Connection;

static Instance all[INSTANCES];
static Connection wires[CONNECTIONS];
static int n, m, with_states;

static void say(void *e, const char *name, int status, const char *category, const char *text, ...) {
    (void)e;
    fprintf(stderr, "%s (%d, %s): %s\n", name, status, category, text);
}
static Callbacks callbacks = {say, {0}};

static void *symbol(void *library, const char *name) {
    void *found = dlsym(library, name);
    if (!found) exit(3);
    return found;
}

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

static void load(const char *path, const char *guid) {
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    Instance *a = &all[n];
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        exit(2);
    }
    void *(*instantiate)(const char *, int, const char *, const char *, Callbacks *, int, int) =
        (void *(*)(const char *, int, const char *, const char *, Callbacks *, int, int))symbol(library, "fmi2Instantiate");
    int (*enter)(void *) = (int (*)(void *))symbol(library, "fmi2EnterInitializationMode");
    int (*leave)(void *) = (int (*)(void *))symbol(library, "fmi2ExitInitializationMode");
    a->set = (int (*)(void *, const unsigned *, size_t, const double *))symbol(library, "fmi2SetReal");
    a->get = (int (*)(void *, const unsigned *, size_t, double *))symbol(library, "fmi2GetReal");
    a->step = (int (*)(void *, double, double, int))symbol(library, "fmi2DoStep");
    a->save = (int (*)(void *, void **))symbol(library, "fmi2GetFMUstate");
    a->restore = (int (*)(void *, void *))symbol(library, "fmi2SetFMUstate");
    a->serialise = (int (*)(void *, void *, char *, size_t))symbol(library, "fmi2SerializeFMUstate");
    a->c = instantiate("instance", 1, guid, resources_of(path), &callbacks, 0, 0);
    if (!a->c || enter(a->c) || leave(a->c)) exit(4);
    size_t size = (size_t)(a->inputs + a->outputs);
    a->vr = malloc((size + 1) * sizeof *a->vr);
    a->u = calloc(size + 2, sizeof *a->u);
    a->y = a->u + a->inputs;
    for (size_t i = 0; i < size; i++) a->vr[i] = (unsigned)i;
    if (a->get(a->c, a->vr, (size_t)a->inputs, a->u) || a->get(a->c, a->vr + a->inputs, (size_t)a->outputs, a->y)) exit(4);
    int (*count)(void *, void *, size_t *) = (int (*)(void *, void *, size_t *))symbol(library, "fmi2SerializedFMUstateSize");
    if (a->save(a->c, &a->state) || count(a->c, a->state, &a->size) || !(a->bytes = malloc(a->size))) exit(4);
    n++;
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static int make_step(Instance *a, double t, double h) {
    CALLGRIND_TOGGLE_COLLECT;
    int status = a->step(a->c, t, h, 1);
    CALLGRIND_TOGGLE_COLLECT;
    CALLGRIND_DUMP_STATS;
    return status;
}

int main(void) {
    char word[16], path[1024], guid[64];
    int steps = 0, first = 0, stages = 0; /* a driver's stage is -1 */
    double h = 0.0;
    while (scanf("%15s", word) == 1 && strcmp(word, "run")) {
        if (!strcmp(word, "instance")) {
            Instance *a = &all[n];
            if (n == INSTANCES || scanf("%1023s %63s %d %d %d", path, guid, &a->stage, &a->inputs, &a->outputs) != 5) return 5;
            if (a->stage < first) first = a->stage;
            if (a->stage >= stages) stages = a->stage + 1;
            load(path, guid);
        } else if (!strcmp(word, "states")) {
            with_states = 1;
        } else {
            Connection *w = &wires[m];
            if (m++ == CONNECTIONS || scanf("%d %d %d %d", &w->from, &w->output, &w->to, &w->input) != 4) return 5;
        }
    }
    if (scanf("%d %lf", &steps, &h) != 2) return 5;
    FILE *trace = scanf("%1023s", path) == 1 ? fopen(path, "wb") : 0;
    double *spent = malloc((size_t)steps * sizeof *spent);
    for (int k = 0; k < steps; k++) {
        double began = now();
        for (int stage = first; stage < stages; stage++) {
            for (int i = 0; i < m; i++)
                if (all[wires[i].to].stage == stage) all[wires[i].to].u[wires[i].input] = all[wires[i].from].y[wires[i].output];
            for (int i = 0; i < n; i++) {
                Instance *a = &all[i];
                double before = now();
                if (a->stage != stage) continue;
                if (a->set(a->c, a->vr, (size_t)a->inputs, a->u) || make_step(a, k * h, h) ||
                    a->get(a->c, a->vr + a->inputs, (size_t)a->outputs, a->y))
                    return 1;
                if (with_states && (a->save(a->c, &a->state) || a->serialise(a->c, a->state, a->bytes, a->size) ||
                                    a->restore(a->c, a->state)))
                    return 1;
                a->time += now() - before;
            }
        }
        spent[k] = now() - began;
        for (int i = 0; i < n && trace; i++) fwrite(all[i].y, sizeof(double), (size_t)all[i].outputs, trace);
    }
    if (trace && fclose(trace)) return 6;
    for (int i = 0; i < n; i++) {
        printf("%g", all[i].time / steps);
        for (int j = 0; j < all[i].outputs; j++) printf(" %a", all[i].y[j]);
        printf("\n");
    }
    qsort(spent, (size_t)steps, sizeof *spent, ascending);
    printf("%g %g %g %g\n", spent[steps / 2], spent[(int)(0.999 * steps)], spent[(int)(0.9999 * steps)], spent[steps - 1]);
    return 0;
}
