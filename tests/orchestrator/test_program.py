"""A step by kernels: order of calls, transfer of values, failures, and threads."""

from __future__ import annotations

import threading
from contextlib import nullcontext
from ctypes import CFUNCTYPE, POINTER, c_double, c_int, c_size_t, c_void_p, cast
from threading import get_ident
from time import monotonic, sleep

import numpy as np
import pytest
from logged import logged

from orchestrator.cosim.coupling import scheme
from orchestrator.cosim.program import InputCopy, Program, Stage, Worker, processors
from orchestrator.cosim.row_writer import RowWriter
from orchestrator.execution.simulate import simulate
from orchestrator.files.messages import RUN, silent
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.kernels.compiled import CAN_STEP, kernels
from orchestrator.kernels.tables import ASLEEP, FREE, SUBMITTED, StepCall, record
from orchestrator.log.page import HEAD, Block
from orchestrator.log.reader import Log
from orchestrator.log.time_series import RULES, wired_inputs
from orchestrator.scene.scene import load

EXCHANGE = CFUNCTYPE(c_int, c_void_p, c_void_p, c_size_t, POINTER(c_double))
STEP = CFUNCTYPE(c_int, c_void_p, c_double, c_double, c_int)
pytestmark = pytest.mark.skipif(not CAN_STEP, reason="no kernels for this system")


class Instance:
    """An FMU that records its calls; ``statuses`` are the return values of its functions.

    Its outputs are twice its inputs, and the number of its steps.
    """

    def __init__(self, statuses=(0, 0, 0), inputs=3, pause=0.0):
        self.called, self.u, self.y, self.steps = [], np.zeros(inputs), np.zeros(inputs + 1), 0
        self.given, self.time, self.barrier, self.is_remote = np.zeros(inputs), None, None, False

        def write(*given):
            self.called.append(("write", *given[:3]))
            self.given = self.u.copy()
            return statuses[0]

        def step(*given):
            self.called.append(("step", *given))
            self.thread = get_ident()
            RUN.warning("steps")
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
        call = StepCall(11, *inputs, at[1], at[2], 44, len(self.y), self.y.ctypes.data, 0.0, 0.0, 0.0, 1)
        self.step_call = record(call)

    def prepare_step(self, t):
        self.time = t

    def failure(self):
        return ComponentFailed(f"{self.noted('failed')}") if self.noted("failed") else None

    def noted(self, name):
        return self.step_call[name][0]


def program_of(*stages, threads=True):
    return Program([Stage(components, moves) for components, moves in stages], threads)


def test_a_step_is_what_fmi_prescribes():
    one = Instance()
    program = program_of(([one], []))
    for k in range(3):
        one.step_call["no_rollback"] = k == 1
        program.run(0.1 * k, 1e-3)
        assert one.called == [("write", 11, 22, 3), ("step", 11, 0.1 * k, 1e-3, k == 1), ("read", 11, 44, 4)]
        assert one.time == 0.1 * k
        one.called.clear()
    assert one.noted("total") > one.noted("seconds") > 0.0
    slow_without_inputs = Instance(inputs=0, pause=0.02)
    program_of(([slow_without_inputs], [])).run(0.0, 1.0)
    assert [call[0] for call in slow_without_inputs.called] == ["step", "read"], "nothing is written"
    assert 0.02 <= slow_without_inputs.noted("seconds") < 1.0, "the time is that of the calls"


@pytest.mark.parametrize(("statuses", "failed", "done"), [
    ((3, 0, 0), "set_real", 1), ((0, 2, 0), "do_step", 2), ((1, 1, 4), "get_real", 3),
])  # fmt: skip
def test_what_failed_is_named_and_ends_the_step(statuses, failed, done):
    bad, after = Instance(statuses), Instance()
    program = program_of(([bad], []), ([after], []))
    with pytest.raises(ComponentFailed):
        program.run(0.0, 1.0)
    assert (StepCall._fields[bad.noted("failed")], bad.noted("status")) == (failed, max(statuses))
    assert (len(bad.called), after.called) == (done, [])
    assert after.noted("failed") == 0


def test_values_are_handed_over_by_their_rules():
    """Values are transferred by their rules (start, end, middle of the step), as the log computes them."""
    chance = np.random.default_rng(3)
    first, second = Instance(inputs=4), Instance(inputs=5)
    first.y[:], second.y[:] = chance.normal(size=5), chance.normal(size=6)
    at = {rule: np.array(places) for rule, places in zip(RULES, ([3, 0], [1], [4, 2]), strict=True)}
    moves = [InputCopy(second.u, places, first.y, places[::-1] % 5, rule) for rule, places in at.items()]
    back = [InputCopy(first.u, np.arange(4), second.y, np.array([5, 1, 2, 0]), "start")]
    program = program_of(([first], back), ([second], moves))
    for k in range(4):
        before = first.y.copy(), second.y.copy()
        program.run(float(k), 1.0)
        assert np.array_equal(first.given, before[1][[5, 1, 2, 0]])
        for rule, places in at.items():
            of = places[::-1] % 5
            assert second.given[places].tobytes() == wired_inputs(rule, before[0][of], first.y[of]).tobytes()


@pytest.fixture
def made(monkeypatch):
    """Workers in the order in which a program makes them."""
    workers = []
    monkeypatch.setattr("orchestrator.cosim.program.Worker", lambda: workers.append(Worker()) or workers[-1])
    return workers


@pytest.mark.parametrize(("n", "expected"), [(1, 0), (2, 1), (3, 2), (400, 2)])
def test_threads_are_as_many_as_processors(monkeypatch, made, n, expected):
    monkeypatch.setattr("os.sched_getaffinity", lambda process: {0, 3, 4})
    program = program_of(([Instance() for _ in range(n)], []))
    assert len(made) == expected
    program.close()


@pytest.mark.skipif(processors() < 2, reason="needs a second processor")
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
        assert [bool(one.noted("failed")) for one in pair] == [failing == 0, failing == 1]
    assert pair[0].thread != pair[1].thread == get_ident()
    program.close()


@pytest.mark.skipif(processors() < 2, reason="needs a second processor")
@pytest.mark.parametrize(("scope", "count"), [(silent, 0), (nullcontext, 2)])
def test_a_silent_run_is_so_in_all_its_threads(scope, count):
    pair = [Instance(), Instance()]
    pair[0].barrier = pair[1].barrier = threading.Barrier(2)
    with scope(), logged() as said:
        program = program_of((pair, []))
        program.run(0.0, 0.1)
        program.close()
    assert said == ["steps"] * count


def test_short_steps_are_done_here():
    """Steps that end before a thread would start run in the calling thread, as do steps without threads."""
    for threads in (True, False):
        pair = [Instance(), Instance()]
        program = program_of((pair, []), threads=threads)
        for one in pair:
            one.step_call["seconds"] = 1e-6
        program.run(0.0, 1.0)
        assert {one.thread for one in pair} == {get_ident()}
        program.close()


def until(true, most=60.0):
    end = monotonic() + most
    while not true():
        assert monotonic() < end
        sleep(1e-3)


def test_a_worker_sleeps_without_a_task_and_wakes_with_the_next():
    one, worker = Instance(), Worker()
    for _ in range(3):
        until(lambda: worker.mailbox["state"] == ASLEEP)
        worker.mailbox["task"] = one.step_call.ctypes.data
        kernels().set_state(worker.address, SUBMITTED)
        until(lambda: worker.mailbox["state"] in (FREE, ASLEEP))
        assert one.thread != get_ident()
    assert len(one.called) == 9
    worker.close()


@pytest.mark.skipif(processors() < 2, reason="needs a second processor")
def test_a_task_that_no_worker_begins_is_done_by_who_waits(made):
    """A task that no worker begins is done by the thread that waits; here the worker has ended."""
    pair = [Instance(), Instance()]
    program = program_of((pair, []))
    (worker,) = made
    worker.close()
    worker.mailbox["state"] = FREE
    program.run(0.0, 1.0)
    assert [one.thread for one in pair] == [get_ident()] * 2
    assert worker.mailbox["state"] == FREE
    program.close()


class Linked(Instance):
    """An instance whose link outputs count their reads; its step ``failing`` fails."""

    def __init__(self, failing=0):
        super().__init__()
        self.name, self.links, self.y_links, self.reads = f"{id(self)}", ("a", "b"), np.zeros(2), 0
        _, step, read = self._functions

        def shown(instance, references, n, values):
            if references != 55:
                return read(instance, references, n, values)
            self.reads += 1
            self.y_links[:] = self.reads, -self.reads
            return 0

        def stepped(*given):
            return 3 if self.steps + 1 == failing else step(*given)

        self._more = EXCHANGE(shown), STEP(stepped)
        for name, function in zip(("get_real", "do_step"), self._more, strict=True):
            self.step_call[name] = cast(function, c_void_p).value

    def read_links_when(self, due):
        for name, word in {"n_links": 2, "links": 55, "y_links": self.y_links.ctypes.data, "links_due": due}.items():
            self.step_call[name] = word


class Sheet:
    """A buffer of rows without topics; two rows are there before."""

    def __init__(self, width):
        self.block = Block(np.zeros((10, HEAD + width)), count=2)
        self.free_rows = 8

    def added(self, n):
        """Sequence numbers, times, step lengths and values of the n rows after them."""
        rows, block = slice(2, 2 + n), self.block
        return block.sequence[rows].tolist(), block.t[rows].tolist(), {*block.h[rows].tolist()}, block.values[rows]


def marched(n, failing=0):
    """March coupled pairs by many steps at once and by single steps; return both records."""
    pairs = [[Linked(failing), Linked()] for _ in range(2)]
    programs = []
    for one, other in pairs:
        one.y[:], other.y[:] = range(4), range(4, 8)
        there, back = (
            [InputCopy(a.u, np.arange(3), b.y, np.arange(1, 4), "start")] for a, b in ((one, other), (other, one))
        )
        programs.append(program_of(([one], there), ([other], back)))
    sheets = [Sheet(sum(len(one.u) + len(one.y) for one in pairs[0])), Sheet(4)]
    lent = []
    tape = RowWriter(pairs[0], 3, sheets, lambda: lent.append(True))
    rows = []
    for k in range(4, 4 + n):
        try:
            programs[1].run(k * 0.1, 0.1)
        except ComponentFailed:
            break
        rows.append(np.concatenate([a for which in ("u", "y") for a in (getattr(one, which) for one in pairs[1])]))
    done = programs[0].step_batch(tape, 4, n, 0.1)
    assert (lent, tape.free_rows) == ([True], 8)
    return pairs[0], done, tape, sheets, np.array(rows)


def test_many_steps_at_once_are_the_steps_one_by_one():
    pair, done, tape, (steps_page, links_page), rows = marched(5)
    steps = [call for call in pair[0].called if call[0] == "step"]
    assert steps == [("step", 11, k * 0.1, 0.1, 1) for k in range(4, 9)]
    taken = tape.pop_counts()
    assert (done, taken.steps, taken.links) == (5, 5, 2)
    numbers, times, lengths, values = steps_page.added(5)
    assert (numbers, times, lengths) == ([5, 6, 7, 8, 9], [k * 0.1 for k in range(5, 10)], {0.1})
    assert values.tobytes() == rows.tobytes()
    assert len(np.unique(rows[:, -1])) == 5, "outputs do not change"
    numbers, times, links = tape.link_rows(taken)
    assert (numbers, times) == ([6, 9], [6 * 0.1, 9 * 0.1])
    assert links.tolist() == [[1.0, -1.0, 1.0, -1.0], [2.0, -2.0, 2.0, -2.0]]
    assert not any(page.block.table[:2].any() for page in (steps_page, links_page)), "earlier rows were overwritten"
    assert np.array_equal(tape.outputs(3)[pair[1].name], rows[3, -4:])
    assert tape.pop_counts() is None


@pytest.mark.parametrize("failing", [1, 4])
def test_of_many_steps_those_before_a_failure_are_kept(failing):
    pair, done, tape, (steps_page, _), rows = marched(6, failing)
    taken = tape.pop_counts()
    assert (done, taken.steps) == (failing - 1, failing - 1)
    assert steps_page.added(taken.steps)[-1].tobytes() == rows.tobytes()
    assert (pair[0].noted("failed"), pair[1].steps) == (StepCall._fields.index("do_step"), failing - 1)


@pytest.mark.long
def test_python_does_the_same_where_there_are_no_kernels(tmp_path, monkeypatch):
    """Of the couplings the one that repeats steps; FMUs of the user have all others."""
    settings = ("run.stop=0.03", "expect={}", "drive.ramp_start=0", "run.coupling=iterative")
    digests = set()
    for known, together in ((True, 0.05), (True, 0.0), (False, 0.0)):
        monkeypatch.setattr(scheme, "CAN_STEP", known)
        monkeypatch.setattr(scheme, "LONGEST_BATCH", together)  # many steps at once, or one by one
        path = tmp_path / f"{known}{together}.mcap"
        assert simulate(load("rig", "rigid", settings), path)["status"] == "ok"
        with Log(path) as log:
            digests.add(log.digest())
    assert len(digests) == 1
