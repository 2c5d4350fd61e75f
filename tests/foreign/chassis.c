/* One rigid body with wheels that spin in it, under gravity and the wrenches on its wheels and mounts.

   Its places are, for each side, five road wheels, the idler, and the mount of the sprocket, which does not spin. All
   begin at "start", at rest, turned by "pitch". Wrenches hold for the whole step, in world axes. "inertia" is that of
   all masses about their centre, less the wheels' about their axles. The classical Runge-Kutta method integrates. */
#include "shell.h"
#include <math.h>

enum { MOUNT = 6, SIDE = 7, PLACES = 14, TURN = 0, RATE = 4, SPIN = 7, ANGLE = SPIN + PLACES, STATE = ANGLE + PLACES };
static const double AXLE[3] = {0.0, 1.0, 0.0};

static void cross(const double *a, const double *b, double *to) {
    for (int k = 0; k < 3; k++) to[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
}

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void axes(const double *q, double R[3][3]) { /* columns are the axes of the body in the world */
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        R[i][i] = 1.0 - 2.0 * (q[1 + j] * q[1 + j] + q[1 + k] * q[1 + k]);
        R[j][i] = 2.0 * (q[1 + i] * q[1 + j] + q[0] * q[1 + k]);
        R[k][i] = 2.0 * (q[1 + i] * q[1 + k] - q[0] * q[1 + j]);
    }
}

static void to_world(double R[3][3], const double *v, double *to) {
    for (int i = 0; i < 3; i++) to[i] = dot(R[i], v);
}

static double spin_inertia(const Model *m, int place) {
    int k = place % SIDE;
    return k == MOUNT ? 0.0 : m->r[k == MOUNT - 1 ? idler_inertia : wheel_inertia];
}

static void place_in_body(const Model *m, int place, double *b) { /* from the centre of mass */
    const double *at = m->r + left_road_wheel_1__start_x + 3 * place, *c = m->r + centre_start_x;
    double d[3] = {at[0] - c[0], at[1] - c[1], at[2] - c[2]}, C = cos(m->r[pitch]), S = sin(m->r[pitch]);
    b[0] = C * d[0] - S * d[2], b[1] = d[1], b[2] = S * d[0] + C * d[2];
}

static void momentum(const Model *m, const double *x, double *L) { /* angular, body axes */
    const double *w = x + RATE, *r = m->r;
    L[0] = r[inertia_xx] * w[0] + r[inertia_xz] * w[2];
    L[1] = r[inertia_yy] * w[1];
    L[2] = r[inertia_xz] * w[0] + r[inertia_zz] * w[2];
    for (int k = 0; k < PLACES; k++) L[1] += spin_inertia(m, k) * x[SPIN + k];
}

static void derivative(const Model *m, const double *x, double *d) {
    const double *q = x + TURN, *w = x + RATE, *r = m->r;
    double R[3][3], axle[3], T[3] = {0.0, 0.0, 0.0}, L[3], turning[3];
    axes(q, R);
    to_world(R, AXLE, axle);
    for (int k = 0; k < PLACES; k++) {
        const double *force = r + left_road_wheel_1__force_x + 6 * k, *torque = force + 3;
        double b[3], arm[3], moment[3], I = spin_inertia(m, k), about = I > 0.0 ? dot(axle, torque) : 0.0;
        place_in_body(m, k, b);
        to_world(R, b, arm);
        cross(arm, force, moment);
        for (int i = 0; i < 3; i++) T[i] += moment[i] + torque[i] - about * axle[i];
        d[SPIN + k] = I > 0.0 ? about / I : 0.0;
        d[ANGLE + k] = I > 0.0 ? x[SPIN + k] - w[1] : 0.0;
    }
    momentum(m, x, L);
    cross(L, w, turning);
    for (int j = 0; j < 3; j++) turning[j] += R[0][j] * T[0] + R[1][j] * T[1] + R[2][j] * T[2];
    double det = r[inertia_xx] * r[inertia_zz] - r[inertia_xz] * r[inertia_xz];
    d[RATE] = (r[inertia_zz] * turning[0] - r[inertia_xz] * turning[2]) / det;
    d[RATE + 1] = turning[1] / r[inertia_yy];
    d[RATE + 2] = (r[inertia_xx] * turning[2] - r[inertia_xz] * turning[0]) / det;
    d[0] = -0.5 * dot(q + 1, w);
    cross(q + 1, w, d + 1);
    for (int k = 0; k < 3; k++) d[1 + k] = 0.5 * (d[1 + k] + q[0] * w[k]);
}

static void turn_step(const Model *m, double *x, double h) {
    static const double NODE[4] = {0.0, 0.5, 0.5, 1.0}, WEIGHT[4] = {1.0, 2.0, 2.0, 1.0};
    double d[STATE] = {0.0}, sum[STATE] = {0.0}, stage[STATE], size = 0.0;
    for (int s = 0; s < 4; s++) {
        for (int i = 0; i < STATE; i++) stage[i] = x[i] + NODE[s] * h * d[i];
        derivative(m, stage, d);
        for (int i = 0; i < STATE; i++) sum[i] += WEIGHT[s] * d[i];
    }
    for (int i = 0; i < STATE; i++) x[i] += h / 6.0 * sum[i];
    for (int i = 0; i < 4; i++) size += x[i] * x[i];
    for (int i = 0; i < 4; i++) x[i] /= sqrt(size);
}

static void put_motion(double *to, const double *at, const double *v, const double *b, double R[3][3], const double *q,
                       double angle, double spin, const double *w) {
    double arm[3], rate[3], moving[3], c = cos(0.5 * angle), s = sin(0.5 * angle);
    double relative[3] = {w[0], spin, w[2]};
    to_world(R, b, arm);
    to_world(R, w, rate);
    cross(rate, arm, moving);
    for (int k = 0; k < 3; k++) to[k] = at[k] + arm[k], to[7 + k] = v[k] + moving[k];
    to[3] = q[0] * c - q[2] * s, to[4] = q[1] * c - q[3] * s, to[5] = q[2] * c + q[0] * s, to[6] = q[3] * c + q[1] * s;
    to_world(R, relative, to + 10);
}

static fmi2Status advance(Model *m, double t, double h) {
    double *r = m->r, *x = r + state_1_, *at = r + chassis_position_x, *v = r + chassis_velocity_x, R[3][3], L[3];
    const double *start = r + centre_start_x, *w = x + RATE, none[3] = {0.0, 0.0, 0.0};
    (void)t;
    if (h == 0.0) {
        memset(x, 0, STATE * sizeof *x);
        x[0] = cos(0.5 * r[pitch]), x[2] = sin(0.5 * r[pitch]);
        for (int k = 0; k < 3; k++) at[k] = start[k], v[k] = 0.0;
    } else {
        double force[3] = {0.0, 0.0, -r[mass] * r[gravity]};
        for (int k = 0; k < PLACES; k++)
            for (int i = 0; i < 3; i++) force[i] += r[left_road_wheel_1__force_x + 6 * k + i];
        for (int k = 0; k < 3; k++) {
            at[k] += h * (v[k] + 0.5 * h * force[k] / r[mass]);
            v[k] += h * force[k] / r[mass];
        }
        for (int k = 0; k < m->i[substeps]; k++) turn_step(m, x, h / m->i[substeps]);
    }
    axes(x, R);
    put_motion(at, (double[]){at[0], at[1], at[2]}, (double[]){v[0], v[1], v[2]}, none, R, x, 0.0, w[1], w);
    r[energy_kinetic] = 0.5 * r[mass] * dot(v, v);
    for (int k = 0; k < PLACES; k++) {
        double b[3], I = spin_inertia(m, k), spin = I > 0.0 ? x[SPIN + k] : w[1];
        place_in_body(m, k, b);
        put_motion(r + left_road_wheel_1__position_x + 13 * k, at, v, b, R, x, x[ANGLE + k], spin, w);
        r[energy_kinetic] += 0.5 * I * x[SPIN + k] * (x[SPIN + k] - w[1]);
    }
    momentum(m, x, L);
    r[energy_kinetic] += 0.5 * dot(L, w);
    r[energy_gravity] = r[mass] * r[gravity] * (at[2] - start[2]);
    r[speed] = v[0] * R[0][0] + v[1] * R[1][0] + v[2] * R[2][0];
    r[distance] = at[0] - start[0];
    return fmi2OK;
}
