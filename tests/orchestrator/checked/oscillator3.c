/* The oscillator as an FMU of FMI 3.0: force, motion (x, v), start.x, stiffness, damping. It has the faults of
   oscillator.c, of which it wraps the functions, and more of its own. */
#include "oscillator.c"

#include <stdbool.h>
#include <stdint.h>

enum { FORCE3, MOTION3, TIME3 = 5, N3 };
static const int FIRST[N3] = { FORCE, X, START_X, STIFFNESS, DAMPING, N }, COUNT[N3] = { 1, 2, 1, 1, 1, 1 };
typedef void Log(void *, int, const char *, const char *);

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool events, bool early, const uint32_t intermediate[], size_t n,
                                         void *environment, Log *log, void *update) {
    void *c = fmi2Instantiate(name, fmi2CoSimulation, token, resources, 0, visible, logging);
    if (!c) log(environment, fmi2Error, "logStatusError", "this FMU has another token");
    return c;
}

EXPORT void fmi3FreeInstance(void *p) { fmi2FreeInstance(p); }

EXPORT int fmi3EnterInitializationMode(void *p, bool a, double tolerance, double start, bool b, double stop) {
    return fmi2SetupExperiment(p, a, tolerance, start, b, stop) || fmi2EnterInitializationMode(p) ? fmi2Error : fmi2OK;
}

EXPORT int fmi3ExitInitializationMode(void *p) { return fmi2ExitInitializationMode(p); }
EXPORT int fmi3Terminate(void *p) { return fmi2Terminate(p); }
EXPORT int fmi3Reset(void *p) { return fmi2Reset(p); }

static int each(void *p, const uint32_t v[], size_t n, double y[], size_t m, int sets) {
    Instance *c = p;
    size_t at = 0;
    REQUIRE(sets || c->phase != INSTANTIATED);
    for (size_t i = 0; i < n; at += COUNT[v[i++]])
        if (v[i] >= N3 || at + COUNT[v[i]] > m || (sets && v[i] == TIME3)) return fmi2Error;
    if (at != m) return fmi2Error;
    for (size_t i = 0; i < n; i++)
        for (int k = 0; k < COUNT[v[i]]; k++, y++) {
            fmi2ValueReference one = FIRST[v[i]] + k;
            if (one == N) *y = c->t;
            else if (sets ? fmi2SetReal(p, &one, 1, y) : fmi2GetReal(p, &one, 1, y)) return fmi2Error;
        }
    return fmi2OK;
}

EXPORT int fmi3GetFloat64(void *p, const uint32_t v[], size_t n, double to[], size_t m) { return each(p, v, n, to, m, 0); }

EXPORT int fmi3SetFloat64(void *p, const uint32_t v[], size_t n, const double from[], size_t m) {
    return each(p, v, n, (double *)from, m, 1);
}

EXPORT int fmi3DoStep(void *p, double t, double h, bool no_rollback, bool *event, bool *terminate, bool *early,
                      double *last) {
    int status = fmi2DoStep(p, t, h, no_rollback);
    *event = *terminate = *early = false;
#ifdef EARLY
    *early = true;
#endif
#ifdef EVENT
    *event = true;
#endif
    *last = ((Instance *)p)->t;
    return status;
}

EXPORT int fmi3GetFMUState(void *p, void **to) { return fmi2GetFMUstate(p, to); }
EXPORT int fmi3SetFMUState(void *p, void *from) { return fmi2SetFMUstate(p, from); }
EXPORT int fmi3FreeFMUState(void *p, void **state) { return fmi2FreeFMUstate(p, state); }
EXPORT int fmi3SerializedFMUStateSize(void *p, void *state, size_t *n) { return fmi2SerializedFMUstateSize(p, state, n); }

EXPORT int fmi3SerializeFMUState(void *p, void *state, uint8_t to[], size_t n) {
    return fmi2SerializeFMUstate(p, state, (char *)to, n);
}

EXPORT int fmi3DeserializeFMUState(void *p, const uint8_t from[], size_t n, void **to) {
    return fmi2DeSerializeFMUstate(p, (const char *)from, n, to);
}
