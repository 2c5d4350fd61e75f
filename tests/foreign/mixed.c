/* A first-order lag whose input a Boolean turns, T dx/dt = +-u - x, with a temperature and discrete variables.

   Every output depends on an input of its kind, also at the start. A step that is longer than "longest" is broken off after that time; one
   that would pass "end" ends the simulation. */
#include "shell.h"
#include <math.h>
#include <stdio.h>

static fmi2Status advance(Model *m, double t, double h) {
    double *r = m->r;
    int *i = m->i;
    if (h > 0.0 && t + h > r[end]) {
        m->reached = r[end], m->ended = 1;
        return fmi2Discard;
    }
    if (h > r[longest]) {
        m->reached = t + r[longest];
        return fmi2Discard;
    }
    double sign = i[forward_in] ? 1.0 : -1.0;
    if (h == 0.0) {
        r[x] = r[start] + 0.01 * r[u], r[warmth] = r[warmth_start];
    } else {
        r[x] = sign * r[u] + (r[x] - sign * r[u]) * exp(-h / r[T]);
        r[warmth] += h / r[T] * (r[warmth_in] - r[warmth]);
        i[count] = i[count_in] + 1;
    }
    i[forward] = r[x] < r[limit];
    i[gear] = h == 0.0 ? i[gear_in] : i[gear_in] % 3 + 1;
    snprintf(m->s[word], TEXT, "%c%.5s", 'a' + i[count] % 3, m->s[word_in]);
    return fmi2OK;
}
