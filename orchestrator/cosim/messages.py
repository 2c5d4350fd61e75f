"""Messages of an FMU: warnings with their counts, errors of the last call, FMI status as text."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

from orchestrator.files.messages import RUN
from orchestrator.fmi.slave import DISCARD, ERROR, PENDING, WARNING, ComponentEnded, ComponentFailed

PRINTED = "printed"  # category of what an FMU prints
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_WRAPPER = "Fatal py exception encountered: "  # pythonfmu: the sentence is on the last line


@dataclass(frozen=True)
class ComponentWarning:
    """Warning with its count."""

    component: str
    text: str  # first text, on one line; texts that differ in numbers only are counted with it
    time: float  # s, beginning of the communication step of the first one
    count: int


class WarningList:
    """Warnings of one component.

    Restoring a state removes the warnings of the steps taken back. A warning that came in such steps only is kept
    with count 0, because an FMU may give it once and never again.
    """

    def __init__(self, component: str, earlier: Mapping[str, ComponentWarning] | None = None) -> None:
        self._component = component
        self._known = dict(earlier or {})  # by text without numbers; count 0: in steps taken back only

    def add(self, text: str, time: float) -> bool:
        """Count a warning of the step from ``time``, s; return True for the first of its kind."""
        text = " ".join(text.split())
        key = NUMBER.sub("#", text)
        known = self._known.get(key)
        if known is None or not known.count:
            self._known[key] = ComponentWarning(self._component, text, time, 1)
        else:
            self._known[key] = replace(known, count=known.count + 1)
        return known is None

    def entries(self) -> list[ComponentWarning]:
        """Return all warnings in the order of their first occurrence."""
        return [replace(warning, count=max(warning.count, 1)) for warning in self._known.values()]

    def save(self) -> Mapping[str, ComponentWarning]:
        """Copy of the warnings for ``restore``."""
        return dict(self._known)

    def restore(self, saved: Mapping[str, ComponentWarning]) -> None:
        """Restore saved warnings; those added since get count 0 (see the class)."""
        self._known = {key: saved.get(key, replace(warning, count=0)) for key, warning in self._known.items()}


class CallMessages:
    """Messages of an instance: its warnings since the start, and the errors of its last call."""

    def __init__(self, component: str) -> None:
        self._component = component
        self._errors: list[tuple[int, str]] = []  # FMI status, text
        self.warnings = WarningList(component)

    def receive(self, status: int, message: str, category: str, time: float) -> None:
        """Take a message of the step from ``time``, s, and log it; of a warning only the first of its kind."""
        if category == PRINTED:
            status, message = WARNING, f"it prints: {message}"  # shown, but no warning of the FMU
        elif status == WARNING and not self.warnings.add(message, time):
            return
        if status >= DISCARD and category != "traceback":
            self._errors.append((status, message))
        RUN.log(logging.WARNING if status == WARNING else logging.DEBUG, "%s: %s", self._component, message)

    def clear(self) -> None:
        """Forget the errors of the last call."""
        if self._errors:
            self._errors.clear()

    @property
    def has_error(self) -> bool:
        """Whether the last call said more than that it is discarded."""
        return any(status >= ERROR for status, _ in self._errors)

    def first_error(self) -> str:
        """Return the first error message that the FMU logged in the last call, on one line; empty without one."""
        if not self._errors:
            return ""
        text = self._errors[0][1].strip()
        if text.startswith(_WRAPPER):
            text = text.splitlines()[-1]
        return " ".join(text.split())

    def refusal(self) -> str:
        """Return a sentence on an instance that the FMU has not made."""
        said = self.first_error() or "the FMU cannot be instantiated"
        phase = "" if "instantiate" in said.lower() else " (instantiation)"  # which the words may not tell
        return f"{self._component}: {said}{phase}"

    def failure(self, function: str, status: int, time: float | None, is_placed: bool) -> ComponentFailed:
        """Return the failure of a call, with its function where it ``is_placed``.

        :param time: s, beginning of the step; None: the run has ended.
        """
        sentence = self.first_error() or status_text(function, status)
        if is_placed and (function if time is None else "t = ") not in sentence:
            sentence += f" ({function}{'' if time is None else f', t = {time:.6g} s'})"
        return ComponentFailed(f"{self._component}: {sentence}")

    def discarded_step(self, function: str, start: float, last: float, has_ended: bool) -> ComponentFailed:
        """Return the outcome of a step that the FMU has not completed, but does not call an error.

        :param start: s, beginning of the step.
        :param last: s from the start of the run, time that the FMU says it reached; NaN if it says none.
        :param has_ended: the FMU asks for the end of the run.
        """
        said, time_known = self.first_error(), start < last < float("inf")
        if has_ended:
            time, text = last if time_known else start, f": {said}" if said else ""
            return ComponentEnded(f"{self._component} has ended the run at t = {time:.6g} s{text}")
        sentence = said or status_text(function, DISCARD)
        if time_known:
            sentence += f"; the step from t = {start:.6g} s ended at t = {last:.6g} s:"
            sentence += f" a step of {last - start:.3g} s or less may help"
        elif "t = " not in sentence:
            sentence += f"; the step from t = {start:.6g} s is discarded, and no time is said that it reached"
        return ComponentFailed(f"{self._component}: {sentence}")


def status_text(function: str, status: int) -> str:
    """Return the FMI status of a failed function as a sentence."""
    if not 0 <= status <= PENDING:
        return f"{function} returned the status {status}, which FMI does not have"
    if status == PENDING:
        return f"{function} returned before it was done (fmi2Pending): asynchronous steps are not supported"
    return f"{function} failed with FMI status {status}"
