"""Cables in axes that turn with them: loads on a turning chain, momentum, order, energy, states."""

import flexible_track
import numpy as np
import pytest
from flexible_track import TABLE, make, wheels
from scipy.spatial.transform import Rotation

from fmus.physics.chain.flexible.axes_state import OMEGA, OMEGA_RATE, ORIGIN
from fmus.physics.chain.flexible.link_layout import coordinate_indices
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.report import KINETIC, STRAIN
from fmus.physics.integrate.generalized_alpha import Slopes

pytestmark = pytest.mark.long  # kernels of their own

BY = Slopes(0.0, 0.0, 4e6)
EXPLICIT, IMPLICIT = "runge_kutta", "generalized_alpha"
ALONE = {"wheels": wheels(), "ground": False, "gravity": 0.0}


def carrier(**changes):
    return flexible_track.carrier(axes="free", **changes)


def shaken(model, size=1e-3):
    """Put a chain on its wheels into contact, out of its plane, with no two links alike."""
    rng = np.random.default_rng(2)
    model.s.q[:] += size * rng.standard_normal(model.s.q.shape) * [1.0, 1.0, 1.0, 0.1, 0.1, 0.1, 0.1, 0.1]
    model.work.wheels[:] = model.start_rows
    model.work.wheels[:, :3] += [2e-3, 3e-3, -1e-3]
    return model


def residual(model, turn=(0.0, 0.0, 0.0), by=BY, moved=None, fresh=False):
    """Residuals of the links (n, 12), N, and of the balance of moments.

    The axes are turned, or the pins ``moved``. Rates and accelerations change with them by the factors ``by``.
    """
    axes, w, still = model.s.axes.copy(), model.work, model.work.still
    axes[:ORIGIN] = (Rotation.from_rotvec(turn).as_matrix()).ravel()
    axes[OMEGA : OMEGA + 3] += by.v * np.asarray(turn)
    axes[OMEGA_RATE : OMEGA_RATE + 3] += by.vdot * np.asarray(turn)
    change = still if moved is None else moved
    motion = Motion(model.s.q + change, by.v * change, by.vdot * change, axes)
    model.evaluate(motion, by, fresh)
    return w.residual.reshape(len(w.residual), -1).copy(), w.axes.moment.copy()


def differences(function, step):
    """Central differences of the values of a function of one argument."""
    return [(there - back) / (2.0 * step) for there, back in zip(function(step), function(-step), strict=True)]


def border_of(model):
    """Columns (nodes, 8, 2), rows and corner (2, 2) of the axes' rotation before condensation."""
    w, a, at, n = model.work, model.work.axes, model.kit.LAYOUT, model.links_count
    columns, rows = np.zeros((model.nodes, 8, 2)), np.zeros((model.nodes, 8, 2))
    columns[:, at.pin], rows[:, at.pin] = a.border[..., :2], a.border[..., 2:]
    corner = a.corner.copy()
    for i in range(n):
        inside, own = w.left[i, 8:], w.right[i, :, 8:]
        corner += inside @ own
        from_own = np.linalg.solve(w.inner[i], own)
        for part, half, pin in ((0, slice(0, 4), i), (1, slice(4, 8), (i + 1) % model.nodes)):
            columns[pin, at.pin] += (w.left[i, :8] @ own)[half]
            rows[pin, at.pin] += (inside @ w.right[i, :, :8]).T[half]
            slopes = slice(2 * part, 2 * part + 2)
            columns[pin, at.own_place[slopes]] += from_own[slopes]
            rows[pin, at.own_place[slopes]] += inside.T[slopes]
    return columns, rows, corner


@pytest.mark.parametrize("by", [BY, Slopes(0.0, 2e3, 4e6), Slopes(0.0, 2e4, 4e6)])
def test_the_border_is_what_a_turn_of_the_axes_does(by):
    """The border of the matrix is the derivative by a rotation of the axes, by differences, at rest.

    The rotation of faces and forces is left out. An error of 2 % is seen.
    """
    model = shaken(carrier())
    model.contacts = model.contacts._replace(sprocket=model.contacts.sprocket._replace(k=0.0, c=0.0, mu=0.0))
    residual(model, by=by, fresh=True)
    step = 1e-9
    columns, rows, corner = border_of(model)
    assert model.work.touched.sum() > 20
    at = coordinate_indices(model.kit, model.s.q, 4, model.links_count).reshape(model.links_count, -1)
    slopes = [differences(lambda d, e=e: residual(model, d * np.array(e), by), step) for e in ((1, 0, 0), (0, 0, 1))]
    for c, (residuals, moments) in enumerate(slopes):
        at_pins = np.zeros_like(model.s.q)
        np.add.at(at_pins.ravel(), at, residuals)
        for by_turn, known in ((at_pins, columns[..., c]), (moments, corner[:, c])):
            scale = np.abs(known).max()
            assert np.abs(by_turn - known).max() < 1e-3 * scale
            assert np.abs(by_turn - 1.02 * known).max() > 5e-3 * scale
    size = np.abs(rows).max(axis=(1, 2))
    pins, scale = [3, 17, 40, int(size.argmax())], size.max()
    by_pin = np.zeros((len(pins), 8, 2))
    for n, pin in enumerate(pins):
        for k in range(8):
            moved = np.zeros_like(model.s.q)
            moved[pin, k] = 1.0
            by_pin[n, k] = differences(lambda d, moved=moved: residual(model, by=by, moved=d * moved)[1:], step)[0]
    assert np.abs(by_pin - rows[pins]).max() < 1e-3 * scale
    assert np.abs(by_pin - 1.02 * rows[pins]).max() > 5e-3 * scale


def test_the_matrix_of_the_faces_is_the_derivative_of_their_load():
    """The matrix of the faces' contacts is the derivative of their load by the link's coordinates, by differences.

    Rates change with the coordinates, so that the dampers outweigh the rotation of faces, which is left out.
    """
    model, by = shaken(carrier()), Slopes(0.0, 2e4, 4e6)
    residual(model, by=by, fresh=True)
    known = model.work.stiffening[:, :12, :12].copy()

    def load(i, moved):
        residual(model, by=by, moved=moved)
        return model.work.load[i].reshape(1, -1).copy()

    at = coordinate_indices(model.kit, model.s.q, 4, model.links_count).reshape(model.links_count, -1)
    for i in np.argsort(abs(known).max(axis=(1, 2)))[-3:]:
        columns = []
        for place in at[i]:
            moved = np.zeros_like(model.s.q)
            moved.flat[place] = 1.0
            columns += differences(lambda d, i=i, moved=moved: load(i, d * moved), 1e-9)
        by_coordinate, scale = np.transpose(columns), abs(known[i]).max()
        assert abs(by_coordinate - known[i]).max() < 3e-5 * scale
        assert abs(by_coordinate - 1.02 * known[i]).max() > 1e-2 * scale


def test_the_balance_is_the_work_of_a_rotation():
    """The balance of moments is the work of a rotation on all that moves with the axes.

    Contact forces and weight count as computed elsewhere; internal forces do no work.
    """
    model = shaken(carrier())
    _, moment = residual(model, fresh=True)
    model.contacts = model.contacts._replace(soil=model.contacts.soil._replace(k=0.0, mu=0.0))
    _, without_ground = residual(model, fresh=True)
    w, m = model.work, len(model.wheel_list)
    arms = np.cross(w.wheels[:, :3], w.wrench[:m, :3])  # on the wheels, about the origin
    from_wheels = (w.wrench[:m, 3:] + arms).sum(axis=0)
    q, mass = model.s.q, TABLE["track"]["mass"]
    weight = mass * 9.81
    expected = np.zeros(3)  # of the forces on the chain, with the sign of a residual
    for i in range(model.links_count):
        model.kit.gather(model.link, q, i, (i + 1) % model.nodes, w.coordinates)
        middle = 0.5 * (w.coordinates[0] + w.coordinates[2]) + PITCH / 12.0 * (w.coordinates[1] - w.coordinates[3])
        expected += np.cross(middle, [0.0, 0.0, weight])
    expected += from_wheels
    assert without_ground == pytest.approx(expected[[0, 2]], abs=1e-6 * np.abs(arms).max())
    assert abs(moment - without_ground).max() > 0.5  # N m: the ground contributes


PITCH = TABLE["track"]["pitch"]


def driven(model, h, spin, steps):
    """Drive a chain by wheels that yaw about their middle, up to ``spin`` rad/s; there is no ground.

    Returns impulse (3) and angular impulse (3) of the wheels about the origin, and the chain's momenta before and
    after.
    """
    start, middle = model.start_rows.copy(), model.start_rows[:, :3].mean(axis=0)
    first = momenta(model)
    given, turned, yaw, end = np.zeros(3), np.zeros(3), 0.0, steps * h
    for k in range(steps):

        def rate(t):
            return spin * np.sin(0.5 * np.pi * t / end) ** 2

        t = k * h
        yaw = spin * (0.5 * t - 0.5 * end / np.pi * np.sin(np.pi * t / end))
        R = Rotation.from_euler("z", yaw)
        omega = np.array([0.0, 0.0, rate(t)])
        rows = start.copy()
        rows[:, :3] = middle + R.apply(start[:, :3] - middle)
        rows[:, 3:6] = np.cross(omega, rows[:, :3] - middle)
        rows[:, 6:9] = omega
        rows[:, 9:12], rows[:, 12:15] = R.apply(start[:, 9:12]), R.apply(start[:, 12:15])
        model.rows[:] = rows
        model.advance(t, h)
        force, torque = -model.s.mean[:-1, :3], -model.s.mean[:-1, 3:]
        half = rows[:, :3] + 0.5 * h * rows[:, 3:6]
        given += h * force.sum(axis=0)
        turned += h * (torque + np.cross(half, force)).sum(axis=0)
    return given, turned, first, momenta(model)


def momenta(model):
    """Linear and angular momentum of the links as lines, about the origin, in the frame of the start."""
    f, w = model.s.axes, model.work
    R, o, ov = f[:9].reshape(3, 3), f[9:12], f[12:15]
    linear, angular = np.zeros(3), np.zeros(3)
    for i in range(model.links_count):
        for q, out in ((model.s.q, w.coordinates), (model.s.v, w.rates)):
            model.kit.gather(model.link, q, i, (i + 1) % model.nodes, out)
        e, v = w.coordinates @ R.T, (w.rates + np.cross(f[OMEGA : OMEGA + 3], w.coordinates)) @ R.T
        e[::2] += o
        v[::2] += ov
        p = w.mass @ v
        linear += p[0] + p[2]
        angular += np.cross(e, p).sum(axis=0)
    return linear, angular


def test_momentum_is_that_of_the_wheels_and_of_second_order():
    """The change of momentum is the impulse of the wheels, to second order.

    The links' own inertia, constant and driven by the axes' rate, takes the rest.
    """
    lacks = []
    for h in (5e-4, 2.5e-4):
        model = make(ALONE, axes="free")
        given, turned, (p0, l0), (p1, l1) = driven(model, h, 3.0, round(2.0 / h))
        twist = model.link.rotary_inertia * model.s.axes[OMEGA + 2]
        assert l1[2] == pytest.approx(6422.0, rel=1e-3)  # kg m2/s, of the same chain as one body at 3 rad/s
        assert np.abs(p1 - p0 - given).max() < 1e-4 * l1[2]
        assert twist == pytest.approx(41.30, rel=1e-3)
        lacks.append(abs(l1[2] + twist - l0[2] - turned[2]))
    assert lacks[0] < 1e-4 * l1[2]
    assert 3.0 < lacks[0] / lacks[1] < 6.0


def tumbling(step, integrator=EXPLICIT, shake=0.0, **changes):
    """Spin a soft loop that yaws, rolls and bends; return ``totals`` at the start and after 0.1 s.

    Its wheels are 50 m away on all sides and move to and fro at ``shake`` m/s: only the origin follows them.
    """
    soft = {"material.youngs_modulus": 2e6, "material.relaxation_time": 0.0, "spectral_radius": 0.9}
    given = {"start": "polygon", "tolerance": 1e-12, "integrator": integrator, "step": step}
    model = make(ALONE, axes="free", **given, **(soft | changes))
    around = 2.0 * np.pi * np.arange(len(model.start_rows)) / len(model.start_rows)
    model.start_rows[:, :3] = 50.0 * np.stack([0.0 * around, np.cos(around), np.sin(around)], axis=1)
    angle = 2.0 * np.pi * np.arange(model.nodes) / model.nodes
    model.settle_pins(0.5 * PITCH / np.sin(np.pi / model.nodes) * np.stack([np.cos(angle), -np.sin(angle)], axis=1))
    for x, z in model.kit.PLANE:
        model.s.v[:, x], model.s.v[:, z] = 3.0 * model.s.q[:, z], -3.0 * model.s.q[:, x]
    model.s.v[:, 1] = np.cos(2.0 * angle)
    model.s.v[:, 7] = -2.0 * np.sin(2.0 * angle) * angle[1] / PITCH  # along the links
    model.s.axes[OMEGA], model.s.axes[OMEGA + 2] = 3.0, 2.0
    model.evaluate_start()
    start = totals(model)
    model.rows[:] = model.start_rows
    for k in range(10):
        model.rows[:, :3] = model.start_rows[:, :3] + shake * 1e-2 * (k % 2)
        model.rows[:, 3:6] = shake * (1.0 - 2.0 * (k % 2))
        model.advance(k * 1e-2, 1e-2)
    return model, start, totals(model)


def totals(model, twist=1.0):
    """Linear and angular momentum and energy, with ``rotary_inertia`` times the links' own rotation."""
    linear, angular = momenta(model)
    R, rate = model.s.axes[:9].reshape(3, 3), model.s.axes[OMEGA : OMEGA + 3]
    inertia = twist * model.link.rotary_inertia
    energy = model.report[KINETIC] + model.report[STRAIN] + 0.5 * (inertia - model.link.rotary_inertia) * rate @ rate
    return linear, angular + inertia * R @ rate, energy


def test_a_loop_that_tumbles_keeps_momentum_and_energy():
    """A tumbling loop keeps momentum and energy about all axes with the explicit integrator."""
    model, (p0, l0, e0), (p1, l1, e1) = tumbling(1e-4)
    assert np.abs(l0).min() > 2e3
    assert np.abs(model.s.axes[[OMEGA, OMEGA + 2]] - [3.0, 2.0]).min() > 0.05
    assert np.abs(p1 - p0).max() < 1e-9
    assert np.abs(l1 - l0).max() < 1e-9
    assert abs(e1 - e0) < 1e-8
    without = [totals(model, 1.0 - 1e-8), totals(model, 1.0)]
    assert np.abs(without[0][1] - without[1][1]).max() > 1e-9
    assert abs(without[0][2] - without[1][2]) > 1e-8
    R = model.s.axes[:ORIGIN].reshape(3, 3)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)


def test_orders_of_the_integrators_in_a_tumble():
    """In a tumble the explicit integrator has order 4, the implicit ones order 2, with one limit."""
    truth = tumbling(2.5e-5)[0].pins()
    for integrator, order, largest in ((EXPLICIT, 4, 1e-10), (IMPLICIT, 2, 3e-7), ("hht", 2, 4e-7)):
        errors = [np.abs(tumbling(step, integrator)[0].pins() - truth).max() for step in (5e-4, 2.5e-4)]
        assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)
        assert errors[1] < largest
    stiffer = tumbling(2.5e-4, **{"material.youngs_modulus": 2.04e6})[0]
    assert np.abs(stiffer.pins() - truth).max() > 1e-4


def test_the_origin_goes_where_it_will():
    still, shaken_by_wheels = (tumbling(2.5e-4, shake=shake)[0] for shake in (0.0, 2.0))
    assert np.abs(shaken_by_wheels.s.axes[ORIGIN : ORIGIN + 3]).min() > 1e-3
    np.testing.assert_allclose(shaken_by_wheels.pins(), still.pins(), atol=2e-10)


@pytest.mark.study
def test_free_axes_and_fixed_ones_are_the_same_straight_on():
    """Free and fixed axes agree straight on, on wheels that roll and rise; 1 % more speed shows."""
    runs = []
    for axes, speed in (("fixed", 0.5), ("free", 0.5), ("free", 0.505)):
        soft = {"integrator": EXPLICIT, "material.youngs_modulus": 2e9, "step": 1e-5}
        model = flexible_track.carrier(axes=axes, **soft)
        u = flexible_track.at_rest(model)
        for k, wheel in enumerate(model.wheel_list):
            u[13 * k + 7 : 13 * k + 10] = speed, 0.0, -0.3
            u[13 * k + 11] = 3.0 if wheel["kind"] == "teeth" else 1.0
        for k in range(5):
            model.step(k * 2e-3, 2e-3, u)
        runs.append((model.pins(), model.s.mean.copy()))
    assert model.s.axes[ORIGIN] > 1e-3
    for shown, rounding in ((0, 1e-12), (1, 1e-6)):
        assert np.abs(runs[1][shown] - runs[0][shown]).max() < rounding
        assert np.abs(runs[2][shown] - runs[0][shown]).max() > 1e3 * rounding
