"""The seal of a log: every edit is noticed though all checksums are made again, and anyone can compute it."""

import hashlib
import json
import zlib
from copy import deepcopy

import numpy as np
import pytest
from mcap.opcode import Opcode
from mutated import Content
from recorded import ATTACHMENTS, METADATA, TOPICS, write_steps
from short_run import SHORT

from orchestrator.execution import replay_model, resume
from orchestrator.log import recorder as module
from orchestrator.log import seal
from orchestrator.log.container_writer import ContainerWriter
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


def root_by_definition(path):
    """Root of a sealed log, from the page on the format alone."""
    data, leaves, offset = path.read_bytes(), [], 8
    start, opcode = 0, data[8]
    while True:
        end = offset + 9 + int.from_bytes(data[offset + 1 : offset + 9], "little")
        while data[end] == 0x07:  # message indexes belong to their chunk
            end += 9 + int.from_bytes(data[end + 1 : end + 9], "little")
        if opcode == 0x0C and data[offset + 13 : offset + 17] == b"seal":
            break
        leaves.append(hashlib.sha256(b"\0" + data[start:end]).digest())
        start, offset, opcode = end, end, data[end]

    def root(part):
        if len(part) == 1:
            return part[0]
        half = 1 << (len(part) - 1).bit_length() - 1
        return hashlib.sha256(b"\1" + root(part[:half]) + root(part[half:])).digest()

    return root(leaves).hex(), len(leaves)


def test_the_definition_gives_the_seal(sealed):
    with Log(sealed) as log:
        assert log.seal == root_by_definition(sealed)[0]
        assert len(log._chunks.spans) > 3
    assert verify(sealed).sentences[-1] == f"seal {log.seal}"
    assert verify(sealed).code == WHOLE


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8, 13])
def test_no_inner_node_passes_for_a_leaf(count):
    """The tree is that of RFC 6962: a list of its inner nodes has another root."""
    leaves = [seal.leaf_hash([bytes([k])]) for k in range(count)]
    nodes = [hashlib.sha256(b"\1" + a + b).digest() for a, b in zip(leaves[::2], leaves[1::2], strict=False)]
    assert seal.root_of(leaves) == seal.root_of(nodes + leaves[len(leaves) & ~1 :])  # a node is the root of its leaves
    assert seal.root_of([seal.leaf_hash([leaf]) for leaf in leaves]) != seal.root_of(leaves)
    assert seal.root_of(leaves[::-1]) != seal.root_of(leaves) or count == 1


def nudged_value(content):
    content.nudge("/chassis/out", 10 + 16, 7)


def with_sha256(content):
    """Make the sha256 of each topic in the closing record again."""
    hashes = {topic: hashlib.sha256() for topic, _, _ in content.channels.values()}
    counts = dict.fromkeys(hashes, 0)
    for number, rows, _ in (item for piece in content.chunks for item in piece):
        hashes[content.channels[number][0]].update(np.ascontiguousarray(rows[:, 11:]).data)
        counts[content.channels[number][0]] += len(rows)
    for topic, value in hashes.items():
        content.metadata["closing"] |= {f"sha256:{topic}": value.hexdigest(), f"messages:{topic}": str(counts[topic])}


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


def exchanged_attachments(content):
    content.attachments = dict(reversed(content.attachments.items()))


def exchanged_metadata(content):
    content.metadata = dict(reversed(content.metadata.items()))


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
    "attachments reordered": exchanged_attachments,
    "metadata reordered": exchanged_metadata,
    "chunks exchanged": lambda content: content.chunks.reverse(),
}


def test_without_an_edit_the_seal_holds(rewritten, tmp_path):
    content = Content(rewritten)
    with_sha256(content)
    assert verify(content.write(tmp_path / "same.mcap", old_seal=True)).code == WHOLE


@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_is_noticed_with_all_checksums_made_again(rewritten, tmp_path, edit):
    content = Content(rewritten)
    EDITS[edit](content)
    with_sha256(content)
    path = content.write(tmp_path / "edited.mcap", old_seal=True)
    verdict = verify(path)
    assert verdict.code == BROKEN
    assert any("is not as it was sealed" in sentence for sentence in verdict.sentences), verdict.sentences
    with Log(path) as log, pytest.raises(LogUnreadable, match=r"is not as it was sealed.*'cotrack log recover'"):
        log.check_seal()
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


def test_a_file_that_says_it_is_of_others_has_the_contents_that_were_sealed(sealed, tmp_path):
    verdict = verify(edited_bytes(sealed, tmp_path / "edited.mcap", b"cotrack", b"cobrack"))
    assert (verdict.code, "content intact" in verdict.sentences[-1]) == (WHOLE, True)


def test_an_event_that_is_changed_is_noticed(sealed, tmp_path):
    """Events are in no digest: one chunk of the file is exchanged for that of another event."""
    other = tmp_path / "other.mcap"
    content, pieces = Content(sealed), []
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
    assert content.attachments


def test_the_summary_is_held_against_the_records(sealed, tmp_path):
    """A unit that is changed in the summary only, which opening a log reads, is noticed."""
    data = sealed.read_bytes()
    summary = int.from_bytes(data[-28:-20], "little")
    changed = data[:summary] + data[summary:].replace(b'"rad"', b'"deg"', 1)
    path = _with_checksums(changed, tmp_path / "summary.mcap")
    with Log(path) as log:
        assert "deg" in log.topics["/chassis/out"].units, "the summary was not used"
        with pytest.raises(LogUnreadable, match="the indexes at its end do not list what the file holds"):
            log.check_seal()
    assert verify(path).code == BROKEN
    assert recover(path, tmp_path / "saved.mcap").code == WHOLE
    with Log(tmp_path / "saved.mcap") as log, Log(sealed) as original:
        assert log.topics == original.topics


def test_a_seal_that_is_taken_away_is_missed(sealed, tmp_path):
    content = Content(sealed)
    del content.metadata["seal"]
    verdict = verify(content.write(tmp_path / "edited.mcap"))
    assert (verdict.code, verdict.sentences) == (BROKEN, [f"{tmp_path / 'edited.mcap'} has lost its seal"])


def test_records_behind_the_seal_are_noticed(sealed, tmp_path):
    content, path = Content(sealed), tmp_path / "longer.mcap"

    class Longer(ContainerWriter):
        def seal(self):
            root = super().seal()
            self.metadata("note", {"text": "all is well"})
            return root

    content.write(path, writer=Longer)
    assert any("records follow its seal" in sentence for sentence in verify(path).sentences)


def test_a_part_is_checked_alone(sealed, tmp_path):
    """An attachment is checked by its own leaf: it is read, nothing else is."""
    content = Content(sealed)
    content.attachments["scene.json"] = b'{"name": "smell"}'
    sentence = r"not as it was sealed: the attachment 'scene\.json' is changed"
    with (
        Log(content.write(tmp_path / "edited.mcap", old_seal=True)) as log,
        pytest.raises(LogUnreadable, match=sentence),
    ):
        log.attachment("scene.json")
    data = sealed.read_bytes()
    with Log(sealed) as log:
        assert log.attachment("scene.json") == ATTACHMENTS["scene.json"]
        offset = log._attachments["scene.json"]
    assert data[offset] == Opcode.ATTACHMENT
    with Log(sealed) as log:
        place = log._contents.seal.offsets.index(offset)
        end = log._contents.seal.offsets[place + 1]
        assert hashlib.sha256(b"\0" + data[offset:end]).digest() == log._contents.seal.leaves[place]


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
        assert log.seal == root_by_definition(tmp_path / "saved.mcap")[0]
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
