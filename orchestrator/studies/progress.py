"""Progress of a study."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from orchestrator.studies import Case


@contextmanager
def progress_bar(title: str, count: int) -> Iterator[Callable[[Case], None]]:
    """Callback for each finished case: a progress bar if stderr is a terminal, else one line each."""
    console, done = Console(stderr=True), itertools.count(1)
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TextColumn("{task.fields[last]}"),
    )  # fmt: skip
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(title, total=count, last="")

        def tell(case: Case) -> None:
            bar.update(task, advance=1, last=case.name)
            if not console.is_terminal:
                console.print(f"{next(done)}/{count} {case.name}", markup=False, highlight=False, soft_wrap=True)

        yield tell
