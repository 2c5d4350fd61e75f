"""Study of the paper's chain mechanics: each part is compared with exact or published figures.

Items are those of the study's table; ``cases(quick)`` leaves out the two long chains and the long windows.
"""

from __future__ import annotations

from orchestrator.studies import Case
from tests.validation import chain_cases, element_cases
from tests.validation.compared import table, write

__all__ = ["TITLE", "cases", "table", "write"]

TITLE = "The chain mechanics of the paper: value, reference, error, order"


def cases(quick: bool) -> list[Case]:
    """Cases by items; ``quick`` stays below five minutes on two cores."""
    return sorted(element_cases.cases() + chain_cases.cases(quick), key=lambda case: int(case.item))
