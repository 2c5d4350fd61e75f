"""Joint coordinates of rigid chains against textbook cases, dense matrices, augmented formulation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from fmus.kernels.jit import plain
from fmus.physics.chain.explicit import march, slopes
from fmus.physics.chain.integration import HELD, LOOP, CommunicationStep, Environment
from fmus.physics.chain.layout import regular_polygon
from fmus.physics.chain.rigid import jointed
from fmus.physics.chain.rigid.dynamics import accelerations
from fmus.physics.chain.rigid.jointed import count, to_joint_coordinates, to_poses
from fmus.physics.chain.rigid.links import RigidLinks, place
from fmus.physics.chain.rigid.state import State, shapes, work
from fmus.physics.chain.state import size, views
from fmus.physics.rigid import pin, recursive
from fmus.physics.rigid.augmented import PIN, ClosingSpring, Ends
from tests.validation.rods import MASS, G, P, Rods, of_angles

pytestmark = pytest.mark.long  # kernels of their own

ROD = (0.25, MASS * P**2 / 12.0, MASS * P**2 / 12.0)
BODY = (0.04, 0.22, 0.25)  # all different: lateral motion couples with motion in the plane
HANGS = Ends(False, True, False)
FLOATS = Ends(False, False, False)
LOOPED = Ends(True, False, False)
BETWEEN = Ends(False, True, True)


class Chain(Rods):
    """Links on the pins (nodes, 2) in joint coordinates, to be evaluated in both formulations."""

    def __init__(self, pins, ends, inertia=BODY, spring=PIN):
        n = len(pins) if ends.closed else len(pins) - 1
        self.links = RigidLinks(0.5 * P, 0.029, 0.1, MASS, np.array(inertia, float), ends, spring)
        self.env = Environment((0.0, 0.0, -G), HELD if ends.first else LOOP, np.zeros((2, 3)), 0.0, -1)
        joints = count(n, ends.first)
        sizes = shapes(n, ends.closed, 0, joints=joints)
        self.s, self.w = views(State, sizes, np.zeros(size(sizes))), work(n, ends.closed, 0, joints=joints)
        self.report, self.counters = np.zeros(18), np.zeros(4, np.int64)
        place(self.links, np.asarray(pins, float), self.s, self.w)
        to_joint_coordinates(self.links, self.s)
        to_poses(self.links, self.s, self.w)
        self.n, self.speeds = n, joints // 2 if ends.first else n + 5

    def moving(self, rng, speed=3.0):
        """Set random rates; a floating chain also gets a random place and attitude."""
        x = self.s.joints
        x[-self.speeds :] = speed * rng.normal(size=self.speeds)
        if not self.links.ends.first:
            x[:3] = rng.normal(size=3)
            turned = Rotation.from_rotvec(rng.normal(size=3)).as_quat()
            x[3:7] = turned[[3, 0, 1, 2]]
        to_poses(self.links, self.s, self.w)
        return self

    def recursive(self):
        """Accelerations (n, 6) and multipliers (p, 3)."""
        assert jointed.accelerations(self.links, None, self.env, self.s, self.w) == -1
        return self.s.vdot.copy(), self.s.lam[:, :3].copy()

    def augmented(self):
        assert accelerations(self.links, None, self.env, self.s, self.w) == -1
        return self.s.vdot.copy(), self.s.lam[:, :3].copy()

    def jacobian(self):
        """Jacobian of the links' velocities (6 n) by those of the joints."""
        x, columns = self.s.joints, []
        before = x.copy()
        for k in range(self.speeds):
            x[-self.speeds :] = 0.0
            x[len(x) - self.speeds + k] = 1.0
            to_poses(self.links, self.s, self.w)
            columns.append(self.s.v.ravel().copy())
        x[:] = before
        to_poses(self.links, self.s, self.w)
        return np.stack(columns, axis=1)

    def run(self, time, h):
        parts = (
            jointed.JointedLinks(self.links),
            None,
            self.env,
            slopes(self.s),
            CommunicationStep(np.zeros((0, 15)), time, h),
        )
        assert not march(*parts, self.s, self.w, self.report, self.counters)[0]
        return self

    def momenta(self):
        """Linear and angular momentum about the origin (6)."""
        return np.concatenate([MASS * self.s.v[:, :3].sum(0), self.angular_momentum()])


def loop(n, spring=PIN, seed=4, speed=2.0):
    """A regular polygon in a motion that its pins allow, turning about all axes."""
    chain = Chain(regular_polygon(P, n), LOOPED, spring=spring)
    s, rng = chain.s, np.random.default_rng(seed)
    chain.moving(rng, 0.0)
    s.joints[-chain.speeds : len(s.joints) - chain.speeds + 6] = speed * rng.normal(size=6)
    sway = np.linalg.svd(closing(chain))[2][2:]  # rates that leave the gap constant
    s.joints[len(s.joints) - chain.speeds :] += speed * sway.T @ rng.normal(size=len(sway)) / np.sqrt(n)
    to_poses(chain.links, s, chain.w)
    return chain


def closing(chain):
    """Dense matrix (5, speeds) of the closing pin's equations by the rates of the joints."""
    A, n = chain.w.system.rotation, chain.n
    B = np.zeros((5, 6 * n))
    pin.jacobian(chain.links.half, A[n - 1], A[0], B[:, 6 * n - 6 :], B[:, :6])
    return B @ chain.jacobian()


def test_released_chain_of_thin_rods():
    """The tip of 64 rods released from the horizontal is at 9.413161 m after 0.5 s."""
    chain = Chain(of_angles(np.zeros(64)), HANGS, ROD).run(0.5, 1e-4)
    assert abs(chain.pins()[-1, 0] - 9.413161) < 5e-7
    assert abs(chain.energy()) < 1e-9
    heavy = Chain(of_angles(np.zeros(64)), HANGS, (0.25, 1.05 * ROD[1], ROD[2])).run(0.5, 1e-4)
    assert abs(heavy.pins()[-1, 0] - 9.413161) > 1e-6


def pendulum(J):
    """Lagrange's equations of three equal links in a plane, inertia ``J``, by their angles over x."""
    c, links = 0.5 * P, np.arange(3)
    # a joint moves the centre of its own link at c, those of all later links at P
    M = np.array(
        [
            [MASS * sum((P if k > i else c) * (P if k > j else c) for k in links if k >= max(i, j)) for j in links]
            for i in links
        ]
    )
    lever = MASS * np.array([c + P * (2 - i) for i in links])

    def rates(_, y):
        angle, rate = y[:3], y[3:]
        between = angle[:, None] - angle
        mass = M * np.cos(between) + J * np.eye(3)
        return np.concatenate(
            [rate, np.linalg.solve(mass, -(M * np.sin(between)) @ rate**2 - G * lever * np.cos(angle))]
        )

    return rates


def test_three_links_by_lagrange():
    angles = np.array([-0.4, 0.3, 0.9])
    chain = Chain(of_angles(angles), HANGS).run(1.0, 1e-4)

    def directions(J):
        end = solve_ivp(pendulum(J), (0.0, 1.0), [*angles, 0, 0, 0], method="DOP853", rtol=1e-13, atol=1e-13).y[:3, -1]
        return np.column_stack([np.cos(end), np.sin(end)])

    along = chain.w.system.rotation[:, [0, 2], 0]
    assert np.abs(along - directions(BODY[1])).max() < 1e-9
    assert np.abs(along - directions(1.01 * BODY[1])).max() > 1e-3


@pytest.mark.parametrize("ends", [HANGS, FLOATS])
def test_dense_mass_matrix_of_five_links(ends):
    """The dense mass matrix gives M(q) q'' = Q at rest in any shape, to rounding."""
    rng = np.random.default_rng(1)
    chain = Chain(of_angles(rng.uniform(-2.0, 2.0, 5)), ends).moving(rng, 0.0)
    J = chain.jacobian()
    mass = np.tile(np.concatenate([np.full(3, MASS), chain.links.inertia]), 5)
    weight = np.zeros((5, 6))
    weight[:, 2] = -MASS * G
    weight[3, 3:] = 0.0
    chain.env = chain.env._replace(gravity=(0.0, 0.0, -G), pull=np.array([[0.0, 0, 0], [50.0, 20.0, -30.0]]))
    A = chain.w.system.rotation[4]
    weight[4, :3] += chain.env.pull[1]
    weight[4, 3:] += np.cross([0.5 * P, 0, 0], A.T @ chain.env.pull[1])
    if not ends.first:
        assert not chain.env.pull[0].any()
    vdot, _ = chain.recursive()
    dense = J @ np.linalg.solve(J.T @ (mass[:, None] * J), J.T @ weight.ravel())
    assert np.abs(vdot.ravel() - dense).max() < 1e-12 * np.abs(dense).max()
    mass[12:15] *= 1.01
    off = J @ np.linalg.solve(J.T @ (mass[:, None] * J), J.T @ weight.ravel())
    assert np.abs(vdot.ravel() - off).max() > 1e-4 * np.abs(off).max()


ARC = of_angles(np.array([-0.9, -0.5, -0.1, 0.3, 0.5, 0.8]))


def bent(ends, seed=2):
    rng = np.random.default_rng(seed)
    return Chain(of_angles(rng.uniform(-2.0, 2.0, 12)), ends).moving(rng)


@pytest.mark.parametrize(
    ("make", "tolerance"),
    [
        pytest.param(lambda: bent(HANGS), 1e-11, id="hangs"),
        pytest.param(lambda: bent(FLOATS), 1e-11, id="floats"),
        pytest.param(lambda: loop(12), 1e-10, id="loop"),
        # the spring turns rounding of its gap into force
        pytest.param(lambda: loop(12, ClosingSpring(1e9, 1e4)), 1e-10, id="loop closed by a spring"),
        pytest.param(lambda: Chain(ARC, BETWEEN), 1e-12, id="between two pins"),
    ],
)
def test_accelerations_and_forces_are_those_of_the_augmented_formulation(make, tolerance):
    chain = make()
    (vdot, force), (expected, pull) = chain.recursive(), chain.augmented()
    assert np.abs(vdot - expected).max() < tolerance * np.abs(expected).max()
    assert np.abs(force - pull).max() < tolerance * np.abs(pull).max()
    chain.s.joints[-chain.speeds :] = 1.01 * chain.s.joints[-chain.speeds :] + 0.01
    to_poses(chain.links, chain.s, chain.w)
    assert np.abs(chain.recursive()[0] - expected).max() > 1e-4 * np.abs(expected).max()


def test_chain_between_two_pins_keeps_its_energy():
    chain = Chain(ARC, BETWEEN)
    energy = chain.energy()
    chain.run(0.5, 1e-4)
    assert np.abs(chain.pins()[-1] - [ARC[-1, 0], 0.0, ARC[-1, 1]]).max() < 1e-11
    assert abs(chain.energy() - energy) < 1e-9


def test_closing_pin_has_five_equations_of_rank_two():
    """The closing pin has five equations of rank two in joint coordinates.

    Its mobility B M^-1 B^T has the two equations of the solver, in the plane of link 0.
    """
    chain = loop(12)
    A = chain.w.system.rotation
    B = closing(chain)
    values = np.linalg.svd(B, compute_uv=False)
    assert values[1] > 0.1
    assert values[2] < 1e-14
    J = chain.jacobian()
    mass = np.tile(np.concatenate([np.full(3, MASS), chain.links.inertia]), chain.n)
    mobility = B @ np.linalg.solve(J.T @ (mass[:, None] * J), B.T)
    assert np.linalg.matrix_rank(mobility, tol=1e-12) == 2
    chain.recursive()
    plane = A[0][:, [0, 2]]
    assert np.abs(chain.w.articulated.mobility - plane.T @ mobility[:3, :3] @ plane).max() < 1e-12


def test_thrown_loop_keeps_momentum_and_energy():
    """A thrown loop keeps momentum and energy at order 4.

    Poses are not sums of increments here, so they do not hold to rounding as in the augmented formulation.
    """
    errors = []
    for h in (2e-3, 1e-3):
        chain = loop(8)
        chain.env = chain.env._replace(gravity=(0.0, 0.0, 0.0))
        before = np.array([*chain.momenta(), chain.energy()])
        chain.run(0.5, h)
        errors.append(np.abs(np.array([*chain.momenta(), chain.energy()]) - before))
        assert chain.w.articulated.mobility.any()
    orders = np.log2(errors[0] / errors[1])
    assert np.abs(orders - 4.0).max() < 0.3
    assert errors[1].max() < 1e-9


class Counted(np.ndarray):
    """Array that counts reads and writes."""

    touched = 0

    def __getitem__(self, k):
        Counted.touched += 1
        return super().__getitem__(k)

    def __setitem__(self, k, value):
        Counted.touched += 1
        super().__setitem__(k, value)


def test_cost_grows_with_the_number_of_links():
    """The cost grows with the number of links: a fixed number of entries is touched per link."""

    def touched(n):
        tree = recursive.ArticulatedBodies(*(part.view(Counted) for part in recursive.articulated_bodies(n)))
        rng = np.random.default_rng(n)
        angle = rng.uniform(-1.0, 1.0, n)
        tree.turn[:] = np.column_stack([np.cos(angle), np.sin(angle)])
        Counted.touched = 0
        assert plain(recursive.factor)(0.5 * P, MASS, np.array(BODY), True, tree) == -1
        plain(recursive.solve)(0.5 * P, True, True, tree, tree.load[0], tree.response[0])
        return Counted.touched

    counts = np.array([touched(n) for n in (8, 16, 24, 48)])
    assert counts[2] - counts[1] == counts[1] - counts[0] > 8 * 50
    assert counts[3] - counts[2] == 3 * (counts[1] - counts[0])
