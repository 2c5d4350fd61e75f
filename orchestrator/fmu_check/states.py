"""Check of saved states: restored, and carried into a second instance as bytes, they continue bit for bit."""

from __future__ import annotations

from ctypes import byref, c_size_t, c_void_p
from typing import Any

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
        state, fmi = c_void_p(), subject.fmi
        first.must(f"Get{fmi.STATE}", byref(state))
        expected = first.run(BEFORE, AFTER)
        for time in ("first", "second"):
            subject.begin(f"when a state was restored the {time} time")
            first.must(f"Set{fmi.STATE}", state)
            if names := subject.differing(expected, first.run(BEFORE, AFTER)):
                faults.append(f"steps after restoring a state the {time} time differ in {listed(names)}")
        note = "restored twice, the same bits"
        if can.canSerializeFMUstate:
            subject.begin("when a state was carried into a second instance")
            content = _serialised(first, state, fmi)
            with Instance(subject) as second:
                second.initialise()
                _restore(second, content, fmi)
                if names := subject.differing(expected, second.run(BEFORE, AFTER)):
                    faults.append(f"steps of a second instance with the state's bytes differ in {listed(names)}")
            note += f"; as {len(content)} bytes into a second instance too"
        else:
            note += "; canSerializeFMUstate is not declared"
        subject.begin("when a state was freed")
        first.must(f"Free{fmi.STATE}", byref(state))
    return Verdict(note, tuple(faults))


def _serialised(instance: Instance, state: c_void_p, fmi: Any) -> bytes:
    size = c_size_t()
    instance.must(f"Serialized{fmi.STATE}Size", state, byref(size))
    content = (fmi.BYTE * size.value)()
    instance.must(f"Serialize{fmi.STATE}", state, content, size)
    return bytes(content)


def _restore(instance: Instance, content: bytes, fmi: Any) -> None:
    state = c_void_p()
    buffer = (fmi.BYTE * len(content)).from_buffer_copy(content)
    instance.must(fmi.DESERIALIZE, buffer, len(content), byref(state))
    instance.must(f"Set{fmi.STATE}", state)
    instance.must(f"Free{fmi.STATE}", byref(state))
