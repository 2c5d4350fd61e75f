"""Check of saved states: restored, and carried into a second instance as bytes, they continue bit for bit."""

from __future__ import annotations

from ctypes import byref, c_char, c_size_t, create_string_buffer
from typing import Any

from fmpy.fmi2 import fmi2FMUstate

from orchestrator.fmu_check.instance import Instance, Subject
from orchestrator.fmu_check.verdict import NotApplicable, Verdict, listed

BEFORE, AFTER = 5, 10  # steps before and after the state is saved


def check(subject: Subject) -> Verdict:
    """Save a state, step on, restore it, step again; then the same in a second instance by the bytes of the state."""
    can = subject.description.coSimulation
    if not can.canGetAndSetFMUstate:
        raise NotApplicable("canGetAndSetFMUstate is not declared")
    faults = []
    with Instance(subject) as first:
        first.initialise()
        first.run(0, BEFORE)
        state = fmi2FMUstate()
        first.must("GetFMUstate", byref(state))
        expected = first.run(BEFORE, AFTER)
        for time in ("first", "second"):
            subject.begin(f"when a state was restored the {time} time")
            first.must("SetFMUstate", state)
            if names := subject.differing(expected, first.run(BEFORE, AFTER)):
                faults.append(f"steps after restoring a state the {time} time differ in {listed(names)}")
        note = "restored twice, the same bits"
        if can.canSerializeFMUstate:
            subject.begin("when a state was carried into a second instance")
            content = _serialised(first, state)
            with Instance(subject) as second:
                second.initialise()
                _restore(second, content)
                if names := subject.differing(expected, second.run(BEFORE, AFTER)):
                    faults.append(f"steps of a second instance with the state's bytes differ in {listed(names)}")
            note += f"; as {len(content)} bytes into a second instance too"
        else:
            note += "; canSerializeFMUstate is not declared"
        subject.begin("when a state was freed")
        first.must("FreeFMUstate", byref(state))
    return Verdict(note, tuple(faults))


def _serialised(instance: Instance, state: Any) -> bytes:
    size = c_size_t()
    instance.must("SerializedFMUstateSize", state, byref(size))
    content = (c_char * size.value)()
    instance.must("SerializeFMUstate", state, content, size)
    return content.raw


def _restore(instance: Instance, content: bytes) -> None:
    state = fmi2FMUstate()
    buffer = create_string_buffer(content, len(content))
    instance.must("DeSerializeFMUstate", buffer, len(content), byref(state))
    instance.must("SetFMUstate", state)
    instance.must("FreeFMUstate", byref(state))
