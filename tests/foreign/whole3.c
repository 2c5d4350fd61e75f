/* FMI 3.0: y = u + p for each type of whole numbers, y = p for an Enumeration, behind those of Int64.
   y.Int64 grows by p.Int32 in each step. p.Int16 is the manner of its third step: -30001 ends the run, -30002 does so
   in its middle, -30003 returns early, -30004 is said to end in its middle, -30005 asks for event mode. */
#include "fmi3.h"
#include <stdlib.h>
#include <string.h>

#define EACH(X) X(0, Int8) X(1, UInt8) X(2, Int16) X(3, UInt16) X(4, Int32) X(5, UInt32) X(6, Int64) X(7, UInt64)
#define EXPORT __attribute__((visibility("default")))
#define ROW(k, T) fmi3##T T[6];
typedef struct { EACH(ROW) fmi3Int64 steps; } Model;

static fmi3Status advance(Model *m) {
#define ADD(k, T) m->T[2] = (fmi3##T)((fmi3UInt64)m->T[0] + (fmi3UInt64)m->T[1]);
    EACH(ADD)
    m->Int64[2] += m->steps * m->Int32[1];
    m->Int64[5] = m->Int64[4];
    return fmi3OK;
}

#define ACCESS(k, T)                                                                                                   \
    EXPORT fmi3Status fmi3Get##T(fmi3Instance p, const fmi3ValueReference v[], size_t n, fmi3##T to[], size_t m) {     \
        (void)m;                                                                                                       \
        for (size_t i = 0; i < n; i++) to[i] = ((Model *)p)->T[v[i] % 10];                                             \
        return fmi3OK;                                                                                                 \
    }                                                                                                                  \
    EXPORT fmi3Status fmi3Set##T(fmi3Instance p, const fmi3ValueReference v[], size_t n, const fmi3##T from[], size_t m) { \
        (void)m;                                                                                                       \
        for (size_t i = 0; i < n; i++) ((Model *)p)->T[v[i] % 10] = from[i];                                           \
        return advance(p);                                                                                             \
    }
EACH(ACCESS)

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String a, fmi3String b, fmi3String c, fmi3Boolean d, fmi3Boolean e,
                                                fmi3Boolean f, fmi3Boolean g, const fmi3ValueReference h[], size_t n,
                                                fmi3InstanceEnvironment i, fmi3LogMessageCallback j,
                                                fmi3IntermediateUpdateCallback k) {
    (void)a, (void)b, (void)c, (void)d, (void)e, (void)f, (void)g, (void)h, (void)n, (void)i, (void)j, (void)k;
    return calloc(1, sizeof(Model));
}
EXPORT void fmi3FreeInstance(fmi3Instance p) { free(p); }
EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance p, fmi3Boolean a, fmi3Float64 b, fmi3Float64 c,
                                              fmi3Boolean d, fmi3Float64 e) {
    (void)a, (void)b, (void)c, (void)d, (void)e;
    return advance(p);
}
EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance p) { return advance(p); }
EXPORT fmi3Status fmi3Terminate(fmi3Instance p) { return advance(p); }
EXPORT fmi3Status fmi3DoStep(fmi3Instance p, fmi3Float64 t, fmi3Float64 h, fmi3Boolean a, fmi3Boolean *b,
                             fmi3Boolean *c, fmi3Boolean *d, fmi3Float64 *last) {
    (void)a;
    int manner = ++((Model *)p)->steps == 3 ? -30000 - ((Model *)p)->Int16[1] : 0;
    *b = manner == 5, *c = manner == 1 || manner == 2, *d = manner == 3;
    *last = manner > 1 && manner < 5 ? t + 0.5 * h : t + h;
    return advance(p);
}
