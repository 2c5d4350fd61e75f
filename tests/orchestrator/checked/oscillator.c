/* FMU of a damped oscillator with exact steps. Each macro plants one fault, named in test_fmu_check.py. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi2.h"

enum { FORCE, X, V, START_X, STIFFNESS, DAMPING, N };            /* value references */
enum { INSTANTIATED, INITIALISING, RUNNING, TERMINATED, LOST };   /* phases */
static const double START[N] = { 0.0, 0.0, 0.0, 0.1, 40.0, 0.5 }; /* of a mass of 1 kg */

#define EXPORT __attribute__((visibility("default")))

typedef struct {
    double value[N], t;
    int phase;
} Instance;

#ifdef SHARED
static double shared; /* by all instances */
#endif
#ifdef OF_THREAD
static _Thread_local double of_thread;
#endif

static void begin(Instance *c) {
#ifdef SHARED
    shared = 0.0;
#endif
#ifdef OF_THREAD
    of_thread = 1.0;
#endif
#ifdef RESET_KEEPS_SPEED
    double v = c->value[V];
    memcpy(c->value, START, sizeof START);
    c->value[V] = v;
#else
    memcpy(c->value, START, sizeof START);
#endif
    c->phase = INSTANTIATED;
    c->t = 0.0;
}

#ifdef EXIT_ABORTS
__attribute__((destructor)) static void end(void) { abort(); }
#endif

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component p, fmi2Boolean on, size_t n, const fmi2String names[]) { return fmi2OK; }

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *call, fmi2Boolean visible, fmi2Boolean logging) {
#ifndef ANY_GUID
    if (strcmp(guid, "{oscillator}")) return 0;
#endif
    if (type != fmi2CoSimulation) return 0;
#ifdef ONCE
    static int made;
    if (made++) return 0;
#endif
#ifdef SLOW
    usleep(20000);
#endif
    Instance *c = calloc(1, sizeof *c);
#ifdef LEAK
    void *volatile lost = malloc(100000);
    memset(lost, 1, 100000);
#endif
    begin(c);
    return c;
}

EXPORT void fmi2FreeInstance(fmi2Component p) {
    if (((Instance *)p)->phase == LOST) abort(); /* no function may be called after fmi2Fatal */
    free(p);
}

#ifdef ANY_PHASE
#define REQUIRE(condition)
#else
#define REQUIRE(condition) if (!(condition)) return fmi2Error
#endif

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component p, fmi2Boolean a, fmi2Real tolerance, fmi2Real start, fmi2Boolean b,
                                      fmi2Real stop) {
    Instance *c = p;
    REQUIRE(c->phase == INSTANTIATED);
    c->t = start;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component p) {
    Instance *c = p;
    REQUIRE(c->phase == INSTANTIATED);
    c->phase = INITIALISING;
    return fmi2OK;
}

static void start(Instance *c) { c->value[X] = c->value[START_X]; }

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component p) {
    Instance *c = p;
    REQUIRE(c->phase == INITIALISING);
    start(c);
    c->phase = RUNNING;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Terminate(fmi2Component p) {
    Instance *c = p;
#ifdef TERMINATE_ABORTS
    if (c->phase == TERMINATED) abort();
#endif
#ifdef TERMINATE_ENDS
    _Exit(7);
#endif
#ifdef TERMINATE_EXITS
    if (c->phase == TERMINATED) _Exit(7);
#endif
#ifdef REFUSALS_ARE_FATAL
    if (c->phase != RUNNING) {
        c->phase = LOST;
        return fmi2Fatal;
    }
#endif
    REQUIRE(c->phase == RUNNING);
    c->phase = TERMINATED;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Reset(fmi2Component p) {
    begin(p);
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetReal(fmi2Component p, const fmi2ValueReference v[], size_t n, fmi2Real to[]) {
    Instance *c = p;
    REQUIRE(c->phase != INSTANTIATED);
    if (c->phase == INITIALISING) start(c);
    for (size_t i = 0; i < n; i++) {
        if (v[i] >= N) return fmi2Error;
        to[i] = c->value[v[i]];
#ifdef FEEDTHROUGH
        if (v[i] == V) to[i] += 0.01 * c->value[FORCE];
#endif
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component p, const fmi2ValueReference v[], size_t n, const fmi2Real from[]) {
    Instance *c = p;
    for (size_t i = 0; i < n; i++) {
        if (v[i] >= N) return fmi2Error;
#ifndef ANY_INPUT
        if (v[i] == FORCE && !isfinite(from[i])) return fmi2Error;
#endif
#ifdef SMALL_INPUT
        if (v[i] == FORCE && fabs(from[i]) > 1e-4) return fmi2Error;
#endif
        REQUIRE(v[i] == FORCE ? c->phase != TERMINATED : v[i] >= START_X && c->phase <= INITIALISING);
    }
    for (size_t i = 0; i < n; i++) c->value[v[i]] = from[i];
    return fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component p, fmi2Real t, fmi2Real h, fmi2Boolean no_rollback) {
    Instance *c = p;
    double *y = c->value, k = y[STIFFNESS], decay = y[DAMPING] / 2.0, w = sqrt(k - decay * decay), rest = y[FORCE] / k;
    REQUIRE(c->phase == RUNNING);
#ifdef HANGS
    for (volatile double s = 0.0; h < 0.0 && s < 1.0;) s = 0.0;
#endif
#ifdef ANY_STEP
    if (h == 0.0) y[V] += (t - c->t) / h;
#else
    if (!(h > 0.0) || fabs(t - c->t) > 1e-9) return fmi2Error;
#endif
    double x = y[X] - rest, v = y[V], e = exp(-decay * h), co = cos(w * h), si = sin(w * h) / w;
    y[X] = rest + e * (x * co + (v + decay * x) * si);
    y[V] = e * (v * co - (k * x + decay * v) * si);
#ifdef SHARED
    y[V] += 1e-9 * (shared += 1.0);
#endif
#ifdef OF_THREAD
    y[V] += 1e-9 * of_thread;
#endif
#ifdef RANDOM
    y[V] += 1e-9 * rand();
#endif
    c->t = t + h;
    return fmi2OK;
}

/* ---- states */

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component p, fmi2FMUstate *to) {
    if (!*to) *to = malloc(sizeof(Instance));
    memcpy(*to, p, sizeof(Instance));
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component p, fmi2FMUstate from) {
    Instance *c = p;
#ifdef STATE_WITHOUT_SPEED
    double v = c->value[V];
    memcpy(c, from, sizeof *c);
    c->value[V] = v;
#else
    memcpy(c, from, sizeof *c);
#endif
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component p, fmi2FMUstate *state) {
    free(*state);
    *state = 0;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component p, fmi2FMUstate state, size_t *n) {
    *n = sizeof(Instance);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component p, fmi2FMUstate state, fmi2Byte to[], size_t n) {
    memcpy(to, state, sizeof(Instance));
#ifdef BYTES_WITHOUT_SPEED
    memset(to + V * sizeof(double), 0, sizeof(double));
#endif
    return fmi2OK;
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component p, const fmi2Byte from[], size_t n, fmi2FMUstate *to) {
    if (n != sizeof(Instance)) return fmi2Error;
    if (!*to) *to = malloc(sizeof(Instance));
    memcpy(*to, from, sizeof(Instance));
    return fmi2OK;
}

/* ---- functions that are not supported */

#define MISSING(name, ...) EXPORT fmi2Status name(fmi2Component p, __VA_ARGS__) { return fmi2Error; }
MISSING(fmi2GetInteger, const fmi2ValueReference v[], size_t n, fmi2Integer to[])
MISSING(fmi2GetBoolean, const fmi2ValueReference v[], size_t n, fmi2Boolean to[])
MISSING(fmi2GetString, const fmi2ValueReference v[], size_t n, fmi2String to[])
MISSING(fmi2SetInteger, const fmi2ValueReference v[], size_t n, const fmi2Integer from[])
MISSING(fmi2SetBoolean, const fmi2ValueReference v[], size_t n, const fmi2Boolean from[])
MISSING(fmi2SetString, const fmi2ValueReference v[], size_t n, const fmi2String from[])
MISSING(fmi2GetDirectionalDerivative, const fmi2ValueReference u[], size_t n, const fmi2ValueReference v[], size_t m,
        const fmi2Real x[], fmi2Real y[])
MISSING(fmi2SetRealInputDerivatives, const fmi2ValueReference v[], size_t n, const fmi2Integer o[], const fmi2Real x[])
MISSING(fmi2GetRealOutputDerivatives, const fmi2ValueReference v[], size_t n, const fmi2Integer o[], fmi2Real x[])
MISSING(fmi2GetStatus, const fmi2StatusKind kind, fmi2Status *to)
MISSING(fmi2GetRealStatus, const fmi2StatusKind kind, fmi2Real *to)
MISSING(fmi2GetIntegerStatus, const fmi2StatusKind kind, fmi2Integer *to)
MISSING(fmi2GetBooleanStatus, const fmi2StatusKind kind, fmi2Boolean *to)
MISSING(fmi2GetStringStatus, const fmi2StatusKind kind, fmi2String *to)
EXPORT fmi2Status fmi2CancelStep(fmi2Component p) { return fmi2Error; }
