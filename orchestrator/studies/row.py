"""Row of a study's table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any


@dataclass(frozen=True)
class Row:
    """Result of a case, stored as JSON; figures by column key."""

    item: str  # family, scene or part; empty: that of the case
    case: str  # what was measured; empty: the name of the case
    figures: Mapping[str, Any] = field(default_factory=dict)
    ok: bool | None = None  # False: not as it should be; None: no requirement
    note: str = ""

    def __getitem__(self, key: str) -> Any:
        """Figure by key; NaN if missing."""
        return self.figures.get(key, math.nan)

    def with_figures(self, **figures: Any) -> Row:
        """Copy of the row with more figures."""
        return replace(self, figures={**self.figures, **figures})

    def cells(self) -> dict[str, Any]:
        """All values by column key."""
        return {**vars(self), **self.figures}
