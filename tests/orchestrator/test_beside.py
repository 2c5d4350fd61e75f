"""The thread beside: what it calls, in which order, what it says of failures, asleep or awake."""

from __future__ import annotations

from ctypes import CFUNCTYPE, c_double, c_int, c_size_t, c_void_p, cast
from threading import get_ident
from time import monotonic, sleep

import pytest

from orchestrator.cosim.beside import ASKED, ASLEEP, Beside, Errand

EXCHANGE = CFUNCTYPE(c_int, c_void_p, c_void_p, c_size_t, c_void_p)
STEP = CFUNCTYPE(c_int, c_void_p, c_double, c_double, c_int)


class Instance:
    """Functions of an FMU that note what they are called with; ``statuses`` are what they return."""

    def __init__(self, statuses=(0, 0, 0), inputs=3):
        self.called = []

        def exchange(name, status):
            return EXCHANGE(lambda *given: self.called.append((name, *given)) or status)

        write, read = exchange("write", statuses[0]), exchange("read", statuses[2])
        step = STEP(lambda *given: self.called.append(("step", *given)) or statuses[1])
        self._kept = write, step, read
        at = [cast(each, c_void_p).value for each in self._kept]
        self.errand = Errand(11, at[0], 22, inputs, 33, at[1], at[2], 44, 5, 55)


@pytest.fixture
def helper():
    made = Beside()
    yield made
    made.close()


def test_a_step_is_what_fmi_prescribes(helper):
    one = Instance()
    for k in range(3):
        helper.ask(one.errand, 0.1 * k, 1e-3, k == 1)
        assert helper.wait()[:2] == (0, 0)
        assert one.called == [("write", 11, 22, 3, 33), ("step", 11, 0.1 * k, 1e-3, k == 1), ("read", 11, 44, 5, 55)]
        one.called.clear()


def test_without_inputs_nothing_is_written(helper):
    one = Instance(inputs=0)
    helper.ask(one.errand, 0.0, 1.0, True)
    helper.wait()
    assert [call[0] for call in one.called] == ["step", "read"]


@pytest.mark.parametrize(("statuses", "failed", "done"), [
    ((3, 0, 0), "set_real", 1), ((0, 2, 0), "do_step", 2), ((1, 1, 4), "get_real", 3),
])  # fmt: skip
def test_what_failed_is_named_and_ends_the_step(helper, statuses, failed, done):
    one = Instance(statuses)
    helper.ask(one.errand, 0.0, 1.0, True)
    which, status, _ = helper.wait()
    assert (Errand._fields[which], status) == (failed, max(statuses))
    assert len(one.called) == done
    fine = Instance()
    helper.ask(fine.errand, 0.0, 1.0, True)
    assert helper.wait()[0] == 0, "a failure is not kept"


def test_it_sleeps_without_an_errand_and_wakes_with_the_next(helper):
    one = Instance()
    for _ in range(3):
        sleep(0.1)
        helper.ask(one.errand, 0.0, 1.0, True)
        helper.wait()
    assert len(one.called) == 9


def until(true, most=10.0):
    end = monotonic() + most
    while not true():
        assert monotonic() < end
        sleep(1e-3)


def test_what_the_thread_has_not_begun_is_done_by_who_waits(helper):
    one, where = Instance(), []
    here = STEP(lambda *given: where.append(get_ident()) or 0)
    errand = one.errand._replace(do_step=cast(here, c_void_p).value)
    until(lambda: helper._words[0] == ASLEEP)
    wake = helper._wake.release
    helper._wake.release = lambda: None  # it is asked, but does not run
    helper.ask(errand, 0.0, 1.0, True)
    helper.wait()
    helper._wake.release = wake
    wake()
    until(lambda: helper._words[0] == ASLEEP)
    helper.ask(errand, 0.0, 1.0, True)
    until(lambda: helper._words[0] != ASKED)
    helper.wait()
    assert where[0] == get_ident() != where[1]


def test_the_time_is_that_of_the_calls(helper):
    slow = Instance()
    slow_step = STEP(lambda *given: sleep(0.02) or 0)
    helper.ask(slow.errand._replace(do_step=cast(slow_step, c_void_p).value), 0.0, 1.0, True)
    assert 0.02 <= helper.wait().seconds < 1.0
