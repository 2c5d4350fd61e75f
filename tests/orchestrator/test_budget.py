"""Limits of readers, files that are replaced as a whole, and cells of CSV files."""

import os
import stat

import hostile
import pytest

from fmus.cache.files import replacing
from orchestrator.files import budget
from orchestrator.files.columns import safe_cell
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.results.table import Table

LOG = hostile.Path(__file__).parent / "logs" / "format_1.mcap"


def test_regular_files_are_opened_alone(tmp_path):
    for path, said in (
        (hostile.pipe(tmp_path / "pipe"), "it is a pipe"),
        ("/dev/zero", "it is a device"),
        (hostile.sparse(tmp_path / "sparse"), "the rest are holes"),
        (tmp_path, "directory"),
    ):
        with pytest.raises(OSError, match=said):
            budget.open_file(path)
    assert budget.read_file(LOG, 1 << 20) == LOG.read_bytes()
    with pytest.raises(budget.OverBudget, match="more than 100 bytes"):
        budget.read_file(LOG, 100)


@pytest.mark.parametrize("kind", ["deep arrays", "deep tables", "long key", "spaced key", "quoted key"])
def test_nesting(kind):
    with pytest.raises(budget.OverBudget, match=r"deep|parts"):
        budget.check_nesting(hostile.scene(kind, "a = 1"))
    budget.check_nesting("a = " + "[" * 60 + "]" * 60 + "\nb = '1.2.3 [[['\n" + ".".join(["a"] * 60) + " = 1")


def test_logs_of_any_size_unpack_to_a_multiple_of_it():
    honest = budget.UnpackedBudget(845 << 20)
    for _ in range(500):
        honest.take(2 << 20)  # 1.2 times the size, in chunks as the recorder writes them
    small = budget.UnpackedBudget(300_000)
    small.take(50 << 20)
    with pytest.raises(budget.OverBudget, match="unpacks to more than"):
        small.take(50 << 20)
    with pytest.raises(budget.OverBudget, match="a part of it"):
        honest.take(65 << 20)


@pytest.mark.long
@pytest.mark.parametrize("make", [
    pytest.param(hostile.empty_records, marks=pytest.mark.long),  # a second or more; these unpack to too much
    hostile.lone_messages, hostile.many_large_chunks,
    hostile.many_metadata, hostile.many_attachments, hostile.many_schemas, hostile.many_channels,  # outside of chunks
    hostile.indexed_metadata, hostile.many_names,
])  # fmt: skip
def test_logs_that_unpack_to_too_much_and_of_too_many_records_are_refused(make, tmp_path):
    indexed = make in (hostile.empty_records, hostile.lone_messages, hostile.many_large_chunks)
    with pytest.raises(LogUnreadable, match=r"is not read: .*( unpacks to|more than \d+ records|its channel records)"):
        Log(make(LOG, tmp_path / "hostile.mcap"), unfinished=True, by_index=indexed)


def test_chunks_of_too_many_records_are_refused(tmp_path):
    log = hostile.log_with(LOG, tmp_path / "many.mcap", hostile.chunk(hostile.EMPTY * 100_000, 10))
    with Log(log) as opened, pytest.raises(LogUnreadable, match="more records than its size allows"):
        opened.lengths()


def test_a_file_is_replaced_whole_by_one_of_a_random_name(tmp_path):
    file, names = tmp_path / "file.txt", set()
    for content in ("old", "new"):
        with replacing(file) as fresh:
            names.add(fresh.name)
            fresh.write_text(content)
    assert len(names) == 2
    assert file.read_text() == "new"
    with pytest.raises(IsADirectoryError), replacing(file):
        tmp_path.read_text()
    assert file.read_text() == "new"
    assert os.listdir(tmp_path) == ["file.txt"]
    umask = os.umask(0)
    os.umask(umask)
    assert stat.S_IMODE(file.stat().st_mode) == 0o666 & ~umask


def test_no_link_of_others_is_followed(tmp_path, monkeypatch):
    monkeypatch.setattr("secrets.token_hex", lambda n: "guessed")
    (tmp_path / "target").write_text("of others")
    (tmp_path / ".guessed.txt").symlink_to("target")
    with pytest.raises(FileExistsError), replacing(tmp_path / "file.txt"):
        pass
    assert (tmp_path / "target").read_text() == "of others"


def test_cells_are_no_formulas():
    rows = [("=1+1", -1.5), ("@SUM(A1)", 2.0), ("-x", 0.0), ("+x", 0.0), ("left track", 1.0)]
    text = Table.of("title", [("=name", ""), ("value", "m")], rows).csv()
    assert text.splitlines() == [
        "'=name,\"value, m\"", "'=1+1,-1.5", "'@SUM(A1),2.0", "'-x,0.0", "'+x,0.0", "left track,1.0",
    ]  # fmt: skip
    assert safe_cell(-3) == -3
