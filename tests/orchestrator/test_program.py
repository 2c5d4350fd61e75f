"""A step in machine code: what it calls in which order, hands over and says of failures, and in which thread."""

from __future__ import annotations

import threading
from ctypes import CFUNCTYPE, POINTER, c_double, c_int, c_size_t, c_void_p, cast
from threading import get_ident
from time import monotonic, sleep

import numpy as np
import pytest

from orchestrator.cosim.component import ComponentFailed
from orchestrator.cosim.coupling import scheme
from orchestrator.cosim.machine import ASKED, ASLEEP, FREE, KNOWN, Board, laid_out, machine
from orchestrator.cosim.program import Helper, Move, Program, Stage, spare_processors
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.log.wire import RULES, handed_over
from orchestrator.scene.scene import load

EXCHANGE = CFUNCTYPE(c_int, c_void_p, c_void_p, c_size_t, POINTER(c_double))
STEP = CFUNCTYPE(c_int, c_void_p, c_double, c_double, c_int)
pytestmark = pytest.mark.skipif(not KNOWN, reason="no machine code for this system")


class Instance:
    """An FMU that notes what it is called with; ``statuses`` are what its functions return.

    It shows twice what it was given, and how often it has stepped.
    """

    def __init__(self, statuses=(0, 0, 0), inputs=3, pause=0.0):
        self.called, self.u, self.y, self.steps = [], np.zeros(inputs), np.zeros(inputs + 1), 0
        self.given, self.time, self.barrier = np.zeros(inputs), None, None

        def write(*given):
            self.called.append(("write", *given[:3]))
            self.given = self.u.copy()
            return statuses[0]

        def step(*given):
            self.called.append(("step", *given))
            self.thread = get_ident()
            if self.barrier is not None:
                self.barrier.wait(timeout=5.0)
            sleep(pause)
            self.steps += 1
            return statuses[1]

        def read(*given):
            self.called.append(("read", *given[:3]))
            self.y[:] = [*(2.0 * self.given), self.steps]
            return statuses[2]

        self._functions = EXCHANGE(write), STEP(step), EXCHANGE(read)
        at = [cast(each, c_void_p).value for each in self._functions]
        inputs = at[0], 22, len(self.u), self.u.ctypes.data
        self.board = laid_out(Board(11, *inputs, at[1], at[2], 44, len(self.y), self.y.ctypes.data, 0.0, 0.0, 1))

    def begin(self, t):
        self.time = t

    def failure(self):
        words = Board(*self.board)
        return ComponentFailed(f"{words.failed}") if words.failed else None

    def told(self, name):
        words = self.board.view(np.float64) if name in ("seconds", "spent") else self.board
        return words[Board._fields.index(name)]


def program_of(*stages, threads=True):
    return Program([Stage(components, moves) for components, moves in stages], threads)


def test_a_step_is_what_fmi_prescribes():
    one = Instance()
    program = program_of(([one], []))
    for k in range(3):
        one.board[Board._fields.index("kept")] = k == 1
        program.run(0.1 * k, 1e-3)
        assert one.called == [("write", 11, 22, 3), ("step", 11, 0.1 * k, 1e-3, k == 1), ("read", 11, 44, 4)]
        assert one.time == 0.1 * k
        one.called.clear()
    assert one.told("spent") > one.told("seconds") > 0.0


def test_without_inputs_nothing_is_written():
    one = Instance(inputs=0)
    program_of(([one], [])).run(0.0, 1.0)
    assert [call[0] for call in one.called] == ["step", "read"]


@pytest.mark.parametrize(("statuses", "failed", "done"), [
    ((3, 0, 0), "set_real", 1), ((0, 2, 0), "do_step", 2), ((1, 1, 4), "get_real", 3),
])  # fmt: skip
def test_what_failed_is_named_and_ends_the_step(statuses, failed, done):
    bad, after = Instance(statuses), Instance()
    program = program_of(([bad], []), ([after], []))
    with pytest.raises(ComponentFailed):
        program.run(0.0, 1.0)
    assert (Board._fields[bad.told("failed")], bad.told("status")) == (failed, max(statuses))
    assert (len(bad.called), after.called) == (done, [])
    machine().do(after.board.ctypes.data)
    assert after.told("failed") == 0


def test_values_are_handed_over_by_their_rules():
    """At the start, at the end and in the middle of the step; the same as what the log makes of them."""
    chance = np.random.default_rng(3)
    first, second = Instance(inputs=4), Instance(inputs=5)
    first.y[:], second.y[:] = chance.normal(size=5), chance.normal(size=6)
    at = {rule: np.array(places) for rule, places in zip(RULES, ([3, 0], [1], [4, 2]), strict=True)}
    moves = [Move(second.u, places, first.y, places[::-1] % 5, rule) for rule, places in at.items()]
    back = [Move(first.u, np.arange(4), second.y, np.array([5, 1, 2, 0]), "start")]
    program = program_of(([first], back), ([second], moves))
    for k in range(4):
        before = first.y.copy(), second.y.copy()
        program.run(float(k), 1.0)
        assert np.array_equal(first.given, before[1][[5, 1, 2, 0]])
        for rule, places in at.items():
            of = places[::-1] % 5
            assert second.given[places].tobytes() == handed_over(rule, before[0][of], first.y[of]).tobytes()


@pytest.mark.skipif(not spare_processors(), reason="needs a second processor")
@pytest.mark.parametrize("failing", [None, 0, 1])
def test_a_stage_steps_at_once_and_every_failure_is_heard(failing):
    pair = [Instance((0, 3 * (k == failing), 0), pause=1e-3) for k in range(2)]
    pair[0].barrier = pair[1].barrier = threading.Barrier(2)
    program = program_of((pair, []))
    for k in range(3):
        if failing is None:
            program.run(0.1 * k, 0.1)
            continue
        with pytest.raises(ComponentFailed):
            program.run(0.1 * k, 0.1)
        assert [bool(one.told("failed")) for one in pair] == [failing == 0, failing == 1]
    assert pair[0].thread != pair[1].thread == get_ident()
    program.close()


def test_short_steps_are_done_here():
    """What is over before a thread would have begun, or where there is none."""
    for threads in (True, False):
        pair = [Instance(), Instance()]
        program = program_of((pair, []), threads=threads)
        for one in pair:
            one.board.view(np.float64)[Board._fields.index("seconds")] = 1e-6
        program.run(0.0, 1.0)
        assert {one.thread for one in pair} == {get_ident()}
        program.close()


@pytest.fixture
def helper():
    made = Helper()
    yield made
    made.close()


def until(true, most=10.0):
    end = monotonic() + most
    while not true():
        assert monotonic() < end
        sleep(1e-3)


def test_it_sleeps_without_an_errand_and_wakes_with_the_next(helper):
    one = Instance()
    for _ in range(3):
        until(lambda: helper.desk[0] == ASLEEP)
        helper.desk[1] = one.board.ctypes.data
        machine().turn(helper.desk.ctypes.data, ASKED)
        until(lambda: helper.desk[0] in (FREE, ASLEEP))
        assert one.thread != get_ident()
    assert len(one.called) == 9


def test_what_the_thread_has_not_begun_is_done_by_who_waits(helper):
    one = Instance()
    until(lambda: helper.desk[0] == ASLEEP)
    helper.desk[:] = ASKED, one.board.ctypes.data  # it is asked, but not woken
    machine().join(helper.desk.ctypes.data)
    assert one.thread == get_ident()
    assert helper.desk[0] == FREE
    helper.desk[0] = ASLEEP


def test_the_time_is_that_of_the_calls():
    slow = Instance(pause=0.02)
    program_of(([slow], [])).run(0.0, 1.0)
    assert 0.02 <= slow.told("seconds") < 1.0


@pytest.mark.parametrize("coupling", ["tracks_first", "jacobi", "iterative"])
def test_python_does_the_same_where_there_is_no_machine_code(tmp_path, monkeypatch, coupling):
    settings = ("run.stop=0.03", "expect={}", "drive.ramp_start=0", f"run.coupling={coupling}")
    digests = []
    for known in (True, False):
        monkeypatch.setattr(scheme, "KNOWN", known)
        assert simulate(load("rig", "rigid", settings), tmp_path / f"{known}.mcap")["status"] == "ok"
        with Log(tmp_path / f"{known}.mcap") as log:
            digests.append(log.digest())
    assert digests[0] == digests[1]
