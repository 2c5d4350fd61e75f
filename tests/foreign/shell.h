/* FMI 2.0 for co-simulation around a model of the tests, which is no FMU of cotrack.

   The builder writes model.h: GUID, the names of the variables as places in r (Reals), i (Integers, Booleans and
   Enumerations) and s (Strings), and their start values. The model defines advance(). */
#include "fmi2.h"
#include "model.h"
#include <stdlib.h>
#include <string.h>

#define TEXT 64 /* bytes of a String, its end included */
#define EXPORT __attribute__((visibility("default")))

typedef struct {
    const fmi2CallbackFunctions *functions;
    double r[REALS], reached; /* the time that is told after a step that was not done */
    int i[INTEGERS], ended, initialising;
    char s[STRINGS][TEXT];
} Model;

/* Do the step from t to t + h; outputs are set at t = h = 0 too, for inputs that may change then. */
static fmi2Status advance(Model *m, double t, double h);

#ifdef ENDINGS /* the model defines what these functions do besides */
static fmi2Status terminated(Model *m);
static void freed(Model *m);
#else
static fmi2Status terminated(Model *m) { (void)m; return fmi2OK; }
static void freed(Model *m) { (void)m; }
#endif

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT fmi2Status fmi2Reset(fmi2Component p) {
    Model *m = p;
    const fmi2CallbackFunctions *functions = m->functions;
    memset(m, 0, sizeof *m);
    m->functions = functions;
    memcpy(m->r, REAL_START, sizeof m->r);
    memcpy(m->i, INTEGER_START, sizeof m->i);
    for (int k = 0; k < STRINGS; k++) strncpy(m->s[k], STRING_START[k], TEXT - 1);
    return fmi2OK;
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logs) {
    (void)name, (void)resources, (void)visible, (void)logs;
    if (type != fmi2CoSimulation || strcmp(guid, GUID) != 0) return NULL;
    Model *m = malloc(sizeof *m);
    m->functions = functions;
    fmi2Reset(m);
    return m;
}

EXPORT void fmi2FreeInstance(fmi2Component p) { freed(p); free(p); }
EXPORT fmi2Status fmi2Terminate(fmi2Component p) { return terminated(p); }

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component p) {
    if (((Model *)p)->initialising) return fmi2Error;
    ((Model *)p)->initialising = 1;
    return fmi2OK;
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component p) {
    ((Model *)p)->initialising = 0;
    return advance(p, 0.0, 0.0);
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component p, fmi2Boolean tolerant, fmi2Real tolerance, fmi2Real start,
                                      fmi2Boolean ends, fmi2Real stop) {
    (void)p, (void)tolerant, (void)tolerance, (void)start, (void)ends, (void)stop;
    return fmi2OK;
}

#define VALUES(type, array)                                                                                     \
    EXPORT fmi2Status fmi2Set##type(fmi2Component p, const fmi2ValueReference at[], size_t n, const fmi2##type x[]) { \
        for (size_t k = 0; k < n; k++) ((Model *)p)->array[at[k]] = x[k];                                       \
        return fmi2OK;                                                                                          \
    }                                                                                                           \
    EXPORT fmi2Status fmi2Get##type(fmi2Component p, const fmi2ValueReference at[], size_t n, fmi2##type x[]) { \
        if (((Model *)p)->initialising) advance(p, 0.0, 0.0);                                                   \
        for (size_t k = 0; k < n; k++) x[k] = ((Model *)p)->array[at[k]];                                       \
        return fmi2OK;                                                                                          \
    }
VALUES(Real, r)
VALUES(Integer, i)
VALUES(Boolean, i)

EXPORT fmi2Status fmi2SetString(fmi2Component p, const fmi2ValueReference at[], size_t n, const fmi2String x[]) {
    for (size_t k = 0; k < n; k++) strncpy(((Model *)p)->s[at[k]], x[k], TEXT - 1);
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetString(fmi2Component p, const fmi2ValueReference at[], size_t n, fmi2String x[]) {
    if (((Model *)p)->initialising) advance(p, 0.0, 0.0);
    for (size_t k = 0; k < n; k++) x[k] = ((Model *)p)->s[at[k]];
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component p, fmi2FMUstate *state) {
    if (*state == NULL) *state = malloc(sizeof(Model));
    memcpy(*state, p, sizeof(Model));
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component p, fmi2FMUstate state) {
    memcpy(p, state, sizeof(Model));
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component p, fmi2FMUstate *state) {
    (void)p;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component p, fmi2Real t, fmi2Real h, fmi2Boolean final) {
    (void)final;
    return advance(p, t, h);
}

EXPORT fmi2Status fmi2GetRealStatus(fmi2Component p, fmi2StatusKind kind, fmi2Real *value) {
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = ((Model *)p)->reached;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component p, fmi2StatusKind kind, fmi2Boolean *value) {
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = ((Model *)p)->ended;
    return fmi2OK;
}

/* Functions that every library of FMI 2.0 has and that these models cannot do. */
#define REFUSED(name) EXPORT fmi2Status name(fmi2Component p) { (void)p; return fmi2Error; }
REFUSED(fmi2SetDebugLogging)
REFUSED(fmi2CancelStep)
REFUSED(fmi2GetStatus)
REFUSED(fmi2GetIntegerStatus)
REFUSED(fmi2GetStringStatus)
REFUSED(fmi2SerializedFMUstateSize)
REFUSED(fmi2SerializeFMUstate)
REFUSED(fmi2DeSerializeFMUstate)
REFUSED(fmi2GetDirectionalDerivative)
REFUSED(fmi2SetRealInputDerivatives)
REFUSED(fmi2GetRealOutputDerivatives)
