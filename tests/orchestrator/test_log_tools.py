"""Damaged logs: they are told, and what is read or saved of them is right; words are in ``test_sentences_log``."""

import json
import random
import shutil
import zlib
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mutated import Content, change_bytes
from recorded import ATTACHMENTS, STEP, TOPICS, chunked_log, ragged, small_log, spans
from wired_logs import write as write_wired

from orchestrator.execution import replay_model
from orchestrator.execution.simulate import simulate
from orchestrator.log import page
from orchestrator.log import recorder as module
from orchestrator.log.container import LogUnreadable
from orchestrator.log.message_records import PREFIX
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.log.tools import BROKEN, RECOVERED, WHOLE, info, recover, verify
from orchestrator.results.difference import differences
from orchestrator.results.energy import ledger
from orchestrator.results.run_data import RunData
from orchestrator.results.views.flat_views import draw_side
from orchestrator.scene.scene import load

small = pytest.fixture(scope="module")(small_log)
chunked = pytest.fixture(scope="module")(chunked_log)
BASES = {"ragged": ragged, "wired": write_wired}


class Base:
    """A whole log: its bytes and chunks, and the bits of its rows by topic and step."""

    def __init__(self, path):
        self.path, self.data, self.spans = path, path.read_bytes(), spans(path.read_bytes())
        self.rows = rows_of(path)

    def damaged(self, data):
        """A file of these bytes, and whether the descriptions before its first chunk are whole."""
        path, begin = self.path.with_name("damaged.mcap"), self.spans[0][0]
        path.write_bytes(data)
        return path, data[:begin] == self.data[:begin]

    def saved(self, path, described=True):
        """Verdict of a recovery, what it saved, and its rows; those of a described log must be right."""
        target = path.with_name("saved.mcap")
        target.unlink(missing_ok=True)
        verdict = recover(path, target)
        assert target.exists() == (verdict.code != BROKEN)
        rows = rows_of(target) if target.exists() else {}
        assert not described or self.holds(rows)
        return verdict.code, target, rows

    def holds(self, rows):
        return all(own.items() <= self.rows[topic].items() for topic, own in rows.items())


def rows_of(path, **options):
    """Rows of a log, topic -> step -> bits; what cannot be read is left out."""
    found = {}
    with Log(path, unfinished=True, **options) as log:
        for topic in log.topics:
            with suppress(LogUnreadable):
                series = log.read(topic)
                steps = np.rint(series.t / STEP).astype(int).tolist()
                found[topic] = {k: row.tobytes() for k, row in zip(steps, series.values, strict=True)}
    return found


@pytest.fixture(scope="module", params=BASES)
def base(request, tmp_path_factory):
    return Base(BASES[request.param](tmp_path_factory.mktemp("base") / "whole.mcap"))


@pytest.mark.long
@settings(max_examples=25)
@given(st.integers(0, 2**32))
def test_random_damage_is_told_and_what_is_read_is_right(base, seed):
    path, described = base.damaged(change_bytes(base.data, random.Random(seed)))
    verdict = verify(path)
    assert verdict.code == (WHOLE if path.read_bytes() == base.data else BROKEN)
    assert not any("\n" in sentence for sentence in verdict.sentences)
    with suppress(LogUnreadable):
        assert not described or (base.holds(rows_of(path)) and base.holds(rows_of(path, by_index=False)))
    base.saved(path, described)


@settings(max_examples=25)
@given(st.floats(0.0, 1.0, exclude_max=True), st.integers(0, 7))
@example(0.0, 0)
@example(2.5e-05, 3)  # in the header
def test_a_flipped_bit_costs_no_chunk_but_its_own(base, fraction, bit):
    data, at = bytearray(base.data), int(fraction * len(base.data))
    data[at] ^= 1 << bit
    path, described = base.damaged(data)
    assert verify(path).code == BROKEN
    code, target, rows = base.saved(path, described)
    if not described:
        assert code != WHOLE, "nobody vouches for descriptions and metadata that may be damaged"
        return
    hurt = [one for one in base.spans if one[0] <= at < one[1]]
    if not hurt:
        assert rows == base.rows
        assert verify(target).code == WHOLE
        assert code == WHOLE or at < int.from_bytes(base.data[-28:-20], "little"), "only the indexes at the end"
        return
    _, _, first, last = hurt[0]
    for topic, own in base.rows.items():
        lost = own.keys() - rows[topic].keys()
        assert all(first / STEP - 7.5 < k < last / STEP + 7.5 for k in lost), topic


@settings(max_examples=25)
@given(st.floats(0.0, 1.0))
@example(0.0)
def test_a_cut_log_is_read_to_its_end_and_saved_to_its_last_whole_step(base, fraction):
    """All topics of the saved log end with one step; of the read one none has more than the recorded."""
    cut = 8 + int(fraction * (len(base.data) - 9))
    path, described = base.damaged(base.data[:cut])
    with Log(path) as log:
        assert not log.complete
        assert log.faults
        left = {topic: log.sequence(topic).tolist() for topic in log.topics}
        read = {topic: len(log.read(topic).t) for topic in log.topics}
    assert base.holds(rows_of(path))
    code, target, _ = base.saved(path)
    if not described:
        return
    assert verify(target).code == WHOLE
    with Log(target, unfinished=True) as log:
        n = log.closing["steps"]
        assert log.closing["status"] == ("failed" if code == RECOVERED else "ok")
        for topic, about in log.topics.items():
            steps, stop = log.sequence(topic).tolist(), n + (not topic.endswith("/in"))
            if topic.startswith("/stats/"):
                assert steps == [k for k in left[topic] if k <= n]
            elif left["/b/out"]:
                assert steps == [*range(0, stop, about.every)], topic
    assert n >= min(len(left["/a/in"]), len(left["/b/in"])) - 1, "more than the cut step is lost"
    assert all(read[topic] >= len(left[topic]) - 1 for topic in left), "more than an input without its output is lost"
    assert all(len(left[topic]) >= sum(end <= cut for _, end, *_ in base.spans) - 8 for topic in ("/a/in", "/b/out"))


# --- what no random damage does ----------------------------------------------------------------------


def without_digests(closing):
    """A closing record apart from the digests of metadata, which say of what a log was recovered."""
    return {key: value for key, value in closing.items() if key not in ("contents", "seal")}


def test_recovering_a_whole_log_copies_it(small, tmp_path):
    assert recover(small, tmp_path / "copy.mcap").code == WHOLE
    assert verify(tmp_path / "copy.mcap").code == WHOLE
    with Log(small) as ours, Log(tmp_path / "copy.mcap") as theirs:
        assert theirs.hashes() == ours.hashes()
        assert theirs.metadata.pop("recovered") == {"of": "small.mcap", "seal": ours.seal}
        assert theirs.metadata == ours.metadata
        assert without_digests(theirs.closing) == without_digests(ours.closing)
        assert {name: theirs.attachment(name) for name in theirs.attachments} == ATTACHMENTS
    before = small.read_bytes()
    assert recover(small, small).code == BROKEN
    assert small.read_bytes() == before


def test_a_step_that_was_never_written_is_a_gap(tmp_path):
    def run(steps, first=0):
        topics = {"/a/out": [("x", "m")], "/stats/a": [("wall_time", "s")]}
        with Recorder(tmp_path / "a.mcap", topics, {}, {}, every={"/a/out": 1 + (first > 0)}) as recorder:
            for k in steps:
                recorder.write("/a/out", k, k * STEP, STEP, np.zeros(1))
                if k % 3 == 0:
                    recorder.write("/stats/a", k, k * STEP, STEP, np.zeros(1))
            recorder.close("ok", "", 9)
        return verify(tmp_path / "a.mcap")

    assert run(range(10)).code == WHOLE
    assert run([0, 1, 2, 4, 5, 6, 7, 8, 9]) == (BROKEN, ["/a/out: step 4 follows step 2"])
    assert run(range(4, 10), 4) == (BROKEN, ["/a/out: begins with step 4"])
    assert run(range(9)) == (BROKEN, [f"{tmp_path / 'a.mcap'} ends with step 8 of 9"])


def test_a_topic_that_was_never_recorded_takes_nothing_with_it(tmp_path):
    topics = {"/a/out": [("x", "m")], "/b/out": [("x", "m")]}
    with Recorder(tmp_path / "a.mcap", topics, {}, {}) as recorder:
        for k in range(5):
            recorder.write("/a/out", k, k * STEP, STEP, np.zeros(1))
        recorder.write_remaining()
        shutil.copy(tmp_path / "a.mcap", tmp_path / "cut.mcap")
    assert recover(tmp_path / "cut.mcap", tmp_path / "saved.mcap").code == RECOVERED
    with Log(tmp_path / "saved.mcap", unfinished=True) as saved:
        assert len(saved.sequence("/a/out")) == 5


def test_results_of_the_closing_record_are_kept(tmp_path):
    results = {"wall_time": "1.5", "error": '{"total": 0.01}', "energy_residual": "-0.002"}
    data = bytearray(ragged(tmp_path / "whole.mcap", results=results).read_bytes())
    indexes, bad, saved = int.from_bytes(data[-28:-20], "little"), tmp_path / "bad.mcap", tmp_path / "saved.mcap"
    with Log(tmp_path / "whole.mcap") as log:
        closing = log.closing
    assert closing["results"] == results
    bad.write_bytes(data[: indexes + 20])
    assert recover(bad, saved).code == WHOLE
    with Log(saved) as log:
        assert without_digests(log.closing) == without_digests(closing)
    data[spans(data)[3][0] + 100] ^= 4
    bad.write_bytes(data)
    assert recover(bad, saved).code == RECOVERED
    with Log(saved, unfinished=True) as log:
        assert (log.closing["results"], log.closing["status"], log.closing["steps"]) == (results, "failed", 60)
        assert "; the run ended with status ok" in log.closing["message"]
        inputs, outputs = log.sequence("/a/in"), log.sequence("/b/out")
        assert 40 < len(inputs) < 60
        assert np.array_equal(inputs + 1, outputs[1:]), "steps beside the gap are incomplete"


WARNED = {"component": "a", "text": "x", "time": 0.0, "count": 1}


@pytest.mark.parametrize(
    "warnings",
    [7, {}, [7], [{}], ["x"], "[" * 5000, "9" * 5000, "", [WARNED | {"count": -1}], [WARNED | {"count": 10**400}],
     [WARNED | {"time": None}], [WARNED | {"text": "\udcff"}], [WARNED | {"component": []}], [WARNED | {"more": 1}]],
)  # fmt: skip
def test_warnings_that_are_none_damage_their_record(small, tmp_path, warnings):
    content = Content(small)
    content.metadata["closing"]["warnings"] = json.dumps([WARNED])
    with Log(content.write(tmp_path / "good.mcap")) as log:
        assert log.closing["warnings"] == [WARNED]
    content.metadata["closing"]["warnings"] = warnings if isinstance(warnings, str) else json.dumps(warnings)
    path = content.write(tmp_path / "bad.mcap")
    assert verify(path).code == BROKEN
    assert info(path).log.closing is None
    assert recover(path, tmp_path / "saved.mcap").code == RECOVERED


def test_a_recovery_that_fails_leaves_what_was_there(small, tmp_path):
    content = Content(small)
    content.chunks[0][0][1][0, PREFIX + 1 : PREFIX + 9] = list(np.float64(-1.0).tobytes())  # the time t
    del content.metadata["closing"]
    strange = content.write(tmp_path / "strange.mcap")
    saved = Path(shutil.copy(small, tmp_path / "saved.mcap"))
    assert recover(strange, saved).code == BROKEN
    assert saved.read_bytes() == small.read_bytes()
    assert {file.name for file in tmp_path.iterdir()} == {"strange.mcap", "saved.mcap"}


def test_info(small, chunked, tmp_path):
    about = info(small)
    assert (about.log.complete, about.log.closing["steps"], about.start, about.end) == (True, 100, 0.0, 0.1)
    assert about.log.size == small.stat().st_size
    links = about.topics["/left_track/links"]
    assert (links.messages, links.last) == (21, 0.1)
    assert about.attachments == {name: len(content) for name, content in ATTACHMENTS.items()}
    with Log(small) as log:
        assert about.digest == log.digest()
    (tmp_path / "cut.mcap").write_bytes(chunked.read_bytes()[:200_000])
    about = info(tmp_path / "cut.mcap")
    assert (about.log.complete, about.log.closing, bool(about.log.faults)) == (False, None, True)


def with_summary(data, summary):
    """A file with another summary and its checksum; no offsets of groups."""
    start = int.from_bytes(data[-28:-20], "little")
    footer = bytes([0x02]) + (20).to_bytes(8, "little") + start.to_bytes(8, "little") + bytes(8)
    crc = zlib.crc32(footer, zlib.crc32(summary))
    return data[:start] + summary + footer + crc.to_bytes(4, "little") + data[-8:]


def test_a_summary_that_lacks_a_record_is_not_used_and_a_changed_one_is_told(small, tmp_path):
    data, path = small.read_bytes(), tmp_path / "summary.mcap"
    at, kept = int.from_bytes(data[-28:-20], "little"), []
    while data[at] < 0x0E and data[at] != 0x02:
        end = at + 9 + int.from_bytes(data[at + 1 : at + 9], "little")
        kept.append(data[at:end])
        at = end
    whole = b"".join(kept)
    with Log(small) as log:
        topics, hashes = log.topics, log.hashes()
    path.write_bytes(with_summary(data, whole))
    with Log(path) as log:
        assert (log.complete, log.topics) == (True, topics)
    path.write_bytes(with_summary(data, whole.replace(b'"rad"', b'"deg"', 1)))
    with Log(path) as log:
        assert log.topics != topics, "a summary that is changed with its checksum is used"
    assert verify(path).code == BROKEN
    for missing in {record[0] for record in kept} - {0x0B}:
        first = next(k for k, record in enumerate(kept) if record[0] == missing)
        path.write_bytes(with_summary(data, b"".join(kept[:first] + kept[first + 1 :])))
        with Log(path) as log:
            assert (log.topics, log.hashes(), log.attachments) == (topics, hashes, tuple(ATTACHMENTS)), missing


def test_a_damaged_channel_is_read_from_its_copy_at_the_end(small, tmp_path):
    path = tmp_path / "bad.mcap"
    path.write_bytes(small.read_bytes().replace(b'["speed"', b'["spee"d', 1))
    with Log(path, by_index=False) as walked, Log(path) as log:
        assert walked.faults
        assert walked.topics == log.topics
        assert {one: [*zip(about.names, about.units, strict=True)] for one, about in log.topics.items()} == TOPICS


def repeated(content):
    number, rows, times = content.chunks[0][0]
    content.chunks[0][0] = number, np.repeat(rows, 2, axis=0), np.repeat(times, 2)


def shortened(content):
    number, rows, times = content.chunks[0][0]
    shorter = rows[:, :-1].copy()
    shorter[:, 1:9] = np.frombuffer((rows.shape[1] - 10).to_bytes(8, "little"), np.uint8)
    content.chunks[0][0] = number, shorter, times


@pytest.mark.parametrize("change", [repeated, shortened])
def test_messages_that_cannot_be_are_refused(small, tmp_path, change):
    content = Content(small)
    change(content)
    path = content.hash_again().write(tmp_path / "strange.mcap")
    with Log(path) as log, pytest.raises(LogUnreadable):
        log.read(content.channels[content.chunks[0][0][0]][0])


def test_an_attachment_is_checked_by_its_checksum_or_its_digest(small, tmp_path):
    """A log that was cut off has no digests; with one, an attachment that was written anew is told when it is read."""
    content, scene = Content(small), ATTACHMENTS["scene.json"]
    content.attachments["scene.json"] = scene.replace(b"small", b"smell")
    content.write(tmp_path / "edited.mcap", old_seal=True)
    content.attachments["scene.json"] = scene
    del content.metadata["closing"]
    cut = content.write(tmp_path / "cut.mcap")
    cut.write_bytes(cut.read_bytes().replace(scene, scene.replace(b"small", b"smell")))
    for name in ("edited", "cut"):
        with Log(tmp_path / f"{name}.mcap", unfinished=True) as log, pytest.raises(LogUnreadable):
            log.attachment("scene.json")


# --- recovered runs ----------------------------------------------------------------------------------


def recorded(path, scene, track, *settings):
    """Log of a run in chunks of a few steps."""
    with pytest.MonkeyPatch.context() as patch:
        for one in (page, module):
            patch.setattr(one, "CHUNK", 6_000)
        assert simulate(load(scene, track, (*settings, "expect={}")), path)["status"] == "ok"
    return path


@pytest.mark.long
@pytest.mark.parametrize("outputs", [1, 3])
def test_what_is_left_of_a_run_is_as_good_as_a_shorter_run(tmp_path, outputs):
    """Wherever a log is cut, the recovered one is compared, balanced, replayed and drawn like any other."""

    def run(n):
        settings = (f"run.stop={n * 1e-3}", "run.links=4", f"run.outputs={outputs}", "drive.ramp_start=0")
        return recorded(tmp_path / f"rig-{n}.mcap", "rig", "rigid", *settings)

    whole, lasts = run(30), set()
    data, broken, saved = whole.read_bytes(), tmp_path / "cut.mcap", tmp_path / "saved.mcap"
    edges = [at for begin, end, *_ in spans(data) for at in (begin, end)]
    cuts = sorted({*np.linspace(edges[0], edges[-1] - 1, 8).astype(int).tolist(), *edges})
    for number, cut in enumerate(cuts):
        broken.write_bytes(data[:cut])
        assert recover(broken, saved).code == RECOVERED
        assert verify(saved).code == WHOLE
        with Log(saved, unfinished=True) as left, Log(whole) as reference:
            lasts.add(n := left.closing["steps"])
            if n < outputs:
                continue  # the outputs of no step are left to compare
            books, apart = ledger(RunData(left)), differences(RunData(left), RunData(reference))
            assert np.isfinite(books.residual)
            assert apart.keys() & {"torque", "position", "chain_speed"}
            assert all(one.relative < 1e-9 for key, one in apart.items() if not key.endswith(("_mean", "_rms"))), cut
            if number % 13 == 0:
                with Log(run(n)) as shorter:
                    own = {topic: one for topic, one in left.hashes().items() if "stats" not in topic}
                    assert own.items() <= shorter.hashes().items()
                    assert ledger(RunData(shorter)) == books
        for name in ("track", "drive") if number % 13 == 0 else ():
            with replay_model.open_replay(saved, name, None) as again:
                verdict = again.verify()
            assert (verdict.equal, verdict.steps) == (True, n), verdict.sentence
            draw_side(saved, tmp_path / "view.png")
    assert len(lasts) > 5


def test_steps_that_are_lost_are_no_shorter_run(tmp_path):
    """A log without a chunk in its middle has no balance; what it holds is compared."""
    whole = recorded(tmp_path / "chain.mcap", "hanging_chain", "flexible", "run.stop=0.1", "chain.links=8")
    data = bytearray(whole.read_bytes())
    data[spans(data)[1][0] + 100] ^= 4
    (tmp_path / "bad.mcap").write_bytes(data)
    assert recover(tmp_path / "bad.mcap", tmp_path / "saved.mcap").code == RECOVERED
    with Log(tmp_path / "saved.mcap", unfinished=True) as log, Log(whole) as reference:
        assert log.closing["steps"] == 100
        with pytest.raises(LookupError, match=r"lacks the inputs of 'chain' from t = 0\.0\d+ to 0\.0\d+ s"):
            ledger(RunData(log))
        assert "pins" in differences(RunData(log), RunData(reference))
