"""The seal of a log: every edit of a content is noticed though all checksums are made again; anyone can compute it."""

import hashlib
import json
import zlib
from copy import deepcopy

import pytest
from mcap.reader import make_reader
from mutated import Content
from recorded import ATTACHMENTS, METADATA, TOPICS, write_steps
from short_run import SHORT

from orchestrator.execution import replay_model, resume
from orchestrator.log import recorder as module
from orchestrator.log.log_metadata import CHECKPOINT
from orchestrator.log.message_records import Event
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.log.recorder import Recorder
from orchestrator.log.tools import BROKEN, RECOVERED, WHOLE, recover, verify
from orchestrator.results.page.trust import completeness

STEPS = 300
PROVENANCE = {"created": "2026-01-01", "commit": "abc"}


@pytest.fixture(scope="module")
def sealed(tmp_path_factory):
    """Log of several chunks with a checkpoint, provenance and an event."""
    path = tmp_path_factory.mktemp("sealed") / "log.mcap"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "CHUNK", 40_000)
        with Recorder(path, TOPICS, ATTACHMENTS, METADATA | {"provenance": PROVENANCE}, flush=60) as recorder:
            write_steps(recorder, STEPS)
            recorder.attach(f"{CHECKPOINT}{STEPS}", b"state" * 100)
            recorder.write_remaining()
            recorder.write_events([Event(0.1, "chassis", "lifted", "a wheel lifts off")])
            recorder.close("ok", "", STEPS)
    return path


@pytest.fixture(scope="module")
def rewritten(sealed, tmp_path_factory):
    """The same log in the form in which ``Content`` writes it."""
    return Content(sealed).write(tmp_path_factory.mktemp("rewritten") / "log.mcap")


def seal_by_definition(path):
    """Seal of a log, from the page on the format alone."""
    with path.open("rb") as stream:
        (closing,) = (record.metadata for record in make_reader(stream).iter_metadata() if record.name == "closing")
    rest = {key: closing[key] for key in sorted(closing) if key != "seal"}
    return hashlib.sha256(json.dumps(rest).encode()).hexdigest()


def test_the_definition_gives_the_seal(sealed):
    with Log(sealed) as log:
        assert log.seal == seal_by_definition(sealed)
        assert {f"attachment:{name}" for name in log.attachments} < log.closing["contents"].keys()
    assert verify(sealed).sentences[-1] == f"seal {log.seal}"
    assert verify(sealed).code == WHOLE


def nudged_value(content):
    content.nudge("/chassis/out", 10 + 16, 7)


def renamed(key, before, after):
    def change(content):
        for _, _, about in content.channels.values():
            about[key] = about[key].replace(before, after, 1)

    return change


def without_last_step(content):
    content.chunks[-1] = [
        (number, rows[:-1], times[:-1]) for number, rows, times in content.chunks[-1] if len(rows) > 1
    ]
    content.metadata["closing"]["steps"] = str(STEPS - 1)


def added_attachment(content):
    content.attachments["note.txt"] = b"all is well"


def removed_checkpoint(content):
    del content.attachments[f"{CHECKPOINT}{STEPS}"]


EDITS = {
    "scene": lambda content: content.attachments.update({"scene.json": b'{"name": "smell"}'}),
    "checkpoint": lambda content: content.attachments.update({f"{CHECKPOINT}{STEPS}": b"State" * 100}),
    "status": lambda content: content.metadata["closing"].update(status="failed"),
    "warning": lambda content: content.metadata["closing"].update(warnings="[]" + " "),
    "provenance": lambda content: content.metadata["provenance"].update(commit="abd"),
    "unit": renamed("units", '"rad"', '"deg"'),
    "name": renamed("names", "right.road_arm[5].angle", "right.road_arm[6].angle"),
    "message": nudged_value,
    "message removed": without_last_step,
    "attachment added": added_attachment,
    "attachment removed": removed_checkpoint,
}


SAID = {
    "scene": "the attachment 'scene.json' is changed",
    "checkpoint": f"the attachment '{CHECKPOINT}{STEPS}' is changed",
    "status": "its closing record is changed",
    "warning": "its closing record is changed",
    "provenance": "the record 'provenance' is changed",
    "message": "the record of /chassis/out is changed",
    "message removed": "its closing record is changed",
    "attachment added": "the attachment 'note.txt' is added",
    "attachment removed": f"the attachment '{CHECKPOINT}{STEPS}' is missing",
}


def test_another_order_is_no_edit(rewritten, tmp_path):
    content = Content(rewritten)
    content.attachments, content.metadata = (
        dict(reversed(one.items())) for one in (content.attachments, content.metadata)
    )
    content.chunks.reverse()
    assert verify(content.write(tmp_path / "same.mcap", old_seal=True)).code == BROKEN, "messages are not in order"
    content.chunks.reverse()
    assert verify(content.write(tmp_path / "same.mcap", old_seal=True)).code == WHOLE


@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_is_noticed_with_all_checksums_made_again(rewritten, tmp_path, edit):
    content = Content(rewritten)
    EDITS[edit](content)
    path = content.write(tmp_path / "edited.mcap", old_seal=True)
    verdict = verify(path)
    said = f"{path} is not as it was sealed: {SAID.get(edit, 'the ')}"
    assert verdict.code == BROKEN
    assert any(sentence.startswith(said) for sentence in verdict.sentences), verdict.sentences
    with Log(path) as log, pytest.raises(LogUnreadable, match=r"is not as it was sealed.*'cotrack log recover'"):
        log.check_seal()
    content.hash_again()
    content.write(path)
    with Log(path) as log:
        assert not log.seal_faults(), "a seal that is made again holds"


def edited_bytes(sealed, path, before, after):
    """Replace bytes of equal number and make the checksums at the end again."""
    data = sealed.read_bytes()
    assert data.count(before) >= 1
    assert len(before) == len(after)
    return _with_checksums(data.replace(before, after, 1), path)


def _with_checksums(data, path):
    summary = int.from_bytes(data[-8 - 20 : -8 - 12], "little")
    data = bytearray(data)
    data[summary - 4 : summary] = zlib.crc32(data[: summary - 13]).to_bytes(4, "little")
    data[-12:-8] = zlib.crc32(data[summary:-12]).to_bytes(4, "little")
    path.write_bytes(data)
    return path


def test_other_edits_in_place_are_noticed(sealed, tmp_path):
    edits = [
        (b'"/events"'[1:-1] + b"\x04\0\0\0json", b"/eventz\x04\0\0\0json"),  # topic of the events
        (b"foxglove.Log", b"foxglove.Fog"),  # the schema of the events
        (b"\x06\0\0\0commit\x03\0\0\0abc", b"\x06\0\0\0commit\x03\0\0\0abd"),
    ]
    for before, after in edits:
        verdict = verify(edited_bytes(sealed, tmp_path / "edited.mcap", before, after))
        assert verdict.code == BROKEN, before
        assert any("sealed" in sentence for sentence in verdict.sentences), verdict.sentences


def test_a_seal_that_is_taken_away_is_missed(sealed, tmp_path):
    content = Content(sealed)
    del content.metadata["closing"]["seal"]
    path = content.write(tmp_path / "edited.mcap", old_seal=True)
    assert (verify(path).code, verify(path).sentences) == (BROKEN, [f"{path} has lost its seal"])


def test_an_event_that_is_changed_is_noticed(sealed, tmp_path):
    """One chunk of the file is exchanged for that of another event."""
    other = tmp_path / "other.mcap"
    pieces = []
    for text in ("a wheel lifts off", "a wheel lifts oft"):
        with Recorder(other, {"/a/out": [("x", "m")]}, {}, {}) as recorder:
            recorder.write_remaining()
            recorder.write_events([Event(0.1, "chassis", "lifted", text)])
            recorder.close("ok", "", 0)
        pieces.append(other.read_bytes())
    with Log(other) as log:
        assert not log.seal_faults()
    assert len(pieces[0]) == len(pieces[1])
    places = [k for k, (a, b) in enumerate(zip(*pieces, strict=True)) if a != b]
    ends = [pieces[1].index(b"closing"), len(pieces[1])]
    changed = [k for k in places if k < ends[0]]
    assert changed, "no byte of the event's chunk differs"
    mixed = bytearray(pieces[0])
    for k in changed:
        mixed[k] = pieces[1][k]
    assert verify(_with_checksums(bytes(mixed), other)).code == BROKEN
    assert any("is not as it was sealed" in sentence for sentence in verify(other).sentences)


def test_a_log_that_was_cut_off_has_no_seal_and_is_sealed_anew(sealed, tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(sealed.read_bytes()[:60_000])
    with Log(cut, unfinished=True) as log:
        assert log.seal == ""
        assert not log.seal_faults()
    verdict = recover(cut, tmp_path / "saved.mcap")
    assert verdict.code == RECOVERED
    assert f"sealed anew; {cut} had no seal" in verdict.sentences
    with Log(tmp_path / "saved.mcap") as log:
        assert log.seal == seal_by_definition(tmp_path / "saved.mcap")
        assert log.metadata["recovered"] == {"of": "cut.mcap", "seal": "none"}
    assert verify(tmp_path / "saved.mcap").code == WHOLE


def test_replay_resume_and_report_ask_the_seal(sealed, tmp_path):
    content = Content(sealed)
    content.attachments["system.json"] = json.dumps({"instances": [], "connections": []}).encode()
    content.metadata["run"]["scene"] = "other"
    path = content.write(tmp_path / "edited.mcap", old_seal=True)
    for ask in (
        lambda: replay_model.open_replay(path, "chassis", None).__enter__(),
        lambda: resume.resume(path, tmp_path / "more.mcap"),
    ):
        with pytest.raises(LogUnreadable, match="is not as it was sealed"):
            ask()
    with Log(path) as log:
        assert completeness(log)[0] == "bad"
        assert "is not as it was sealed" in completeness(log)[1]
    with Log(sealed) as log:
        assert completeness(log) == (
            "good",
            "The record is complete: all 5 topics have the sha256 that the run wrote when it ended, and it is as it was"
            " sealed.",
        )


def test_two_runs_have_one_digest_and_two_seals(tmp_path):
    roots = set()
    for wall in (0.0, 1.0):
        with Recorder(tmp_path / "log.mcap", TOPICS, ATTACHMENTS, deepcopy(METADATA)) as recorder:
            write_steps(recorder, 10, wall)
            recorder.close("ok", "", 10)
        with Log(tmp_path / "log.mcap") as log:
            roots.add((log.digest(), log.seal))
            assert recorder.seal == log.seal
    assert len({digest for digest, _ in roots}) == 1
    assert len({root for _, root in roots}) == 2


def test_info_compare_and_report_say_that_a_seal_does_not_hold(cotrack, tmp_path):
    assert cotrack(*SHORT, "--log", "a.mcap")[0] == 0
    content = Content(Content(tmp_path / "a.mcap").write(tmp_path / "a.mcap"))
    content.metadata["run"]["scene"] = content.metadata["run"]["scene"][::-1]
    content.write(tmp_path / "b.mcap", old_seal=True)
    said = "b.mcap is not as it was sealed"
    out = cotrack.done("log", "info", "b.mcap")
    assert said in out
    assert out.rstrip().endswith(", which does not hold")
    faults = json.loads(cotrack("log", "info", "b.mcap", "--json")[1])["seal_faults"]
    assert [said in fault for fault in faults] == [True]
    for arguments in (
        ("compare", "a.mcap", "b.mcap"),
        ("compare", "b.mcap", "a.mcap"),
        ("report", "b.mcap", "-o", "b.html"),
    ):
        status, _, err = cotrack(*arguments)
        assert status == 0, err
        assert said in err
    for arguments in (("log", "info", "a.mcap"), ("compare", "a.mcap", "a.mcap"), ("report", "a.mcap", "-o", "a.html")):
        status, out, err = cotrack(*arguments)
        assert (status, "seal" in err, "does not hold" in out) == (0, False, False)
