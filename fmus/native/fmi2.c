/* FMI 2.0 functions around an instance. */
#include "fmi2.h"
typedef fmi2CallbackFunctions Host;
#include "instance.h"

static void log_message(Instance *c, Status status, const char *category, const char *text) {
    char escaped[2 * LONGEST]; /* FMI reads a message as a format */
    size_t n = 0;
    if (!c->host.logger || (status == STATUS_OK && !c->logging)) return;
    for (; *text && n + 3 < sizeof escaped; text++) {
        if (*text == '%') escaped[n++] = '%';
        escaped[n++] = *text;
    }
    escaped[n] = 0;
    c->host.logger(c->host.componentEnvironment, c->name, (fmi2Status)status, category, escaped);
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *call, fmi2Boolean visible, fmi2Boolean logging) {
    Instance *c = create(name, guid, resources, call ? *call : (Host){0}, logging);
    (void)visible;
    if (!c || type == fmi2CoSimulation) return c;
    refuse(c, "this FMU is one for co-simulation");
    release(c);
    return 0;
}

EXPORT void fmi2FreeInstance(fmi2Component p) {
    if (p) release(p);
}

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component p, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    return choose_categories(p, on, n, categories);
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component p, fmi2Boolean a, fmi2Real tolerance, fmi2Real start, fmi2Boolean b,
                                      fmi2Real stop) {
    (void)a, (void)tolerance;
    CHECK(fmi2SetupExperiment);
    return set_times(p, start, b, stop);
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component p) {
    CHECK(fmi2EnterInitializationMode);
    return enter(p, INITIALISING);
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component p) {
    CHECK(fmi2ExitInitializationMode);
    return finish_initialisation(p);
}

EXPORT fmi2Status fmi2Terminate(fmi2Component p) {
    CHECK(fmi2Terminate);
    return enter(p, TERMINATED);
}

EXPORT fmi2Status fmi2Reset(fmi2Component p) {
    begin(p);
    return fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component p, fmi2Real t, fmi2Real h, fmi2Boolean no_rollback) {
    (void)no_rollback;
    CHECK(fmi2DoStep);
    return advance(p, t, h);
}

/* ---- variables */

EXPORT fmi2Status fmi2GetReal(fmi2Component p, const fmi2ValueReference v[], size_t n, fmi2Real to[]) {
    Instance *c = p;
    int outputs = 0, links = 0;
    CHECK(fmi2GetReal);
    for (size_t i = 0; i < n; i++) {
        if (v[i] >= N_REAL) return refuse(c, "no Real variable has the value reference %u", v[i]);
        outputs |= is_output(v[i]);
        links |= is_link(v[i]);
    }
    if (not_computed(c, outputs, links)) return fmi2Error;
    for (size_t i = 0; i < n; i++) to[i] = c->d.value[v[i]];
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component p, const fmi2ValueReference v[], size_t n, const fmi2Real from[]) {
    Instance *c = p;
    CHECK(fmi2SetReal);
    for (size_t i = 0; i < n; i++) {
        if (v[i] >= N_REAL) return refuse(c, "no Real variable has the value reference %u", v[i]);
        if (settable_real(c, v[i], from[i])) return fmi2Error;
    }
    for (size_t i = 0; i < n; i++) c->d.value[v[i]] = from[i];
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetInteger(fmi2Component p, const fmi2ValueReference v[], size_t n, fmi2Integer to[]) {
    Instance *c = p;
    CHECK(fmi2GetInteger);
    if (!started(c)) return fmi2Error;
    for (size_t i = 0; i < n; i++) {
        int64_t at = (int64_t)v[i] - N_REAL, value;
        if (at < 0 || at > N_COUNTER) return refuse(c, "no Integer variable has the value reference %u", v[i]);
        value = integer_value(c, at);
        to[i] = value > INT32_MAX ? INT32_MAX : (fmi2Integer)value;
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetInteger(fmi2Component p, const fmi2ValueReference v[], size_t n, const fmi2Integer from[]) {
    (void)from;
    CHECK(fmi2SetInteger);
    for (size_t i = 0; i < n; i++) {
        if (v[i] < N_REAL || v[i] > N_REAL + N_COUNTER)
            return refuse(p, "no Integer variable has the value reference %u", v[i]);
        return refuse(p, "output '%s' cannot be set", NAME[v[i]]);
    }
    return fmi2OK;
}

static int64_t string_at(unsigned v) { return (int64_t)v - N_REAL - N_COUNTER - 1; }

EXPORT fmi2Status fmi2GetString(fmi2Component p, const fmi2ValueReference v[], size_t n, fmi2String to[]) {
    CHECK(fmi2GetString);
    for (size_t i = 0; i < n; i++) {
        int64_t at = string_at(v[i]);
        if (at < 0 || at >= N_STRING) return refuse(p, "no String variable has the value reference %u", v[i]);
        to[i] = string_value(p, at);
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetString(fmi2Component p, const fmi2ValueReference v[], size_t n, const fmi2String from[]) {
    CHECK(fmi2SetString);
    for (size_t k = 0, i = 0; k < 2 * n; i = ++k % n) { /* all are checked before one is set */
        int64_t at = string_at(v[i]);
        if (at < 0 || at >= N_STRING) return refuse(p, "no String variable has the value reference %u", v[i]);
        if (choose_text(p, v[i], at, from[i], k >= n)) return fmi2Error;
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetBoolean(fmi2Component p, const fmi2ValueReference v[], size_t n, fmi2Boolean to[]) {
    (void)to;
    CHECK(fmi2GetBoolean);
    return n ? refuse(p, "no Boolean variable has the value reference %u", v[0]) : STATUS_OK;
}

EXPORT fmi2Status fmi2SetBoolean(fmi2Component p, const fmi2ValueReference v[], size_t n, const fmi2Boolean from[]) {
    (void)from;
    CHECK(fmi2SetBoolean);
    return n ? refuse(p, "no Boolean variable has the value reference %u", v[0]) : STATUS_OK;
}

/* ---- FMU states */

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component p, fmi2FMUstate *to) { return get_state(p, to); }
EXPORT fmi2Status fmi2SetFMUstate(fmi2Component p, fmi2FMUstate from) { return set_state(p, from); }

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component p, fmi2FMUstate *state) {
    (void)p;
    return free_state(state);
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component p, fmi2FMUstate state, size_t *n) {
    (void)p, (void)state;
    *n = sizeof(Bytes);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component p, fmi2FMUstate state, fmi2Byte to[], size_t n) {
    return serialise(p, state, to, n);
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component p, const fmi2Byte from[], size_t n, fmi2FMUstate *to) {
    return deserialise(p, from, n, to);
}

/* ---- derivatives, and functions that are not supported */

EXPORT fmi2Status fmi2CancelStep(fmi2Component p) { return refuse(p, "steps are not asynchronous"); }

EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component p, const fmi2ValueReference u[], size_t n,
                                               const fmi2ValueReference v[], size_t m, const fmi2Real x[],
                                               fmi2Real y[]) {
    (void)u, (void)n, (void)v, (void)m, (void)x, (void)y;
    return refuse(p, "there are no directional derivatives");
}

EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component p, const fmi2ValueReference v[], size_t n,
                                              const fmi2Integer order[], const fmi2Real x[]) {
    Instance *c = p;
    CHECK(fmi2SetReal);
    for (size_t i = 0; i < n; i++)
        if (v[i] >= N_INPUT || order[i] != 1)
            return refuse(c, "there is no derivative of order %d of the Real %u: inputs have one of order 1", order[i], v[i]);
    if (n && !c->d.sloped) memset(c->d.slope, 0, sizeof c->d.slope);
    for (size_t i = 0; i < n; i++) c->d.slope[v[i]] = x[i];
    c->d.sloped |= n > 0;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component p, const fmi2ValueReference v[], size_t n,
                                               const fmi2Integer order[], fmi2Real x[]) {
    Instance *c = p;
    CHECK(fmi2GetReal);
    if (!started(c)) return fmi2Error;
    for (size_t i = 0; i < n; i++) {
        if (v[i] >= N_REAL) return refuse(c, "no Real variable has the value reference %u", v[i]);
        if (no_derivative(c, v[i], order[i], x + i)) return fmi2Error;
    }
    return fmi2OK;
}

/* A step that is discarded ends where it began, and another one may follow: the instance never ends a run. */
EXPORT fmi2Status fmi2GetRealStatus(fmi2Component p, const fmi2StatusKind kind, fmi2Real *to) {
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *to = ((Instance *)p)->d.now;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component p, const fmi2StatusKind kind, fmi2Boolean *to) {
    (void)p;
    if (kind != fmi2Terminated) return fmi2Discard;
    *to = 0;
    return fmi2OK;
}

#define NO_STATUS(name, type)                                                        \
    EXPORT fmi2Status name(fmi2Component p, const fmi2StatusKind kind, type *to) { \
        (void)p, (void)kind, (void)to;                                               \
        return fmi2Discard; /* steps are not asynchronous */                         \
    }
NO_STATUS(fmi2GetStatus, fmi2Status)
NO_STATUS(fmi2GetIntegerStatus, fmi2Integer)
NO_STATUS(fmi2GetStringStatus, fmi2String)
