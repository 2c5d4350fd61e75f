"""Forces at points of a rigid link: where the point is, what the force does to the link, and the tally."""

from __future__ import annotations

from fmus.jit import kernel

# tally: sums over the run, then figures of the last evaluation; COVERING: power that moving covered parts lose;
# SLIP, SIDESLIP: N m/s along -x and -y
TRAVEL, DISSIPATED, WORK, COVERED, POWER, LOAD_POWER, COVERING, CONTACT, DEPTH, SLIP, SIDESLIP, LOAD = range(12)
TALLY = 12


@kernel
def lever(A, v, r, lx, ly, lz, point):
    """A point of a link at (lx, ly, lz) in body axes: position, velocity, lever into rows 0 to 2 of ``point``."""
    # body velocity of the point: w cross l
    u0, u1, u2 = v[4] * lz - v[5] * ly, v[5] * lx - v[3] * lz, v[3] * ly - v[4] * lx
    for i in range(3):
        lever = A[i, 0] * lx + A[i, 1] * ly + A[i, 2] * lz
        point[2, i] = lever
        point[0, i] = r[i] + lever
        point[1, i] = v[i] + A[i, 0] * u0 + A[i, 1] * u1 + A[i, 2] * u2


@kernel
def push(A, lever, share, c, by_v, tangent, N, r, K):
    """Put ``share`` of the contact force in the scratch ``c`` on a link at ``lever`` (3): residual r, tangent K."""
    f = c.f
    for k in range(3):
        # N = d(point)/d(turning about body axis k) = axis cross lever; N^T f is the body torque
        n0 = A[1, k] * lever[2] - A[2, k] * lever[1]
        n1 = A[2, k] * lever[0] - A[0, k] * lever[2]
        n2 = A[0, k] * lever[1] - A[1, k] * lever[0]
        N[0, 0, k], N[0, 1, k], N[0, 2, k] = n0, n1, n2
        r[k] -= share * f[k]
        r[3 + k] -= share * (n0 * f[0] + n1 * f[1] + n2 * f[2])
    if not tangent:
        return
    for i in range(3):
        for j in range(3):
            K[i, j] -= share * (c.f_x[i, j] + by_v * c.f_v[i, j])
        for k in range(3):
            s = 0.0
            for j in range(3):
                s -= share * (c.f_x[i, j] + by_v * c.f_v[i, j]) * N[0, j, k]
            N[1, i, k] = s
            K[i, 3 + k] += s
    for k in range(3):
        for j in range(3):
            s = 0.0
            t = 0.0
            for i in range(3):
                s -= N[0, i, k] * share * (c.f_x[i, j] + by_v * c.f_v[i, j])
                t += N[0, i, k] * N[1, i, j]
            K[3 + k, j] += s
            K[3 + k, 3 + j] += t


@kernel
def resist(A, N, foot, c, by_v, K):
    """Tangent of a force by the rate at which a rim sinks in, felt at ``foot`` (m from the middle, along the link).

    N (3, 3) as ``push`` left it: the force's point by the link's turning. K -= [f_rate; N^T f_rate] (d rate / d link).
    """
    f, n = c.f_rate, c.side
    for j in range(6):
        # d rate / d velocity = -side . (1, axis cross lever), the lever along the link's x axis
        if j < 3:
            by = -n[j]
        elif j == 3:
            by = 0.0
        else:
            other, sign = (2, -1.0) if j == 4 else (1, 1.0)
            by = -sign * foot * (n[0] * A[0, other] + n[1] * A[1, other] + n[2] * A[2, other])
        for i in range(3):
            K[i, j] -= by_v * by * f[i]
            K[3 + i, j] -= by_v * by * (N[0, i] * f[0] + N[1, i] * f[1] + N[2, i] * f[2])


@kernel
def count(tally, depth, energy, power):
    """Book a contact in the tally."""
    tally[CONTACT] += energy
    tally[POWER] += power
    tally[DEPTH] = max(tally[DEPTH], depth)
