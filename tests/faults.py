"""Table of faults: what happens to a run then, and the test that shows it; a test compares it with the README."""

from __future__ import annotations

from typing import NamedTuple


class Fault(NamedTuple):
    """A fault, what happens then, and the test that shows it."""

    fault: str
    then: str
    test: str  # file::function, below tests/


FAULTS = (
    Fault("kill -9 of a run", "the log is saved up to its last second, and replays bit by bit",
          "orchestrator/test_interrupted_commands.py::test_a_killed_run_leaves_a_log_that_can_be_saved"),
    Fault("kill -9 of a run, resumed", "the resumed run has the digest of an uninterrupted one",
          "orchestrator/test_resume.py::test_a_killed_run_goes_on"),
    Fault("kill -9 of a study's worker", "its case fails with a reason; a second start repeats it alone",
          "validation/test_studies.py::test_a_study_goes_on_where_it_was"),
    Fault("no disk, memory or files for a case of a sweep", "its case fails; a second start repeats it, and says so",
          "orchestrator/test_sweep.py::test_only_answers_of_the_model_are_kept"),
    Fault("a thread of a run that dies", "status 1, one sentence",
          "orchestrator/test_interrupted_commands.py::test_a_recorder_that_dies_fails_the_run"),
    Fault("SIGINT or SIGTERM while a run is evaluated", "status 1 at once, the log is closed and whole",
          "orchestrator/test_interrupted_commands.py::test_a_signal_ends_the_evaluation_at_once"),
    Fault("kill -9 of a study", "its workers end",
          "validation/test_studies.py::test_processes_end_with_a_study_that_a_signal_ends"),
    Fault("kill -9 of a Dask worker", "another worker repeats its case",
          "validation/test_studies.py::test_a_cluster_gives_the_same_rows_and_outlives_a_worker"),
    Fault("SIGINT or SIGTERM to a run", "status 1, the log is closed and whole",
          "orchestrator/test_interrupted_commands.py::test_a_signal_closes_the_log"),
    Fault("SIGINT or SIGTERM while kernels compile", "status 1, one sentence, no log, no partial file in the cache",
          "test_faults.py::test_a_signal_while_kernels_compile"),
    Fault("kill -9 while a kernel compiles", "the next run computes the same bits",
          "test_faults.py::test_a_killed_compilation_leaves_a_cache_that_works"),
    Fault("SIGSTOP and SIGCONT of a run", "the digest of an undisturbed run",
          "test_faults.py::test_a_run_that_was_stopped_goes_on"),
    Fault("file system full under the log", "status 1, one sentence, the log is saved up to there",
          "test_faults.py::test_a_file_system_that_is_full_under_the_log"),
    Fault("limit of file size under the log", "one sentence, all that fits is in the log",
          "orchestrator/test_recorder_files.py::test_a_full_disk_is_one_sentence_and_leaves_all_that_fits"),
    Fault("file system full under the cache", "the same bits, one message",
          "test_faults.py::test_a_cache_that_cannot_be_written"),
    Fault("read-only home", "the same bits, one message", "test_faults.py::test_a_cache_that_cannot_be_written"),
    Fault("damaged cache", "the same bits, the cache is mended",
          "test_cache_in_runs.py::test_a_run_on_damaged_files_is_right_and_heals_them"),
    Fault("four cold starts at once", "the same bits, no partial file in the cache",
          "test_faults.py::test_four_cold_starts_at_once"),
    Fault("100 runs in one process", "no descriptor or thread more than after ten, less than 20 MB more",
          "test_faults.py::test_a_hundred_runs_in_one_process"),
    Fault("clock that jumps by days", "the digest of an undisturbed run",
          "test_faults.py::test_a_run_in_another_python"),
    Fault("python -OO", "the digest of an undisturbed run; bad input has status 2 and its sentence",
          "test_faults.py::test_a_run_in_another_python"),
)  # fmt: skip


def table() -> str:
    """The table in Markdown."""
    lines = ["| fault | then | test |", "| --- | --- | --- |"]
    return "\n".join([*lines, *(f"| {one.fault} | {one.then} | `{one.test}` |" for one in FAULTS)])


if __name__ == "__main__":
    print(table())
