"""Random sequences of FMI calls, judged by a state machine of their own.

The rules here follow FMI 2.0.4, section 4.2.4, FMI 3.0.2, section 2.3, and `fmus/README.md`; they are written anew,
so that a mistake in `fmus/fmi/phases.py` shows. A sequence is repeated without the calls that were refused: its outputs
must be the same bits. Refusals have the status Error. In an FMU of pythonfmu, whose wrapper makes fmi2Fatal of every
exception, they are that, and a refused step is fmi2Discard. After each step, the last successful time must be where
the instance stands; of a step that was refused, pythonfmu says the time that was passed, and from then on that the
instance is terminated. A step of FMI 3.0 raises no flag.
"""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from tests.fuzz.driven import DISCARD, OK, Driven, Wrong, driven_instance

STEPS = (1e-9, 1e-7, 1e-5, 1e-4, 1e-3)  # s
NOT_STEPS = (0.0, -1e-3, math.nan, math.inf, 4.94e-324, 1e-310, 9e-10)
LONGEST_CALL = 2.0  # s of processor time
LONGEST_MESSAGE = 400  # characters


class Machine(NamedTuple):
    """State of an instance by the rules."""

    phase: str = "instantiated"  # then initialising, running, terminated
    now: float = math.nan
    start: float = math.nan
    stop: float = math.nan
    good_input: bool = True


class Call(NamedTuple):
    """A call: its name and argument, the statuses that the rules allow, and the state after OK."""

    name: str
    argument: Any
    allowed: tuple[int, ...]
    after: Machine


UNSUPPORTED = "EnterEventMode", "EnterStepMode", "EnterConfigurationMode", "EvaluateDiscreteStates"
STARTS, LENGTHS = (0.0, 0.25, -1.0, 1e3, math.nan), (math.nan, 0.01, -1.0)  # s, of an experiment


class Turn:
    """A turn to call an instance that is in the state ``m``: calls are drawn and judged by the rules."""

    def __init__(self, draw: random.Random, m: Machine, saved: list[Machine], driven: Driven) -> None:
        self.draw, self.m, self.saved, self.driven = draw, m, saved, driven
        self.readable = m.phase != "instantiated"
        self.output = draw.randrange(len(driven.outputs))

    def call(
        self, name: str, argument: Any = None, ok: bool = True, after: Machine | None = None, refused: int = 0
    ) -> Call:
        """A call that must succeed, then in the state ``after`` (``m``), or be refused and change nothing."""
        return Call(
            name, argument, (OK,) if ok else (refused or self.driven.refused,), after if after and ok else self.m
        )

    def next(self) -> Call:
        """Draw a call; often one that the instance waits for."""
        towards = {"instantiated": self.enter, "initialising": self.exit}.get(self.m.phase)
        if towards and self.draw.random() < 0.3:
            return towards()
        if not self.m.good_input and self.draw.random() < 0.5:
            return self.good_input()
        offers = [offer for offer in OFFERS if offer.to(self.driven)]
        return self.draw.choices(offers, [offer.share for offer in offers])[0].made(self)

    def experiment(self, name: str, start: float, length: float, after: Machine) -> Call:
        """A call that gives start and length of the experiment."""
        fine = self.m.phase == "instantiated" and math.isfinite(start) and not length < 0.0
        return self.call(
            name, (start, start + length), fine, after._replace(now=start, start=start, stop=start + length)
        )

    def setup(self) -> Call:
        return self.experiment("setup", self.draw.choice(STARTS), self.draw.choice(LENGTHS), self.m)

    def enter(self, start: float = 0.0, length: float = math.nan) -> Call:
        """Entry of initialisation, which in FMI 3.0 has the start and the length of the experiment."""
        after = self.m._replace(phase="initialising")
        if self.driven.fmi == 2:
            return self.call("enter", None, self.m.phase == "instantiated", after)
        return self.experiment("enter", start, length, after)

    def enter_at_odd_times(self) -> Call:
        return self.enter(self.draw.choice(STARTS), self.draw.choice(LENGTHS))

    def exit(self) -> Call:
        return self.call("exit", None, self.m.phase == "initialising", self.m._replace(phase="running"))

    def terminate(self) -> Call:
        return self.call("terminate", None, self.m.phase == "running", self.m._replace(phase="terminated"))

    def step(self) -> Call:
        draw, m = self.draw, self.m
        h = draw.choice(NOT_STEPS if draw.random() < 0.15 else STEPS)
        begin = m.now if math.isfinite(m.now) else draw.choice((0.0, 0.5))
        t = begin + (draw.choice((0.3, -0.2, 1e-6, math.nan)) if draw.random() < 0.15 else 0.0)
        shortest = 1e-9 * max(1.0, abs(t - m.start))
        slack = shortest + 1e-15 * abs(t)
        fine = m.phase == "running" and math.isfinite(t) and math.isfinite(h) and h >= shortest
        fine = fine and not abs(t - m.now) > slack and not t + h > m.stop + slack
        if fine and not m.good_input:
            return self.call("step", (t, h), False, refused=DISCARD)
        return self.call("step", (t, h), fine, m._replace(now=t + h), self.driven.refused_step)

    def long_step(self) -> Call:
        m = self.m
        t = m.now if math.isfinite(m.now) else 0.0
        fine = m.phase == "running" and not t + 1e6 > m.stop and m.good_input
        return Call("step", (t, 1e6), (OK, DISCARD), m._replace(now=t + 1e6)) if fine else self.step()

    def set_input(self) -> Call:
        place = self.draw.randrange(1, len(self.driven.inputs))
        return self.call("input", (place, self.driven.starts[place]), self.m.phase != "terminated")

    def first_input(self, value: float, good: bool) -> Call:
        return self.call("input", (0, value), self.m.phase != "terminated", self.m._replace(good_input=good))

    def bad_input(self) -> Call:
        return self.first_input(self.draw.choice((math.nan, math.inf)), False)

    def good_input(self) -> Call:
        return self.first_input(self.driven.starts[0], True)

    def parameter(self) -> Call:
        at = self.draw.randrange(len(self.driven.parameters))
        return self.call("parameter", at, self.m.phase in ("instantiated", "initialising"))

    def restore(self) -> Call:
        if not self.saved:
            return self.call("save")
        at = self.draw.randrange(len(self.saved))
        if self.draw.random() < 0.3:
            return self.call("restore flipped", (at, self.draw.random()), False)
        return self.call("restore", at, True, self.saved[at]._replace(start=self.m.start, stop=self.m.stop))


def _of_fmi(version: int) -> Callable[[Driven], bool]:
    return lambda driven: driven.fmi == version


def _of_several_inputs(driven: Driven) -> bool:
    return len(driven.inputs) > 1


class Offer(NamedTuple):
    """A call that may be drawn: its share, its making in a turn, and the instances that it is for."""

    share: float
    made: Callable[[Turn], Call]
    to: Callable[[Driven], bool] = lambda driven: True


OFFERS = (
    Offer(6.0, Turn.step),
    Offer(0.2, Turn.long_step),
    Offer(1.0, Turn.setup, _of_fmi(2)),
    Offer(1.0, Turn.enter_at_odd_times, _of_fmi(3)),
    Offer(0.5, Turn.enter),
    Offer(0.5, Turn.exit),
    Offer(0.3, Turn.terminate),
    Offer(0.3, lambda turn: turn.call("reset", None, True, Machine())),
    Offer(1.0, Turn.set_input, _of_several_inputs),
    Offer(0.5, Turn.bad_input, _of_several_inputs),
    Offer(1.0, Turn.parameter),
    Offer(0.5, lambda turn: turn.call("set output", turn.output, False)),
    Offer(1.0, lambda turn: turn.call("get", turn.output, turn.readable)),
    Offer(0.3, lambda turn: turn.call("get unknown", turn.draw.choice((10**6, 2**31 - 1)), False)),
    Offer(0.3, lambda turn: turn.call("get boolean", None, turn.readable or turn.driven.fmi == 3)),
    Offer(0.7, lambda turn: turn.call("save")),
    Offer(1.0, Turn.restore),
    Offer(0.5, lambda turn: turn.call("unsupported", turn.draw.choice(UNSUPPORTED), False), _of_fmi(3)),
    Offer(0.5, lambda turn: turn.call("get too few", turn.output, False), _of_fmi(3)),
)


def sequence(fmu: Path, seed: int, length: int = 40) -> list[Call]:
    """Make a random sequence of calls; the calls that were not refused. Raises Wrong."""
    draw, driven, machine = random.Random(seed), driven_instance(fmu), Machine()
    saved: list[Machine] = []
    done: list[Call] = []
    try:
        for _ in range(length):
            call = Turn(draw, machine, saved, driven).next()
            readable = machine.phase in ("running", "terminated")
            before = driven.shown() if readable else b""
            driven.messages.clear()
            began = time.process_time()
            status = driven.do(call.name, call.argument)
            _judge(call, status, machine, driven.messages, time.process_time() - began)
            if status == OK:
                machine = call.after
                done.append(call)
                if call.name == "save":
                    saved.append(machine)
            elif readable and driven.shown() != before:
                raise Wrong(f"{call.name} {call.argument} was refused and has changed outputs")
            if call.name == "step" and machine.phase == "running":
                _judge_ending(driven, call, status, machine)
        end = driven.shown() if machine.phase in ("running", "terminated") else b""
        _repeat(fmu, done, end)
    except Wrong as wrong:
        raise Wrong(f"{fmu.name}, seed {seed}: {wrong}") from None
    finally:
        driven.close()
    return done


def _judge(call: Call, status: int, machine: Machine, messages: list[str], seconds: float) -> None:
    where = f"{call.name} {call.argument} in {machine}"
    if status not in call.allowed:
        raise Wrong(f"{where} has status {status} instead of {call.allowed}: {messages}")
    if status != OK and not messages:
        raise Wrong(f"{where} has status {status} without a message")
    if long := [text for text in messages if len(text) > LONGEST_MESSAGE and not text.startswith("Fatal py")]:
        raise Wrong(f"{where}: a message of {len(long[0])} characters: {long[0]}")
    if seconds > LONGEST_CALL:
        raise Wrong(f"{where} took {seconds:.1f} s")


def _judge_ending(driven: Driven, call: Call, status: int, machine: Machine) -> None:
    """Check what the instance says of its last step."""
    refused = driven.python and status != OK
    expected = call.argument[0] if refused else machine.now
    t, terminated = driven.ended()
    may_be = refused or (driven.python and terminated)
    stands = abs(t - expected) <= 1e-9 * max(1.0, abs(t)) or math.isnan(expected)
    if terminated is not may_be or not stands:
        raise Wrong(f"after a step {call.argument} with status {status} in {machine}: {t} s, terminated: {terminated}")


def _repeat(fmu: Path, calls: list[Call], end: bytes) -> None:
    """Repeat the calls in a new instance: all must succeed and end in the same outputs, to the bit."""
    other = driven_instance(fmu)
    try:
        for call in calls:
            if other.do(call.name, call.argument) != OK:
                raise Wrong(f"{call.name} {call.argument} is refused without the refused calls before it")
        if end and other.shown() != end:
            raise Wrong("the outputs differ without the refused calls")
    finally:
        with suppress(Exception):
            other.close()
