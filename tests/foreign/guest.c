/* An integrator of 1 + u that begins to misbehave "when" a time has come, in one "manner". */
#include "shell.h"
#include <fenv.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <unistd.h>

static double all; /* of all instances in the process */

static fmi2Status advance(Model *m, double t, double h) {
    double *r = m->r;
    if (t + h >= r[when] - 1e-12) switch (m->i[manner]) {
        case 1: exit(0);
        case 2: raise(SIGKILL);
        case 3: for (;;) pause();
        case 4: r[y] = NAN; return fmi2OK;
        case 5: return -1;
        case 6: return 77;
        case 7: if (chdir("/")) return fmi2Error; break;
        case 8: fesetround(FE_UPWARD); break;
        case 9: printf("\033[31mred %g\nnext", t); fflush(stdout); break;
        }
    r[y] += h * (1.0 + r[u]);
    all += h;
    r[together] = all;
    m->i[steps] += h > 0.0;
    return fmi2OK;
}
