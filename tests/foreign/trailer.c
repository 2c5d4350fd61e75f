/* A mass that the velocity of a hitch draws along by a spring and a damper. */
#include "shell.h"

static fmi2Status advance(Model *m, double t, double h) {
    (void)t;
    double *r = m->r;
    const int n = 20; /* midpoint steps */
    for (int k = 0; k < n && h > 0.0; k++) {
        double dt = h / n, gap = r[velocity] - r[speed];
        double pull = r[stiffness] * (r[stretch] + 0.5 * dt * gap) + r[damping] * gap;
        double faster = gap - 0.5 * dt * pull / r[mass];
        pull = r[stiffness] * (r[stretch] + 0.5 * dt * gap) + r[damping] * faster;
        r[stretch] += dt * faster;
        r[speed] += dt * pull / r[mass];
        r[energy_dissipated] += dt * r[damping] * faster * faster;
    }
    r[force] = -r[stiffness] * r[stretch] - r[damping] * (r[velocity] - r[speed]);
    r[energy_kinetic] = 0.5 * r[mass] * r[speed] * r[speed];
    r[energy_spring] = 0.5 * r[stiffness] * r[stretch] * r[stretch];
    return fmi2OK;
}
