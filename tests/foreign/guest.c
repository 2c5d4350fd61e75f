/* An integrator of 1 + u that begins to misbehave "when" a time has come, in one "manner". */
#define ENDINGS
#include "shell.h"
#include <fenv.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <unistd.h>

static double all; /* of all instances in the process */

/* Start a process that would last longer than a test, with a program of its own or as a copy of this one. */
static void spawn(int program) {
    int child = fork();
    if (child) {
        printf("child %d\n", child);
        fflush(stdout);
    } else {
        if (program) execlp("sleep", "sleep", "30", (char *)NULL);
        for (;;) pause();
    }
}

static fmi2Status say(Model *m, fmi2Status status, const char *text) {
    m->functions->logger(m->functions->componentEnvironment, "guest", status, "", text);
    return status;
}

static fmi2Status terminated(Model *m) {
    switch (m->i[manner]) {
        case 20: return say(m, fmi2Error, "no space for the results");
        case 21: raise(SIGKILL);
        case 22: for (;;) pause();
    }
    return fmi2OK;
}

static void freed(Model *m) {
    if (m->i[manner] == 23) raise(SIGKILL);
}

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
        case 10: spawn(1); m->r[when] = 1e9; break;
        case 11: spawn(1); raise(SIGKILL);
        case 12: spawn(0); raise(SIGKILL);
        case 13: spawn(0); for (;;) pause();
        case 14: for (int k = 3; k < 256; k++) close(k); break;
        case 15: for (int k = 0; k < 5000; k++) say(m, fmi2OK, "a line of some length that says nothing at all"); break;
        case 16: return say(m, fmi2Error, "no licence");
        case 9: printf("\033[31mred %g\nnext", t); fflush(stdout); break;
        }
    r[y] += h * (1.0 + r[u]);
    all += h;
    r[together] = all;
    m->i[steps] += h > 0.0;
    return fmi2OK;
}
