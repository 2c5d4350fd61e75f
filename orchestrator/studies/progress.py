"""How far a study is."""

from __future__ import annotations

from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from orchestrator.studies import Case


class Watched:
    """A bar on stderr where someone watches, else a line for each case that is done."""

    def __init__(self, title: str, count: int) -> None:
        self._count, self._done = count, 0
        self._console = Console(stderr=True)
        self._bar = Progress(
            TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
            TextColumn("{task.fields[last]}"), console=self._console, transient=True,
        )  # fmt: skip
        self._task = self._bar.add_task(title, total=count, last="")

    def __enter__(self) -> Watched:
        if self._console.is_terminal:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def __call__(self, case: Case) -> None:
        """One more case is done."""
        self._done += 1
        if self._console.is_terminal:
            self._bar.update(self._task, advance=1, last=case.name)
        else:
            self._console.print(f"{self._done}/{self._count} {case.name}", markup=False, highlight=False)
