"""Errors that only say what a log does not hold; any other error of an evaluation is a fault of ours."""

from fmus.vehicle import BadInput
from orchestrator.log.container_reader import LogUnreadable
from orchestrator.log.extra import NotInstalled
from orchestrator.log.reader import NoSuchSignal
from orchestrator.results.run_data import Missing

UNANSWERED = (Missing, NoSuchSignal, NotInstalled, BadInput)  # each is a sentence on what is not there
FAULTS_RAISE = False  # the tests set it


def reason(error: Exception) -> str:
    """Sentence on an error that ends one of many evaluations; raises LogUnreadable, and in the tests faults of ours."""
    if isinstance(error, UNANSWERED):
        return str(error)
    if FAULTS_RAISE or isinstance(error, LogUnreadable):
        raise error
    return f"{type(error).__name__}: {error}"
