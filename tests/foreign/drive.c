/* A sprocket on a mount, turned by a constant torque: J dOmega/dt = torque + torque of the chain about the axle.

   The mount moves on with its velocities inside a step. In the step that would pass the time "end" the instance does
   what "manner" says: 1 ends the simulation, 2 breaks the step off, 3 computes on, 4 fails. */
#include "shell.h"
#include <math.h>

static void rotate(const double *q, const double *v, double *to) { /* v by the quaternion q, which is w, x, y, z */
    double w = q[0], a = q[1], b = q[2], c = q[3];
    double x = b * v[2] - c * v[1], y = c * v[0] - a * v[2], z = a * v[1] - b * v[0];
    to[0] = v[0] + 2.0 * (w * x + b * z - c * y);
    to[1] = v[1] + 2.0 * (w * y + c * x - a * z);
    to[2] = v[2] + 2.0 * (w * z + a * y - b * x);
}

static void multiply(const double *p, const double *q, double *to) {
    to[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3];
    to[1] = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2];
    to[2] = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1];
    to[3] = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0];
}

static fmi2Status advance(Model *m, double t, double h) {
    double *r = m->r, lateral[3] = {0.0, 1.0, 0.0}, axis[3], q[4], turn[4], moved[4], spin[4];
    double *mount = r + mount_position_x, *sprocket = r + sprocket_position_x; /* 3 + 4 + 3 + 3 */
    if (m->i[manner] && t + h > r[end]) {
        m->reached = r[end];
        m->ended = m->i[manner] == 1;
        return m->i[manner] == 3 ? fmi2Pending : m->i[manner] == 4 ? fmi2Error : fmi2Discard;
    }
    turn[0] = 1.0;
    for (int k = 0; k < 3; k++) turn[1 + k] = 0.5 * h * mount[10 + k];
    multiply(turn, mount + 3, moved);
    double size = sqrt(moved[0] * moved[0] + moved[1] * moved[1] + moved[2] * moved[2] + moved[3] * moved[3]);
    for (int k = 0; k < 4; k++) q[k] = moved[k] / size;
    rotate(q, lateral, axis);
    double chain = 0.0, of_mount = 0.0, before = r[rate];
    for (int k = 0; k < 3; k++) {
        chain += axis[k] * r[sprocket_torque_x + k];
        of_mount += axis[k] * mount[10 + k];
    }
    if (h > 0.0) r[rate] += h * (r[torque] + chain) / r[inertia];
    r[angle] += h * (0.5 * (before + r[rate]) - of_mount);
    r[speed] = r[rate] - of_mount;
    spin[0] = cos(0.5 * r[angle]), spin[1] = 0.0, spin[2] = sin(0.5 * r[angle]), spin[3] = 0.0;
    for (int k = 0; k < 3; k++) {
        sprocket[k] = mount[k] + h * mount[7 + k];
        sprocket[7 + k] = mount[7 + k];
        sprocket[10 + k] = mount[10 + k] + r[speed] * axis[k];
        r[mount_force_x + k] = r[sprocket_force_x + k];
        r[mount_torque_x + k] = r[sprocket_torque_x + k] - (chain + r[torque]) * axis[k];
    }
    multiply(q, spin, sprocket + 3);
    m->i[steps] += h > 0.0;
    m->i[fast] = fabs(r[speed]) > 1.0;
    return fmi2OK;
}
