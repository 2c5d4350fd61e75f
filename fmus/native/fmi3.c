/* FMI 3.0 functions around an instance: Float64 arrays, Int64, String; no events, no clocks. */
#include "fmi3.h"
typedef struct { fmi3LogMessageCallback log; fmi3InstanceEnvironment environment; } Host;
typedef struct { int first, count; } Array; /* elements of a Float64 variable in the row of Reals */
#include "instance.h"

enum { FIRST_INTEGER = N_ARRAY, FIRST_STRING = N_ARRAY + N_COUNTER + 1, TIME = FIRST_STRING + N_STRING };

static void log_message(Instance *c, Status status, const char *category, const char *text) {
    if (c->host.log && (status != STATUS_OK || c->logging))
        c->host.log(c->host.environment, (fmi3Status)status, category, text);
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                                fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean events,
                                                fmi3Boolean early, const fmi3ValueReference intermediate[], size_t n,
                                                fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                                fmi3IntermediateUpdateCallback update) {
    Instance *c = create(name, token, resources, (Host){log, environment}, logging);
    (void)visible, (void)early, (void)intermediate, (void)update;
    if (!c || !(events || n)) return c;
    refuse(c, events ? "this FMU has no event mode" : "this FMU has no intermediate update");
    release(c);
    return 0;
}

EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                                 fmi3Boolean visible, fmi3Boolean logging,
                                                 fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    if (log) log(environment, fmi3Error, "logStatusError", "this FMU is one for co-simulation");
    return 0;
}

EXPORT fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                                      fmi3Boolean visible, fmi3Boolean logging,
                                                      fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                                      fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                                      fmi3UnlockPreemptionCallback unlock) {
    (void)update, (void)lock, (void)unlock;
    return fmi3InstantiateModelExchange(name, token, resources, visible, logging, environment, log);
}

EXPORT void fmi3FreeInstance(fmi3Instance p) {
    if (p) release(p);
}

EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance p, fmi3Boolean on, size_t n, const fmi3String categories[]) {
    return choose_categories(p, on, n, categories);
}

EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance p, fmi3Boolean a, fmi3Float64 tolerance, fmi3Float64 start,
                                              fmi3Boolean b, fmi3Float64 stop) {
    (void)a, (void)tolerance;
    CHECK(fmi3EnterInitializationMode);
    return set_times(p, start, b, stop) ? fmi3Error : enter(p, INITIALISING);
}

EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance p) {
    CHECK(fmi3ExitInitializationMode);
    return finish_initialisation(p);
}

EXPORT fmi3Status fmi3Terminate(fmi3Instance p) {
    CHECK(fmi3Terminate);
    return enter(p, TERMINATED);
}

EXPORT fmi3Status fmi3Reset(fmi3Instance p) {
    begin(p);
    return fmi3OK;
}

EXPORT fmi3Status fmi3DoStep(fmi3Instance p, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_rollback, fmi3Boolean *event,
                             fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    (void)no_rollback;
    *event = *terminate = *early = false;
    *last = ((Instance *)p)->d.now;
    CHECK(fmi3DoStep);
    Status status = advance(p, t, h);
    *last = ((Instance *)p)->d.now; /* a step that is discarded ends where it began */
    return status;
}

/* ---- variables: Float64 arrays, Int64, String, time share one row of value references */

static fmi3Status unknown(Instance *c, const char *type, fmi3ValueReference v) {
    return refuse(c, "no %s variable has the value reference %u", type, v);
}

static int wrong_count(Instance *c, size_t given, size_t needed) {
    if (given != needed) refuse(c, "these variables have %zu values, not %zu", needed, given);
    return given != needed;
}

EXPORT fmi3Status fmi3GetFloat64(fmi3Instance p, const fmi3ValueReference v[], size_t n, fmi3Float64 to[], size_t m) {
    Instance *c = p;
    int outputs = 0, links = 0;
    size_t count = 0;
    CHECK(fmi3GetFloat64);
    for (size_t i = 0; i < n; i++) {
        if (v[i] >= N_ARRAY && v[i] != TIME) return unknown(c, "Float64", v[i]);
        count += v[i] == TIME ? 1 : (size_t)ARRAY[v[i]].count;
        if (v[i] == TIME) continue;
        outputs |= is_output(ARRAY[v[i]].first);
        links |= is_link(ARRAY[v[i]].first);
    }
    if (wrong_count(c, m, count) || not_computed(c, outputs, links)) return fmi3Error;
    for (size_t i = 0; i < n; i++) {
        Array a = v[i] == TIME ? (Array){0, 1} : ARRAY[v[i]];
        memcpy(to, v[i] == TIME ? &c->d.now : c->d.value + a.first, (size_t)a.count * sizeof *to);
        to += a.count;
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetOutputDerivatives(fmi3Instance p, const fmi3ValueReference v[], size_t n,
                                           const fmi3Int32 orders[], fmi3Float64 to[], size_t m) {
    Instance *c = p;
    size_t count = 0;
    CHECK(fmi3GetFloat64);
    for (size_t i = 0; i < n; i++) {
        if (v[i] >= N_ARRAY) return unknown(c, "Float64", v[i]);
        count += (size_t)ARRAY[v[i]].count;
    }
    if (wrong_count(c, m, count) || !started(c)) return fmi3Error;
    for (size_t i = 0; i < n; i++)
        for (int k = 0; k < ARRAY[v[i]].count; k++)
            if (no_derivative(c, ARRAY[v[i]].first + k, orders[i], to++)) return fmi3Error;
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetFloat64(fmi3Instance p, const fmi3ValueReference v[], size_t n, const fmi3Float64 from[],
                                 size_t m) {
    Instance *c = p;
    size_t count = 0;
    CHECK(fmi3SetFloat64);
    for (size_t i = 0; i < n; i++) {
        if (v[i] == TIME) return refuse(c, "the time cannot be set");
        if (v[i] >= N_ARRAY) return unknown(c, "Float64", v[i]);
        count += (size_t)ARRAY[v[i]].count;
    }
    if (wrong_count(c, m, count)) return fmi3Error;
    count = 0;
    for (size_t i = 0; i < n; i++)
        for (int k = 0; k < ARRAY[v[i]].count; k++)
            if (settable_real(c, ARRAY[v[i]].first + k, from[count++])) return fmi3Error;
    for (size_t i = 0; i < n; i++) {
        memcpy(c->d.value + ARRAY[v[i]].first, from, (size_t)ARRAY[v[i]].count * sizeof *from);
        from += ARRAY[v[i]].count;
    }
    return fmi3OK;
}

/* A String parameter with choices is an Enumeration: the 64 bit number of a choice, from 1. */
static int is_integer(fmi3ValueReference v) { return v >= FIRST_INTEGER && v < FIRST_STRING; }
static int is_text(fmi3ValueReference v, int enumerated) {
    return v >= FIRST_STRING && v < TIME && (CHOICE[v - FIRST_STRING].first > 0) == enumerated;
}

EXPORT fmi3Status fmi3GetInt64(fmi3Instance p, const fmi3ValueReference v[], size_t n, fmi3Int64 to[], size_t m) {
    CHECK(fmi3GetInt64);
    if (wrong_count(p, m, n)) return fmi3Error;
    for (size_t i = 0; i < n; i++) {
        if (is_text(v[i], 1)) {
            to[i] = CHOICE[v[i] - FIRST_STRING].first + ((Instance *)p)->d.choice[v[i] - FIRST_STRING];
            continue;
        }
        if (!is_integer(v[i])) return unknown(p, "Int64", v[i]);
        if (!started(p)) return fmi3Error;
        to[i] = integer_value(p, v[i] - FIRST_INTEGER);
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetInt64(fmi3Instance p, const fmi3ValueReference v[], size_t n, const fmi3Int64 from[],
                               size_t m) {
    char text[32];
    CHECK(fmi3SetInt64);
    if (wrong_count(p, m, n)) return fmi3Error;
    for (size_t k = 0, i = 0; k < 2 * n; i = ++k % n) { /* all are checked before one is set */
        unsigned place = v[i] - FIRST_INTEGER + N_REAL, at = v[i] - FIRST_STRING;
        if (is_integer(v[i])) return refuse(p, "output '%s' cannot be set", NAME[place]);
        if (!is_text(v[i], 1)) return unknown(p, "Int64", v[i]);
        snprintf(text, sizeof text, "%lld", (long long)from[i]);
        if (choose(p, place, at, from[i] - CHOICE[at].first, text, k >= n)) return fmi3Error;
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetString(fmi3Instance p, const fmi3ValueReference v[], size_t n, fmi3String to[], size_t m) {
    CHECK(fmi3GetString);
    if (wrong_count(p, m, n)) return fmi3Error;
    for (size_t i = 0; i < n; i++) {
        if (!is_text(v[i], 0)) return unknown(p, "String", v[i]);
        to[i] = string_value(p, v[i] - FIRST_STRING);
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetString(fmi3Instance p, const fmi3ValueReference v[], size_t n, const fmi3String from[],
                                size_t m) {
    CHECK(fmi3SetString);
    if (wrong_count(p, m, n)) return fmi3Error;
    for (size_t k = 0, i = 0; k < 2 * n; i = ++k % n) {
        if (!is_text(v[i], 0)) return unknown(p, "String", v[i]);
        if (choose_text(p, v[i] - FIRST_INTEGER + N_REAL, v[i] - FIRST_STRING, from[i], k >= n)) return fmi3Error;
    }
    return fmi3OK;
}

/* ---- FMU states */

EXPORT fmi3Status fmi3GetFMUState(fmi3Instance p, fmi3FMUState *to) { return get_state(p, to); }
EXPORT fmi3Status fmi3SetFMUState(fmi3Instance p, fmi3FMUState from) { return set_state(p, from); }

EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance p, fmi3FMUState *state) {
    (void)p;
    return free_state(state);
}

EXPORT fmi3Status fmi3SerializedFMUStateSize(fmi3Instance p, fmi3FMUState state, size_t *n) {
    (void)p, (void)state;
    *n = sizeof(Bytes);
    return fmi3OK;
}

EXPORT fmi3Status fmi3SerializeFMUState(fmi3Instance p, fmi3FMUState state, fmi3Byte to[], size_t n) {
    return serialise(p, state, to, n);
}

EXPORT fmi3Status fmi3DeserializeFMUState(fmi3Instance p, const fmi3Byte from[], size_t n, fmi3FMUState *to) {
    return deserialise(p, from, n, to);
}

/* ---- what this FMU does not have: tools load all functions of the standard, and a call of these is refused */

#define NONE_OF(T)                                                                                               \
    EXPORT fmi3Status fmi3Get##T(fmi3Instance p, const fmi3ValueReference v[], size_t n, fmi3##T to[], size_t m) { \
        (void)to, (void)m;                                                                                       \
        return n ? unknown(p, #T, v[0]) : fmi3OK;                                                                \
    }                                                                                                            \
    EXPORT fmi3Status fmi3Set##T(fmi3Instance p, const fmi3ValueReference v[], size_t n, const fmi3##T from[],    \
                                 size_t m) {                                                                     \
        (void)from, (void)m;                                                                                     \
        return n ? unknown(p, #T, v[0]) : fmi3OK;                                                                \
    }
NONE_OF(Float32)
NONE_OF(Int8)
NONE_OF(UInt8)
NONE_OF(Int16)
NONE_OF(UInt16)
NONE_OF(Int32)
NONE_OF(UInt32)
NONE_OF(UInt64)
NONE_OF(Boolean)

#define REFUSED(name, ...) \
    EXPORT fmi3Status name(fmi3Instance p, __VA_ARGS__) { return refuse(p, #name " is not supported by this FMU"); }
#define REFUSED_PLAIN(name) \
    EXPORT fmi3Status name(fmi3Instance p) { return refuse(p, #name " is not supported by this FMU"); }
#define OF_VARIABLES const fmi3ValueReference v[], size_t n
#define DERIVATIVE \
    OF_VARIABLES, const fmi3ValueReference w[], size_t k, const double x[], size_t l, double y[], size_t m
REFUSED(fmi3GetBinary, OF_VARIABLES, size_t sizes[], fmi3Binary to[], size_t m)
REFUSED(fmi3SetBinary, OF_VARIABLES, const size_t sizes[], const fmi3Binary from[], size_t m)
REFUSED(fmi3GetClock, OF_VARIABLES, fmi3Clock to[])
REFUSED(fmi3SetClock, OF_VARIABLES, const fmi3Clock from[])
REFUSED(fmi3GetNumberOfVariableDependencies, fmi3ValueReference v, size_t *n)
REFUSED(fmi3GetVariableDependencies, fmi3ValueReference v, size_t i[], fmi3ValueReference w[], size_t k[],
        fmi3DependencyKind kinds[], size_t n)
REFUSED(fmi3GetDirectionalDerivative, DERIVATIVE)
REFUSED(fmi3GetAdjointDerivative, DERIVATIVE)
REFUSED(fmi3GetIntervalDecimal, OF_VARIABLES, double x[], fmi3IntervalQualifier q[])
REFUSED(fmi3GetIntervalFraction, OF_VARIABLES, fmi3UInt64 x[], fmi3UInt64 y[], fmi3IntervalQualifier q[])
REFUSED(fmi3GetShiftDecimal, OF_VARIABLES, double x[])
REFUSED(fmi3GetShiftFraction, OF_VARIABLES, fmi3UInt64 x[], fmi3UInt64 y[])
REFUSED(fmi3SetIntervalDecimal, OF_VARIABLES, const double x[])
REFUSED(fmi3SetIntervalFraction, OF_VARIABLES, const fmi3UInt64 x[], const fmi3UInt64 y[])
REFUSED(fmi3SetShiftDecimal, OF_VARIABLES, const double x[])
REFUSED(fmi3SetShiftFraction, OF_VARIABLES, const fmi3UInt64 x[], const fmi3UInt64 y[])
REFUSED(fmi3UpdateDiscreteStates, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *c, fmi3Boolean *d, fmi3Boolean *e,
        double *t)
REFUSED(fmi3SetTime, double t)
REFUSED(fmi3SetContinuousStates, const double x[], size_t n)
REFUSED(fmi3GetContinuousStates, double x[], size_t n)
REFUSED(fmi3GetContinuousStateDerivatives, double x[], size_t n)
REFUSED(fmi3GetNominalsOfContinuousStates, double x[], size_t n)
REFUSED(fmi3GetEventIndicators, double x[], size_t n)
REFUSED(fmi3GetNumberOfContinuousStates, size_t *n)
REFUSED(fmi3GetNumberOfEventIndicators, size_t *n)
REFUSED(fmi3CompletedIntegratorStep, fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *c)
REFUSED(fmi3ActivateModelPartition, fmi3ValueReference clock, double t)
REFUSED_PLAIN(fmi3EnterContinuousTimeMode)
REFUSED_PLAIN(fmi3EvaluateDiscreteStates)
REFUSED_PLAIN(fmi3EnterEventMode)
REFUSED_PLAIN(fmi3EnterStepMode)
REFUSED_PLAIN(fmi3EnterConfigurationMode)
REFUSED_PLAIN(fmi3ExitConfigurationMode)
