"""Calls of an instance in this process, by the names of the functions of FMI; what both versions have in common."""
# ruff: noqa: D102 (methods of ``slave.Slave``)

from __future__ import annotations

from typing import Any

from orchestrator.fmi.slave import CallNote, failed


class LibraryCalls:
    """Instance ``handle`` of a ``library`` with functions of a ``prefix``; ``note`` gets their names before."""

    prefix: str
    handle: Any

    def __init__(self, library: Any, note: CallNote | None) -> None:
        self.library, self.failed, self._note = library, "", note

    def enter(self, function: str) -> str:
        """Note a call; return the whole name of its function."""
        name = f"{self.prefix}{function}"
        if self._note is not None:
            self._note(name)
        return name

    def call(self, function: str, *arguments: Any) -> int:
        """Make a call, named without its prefix."""
        name = self.enter(function)
        status = int(getattr(self.library, name)(self.handle, *arguments))
        if failed(status):
            self.failed = name
        return status

    def exit_initialisation(self) -> int:
        return self.call("ExitInitializationMode")

    def reset(self) -> int:
        return self.call("Reset")

    def terminate(self) -> int:
        return self.call("Terminate")
