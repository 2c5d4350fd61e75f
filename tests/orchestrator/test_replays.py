"""Replay steps our own build or an FMU that the user names; answers are shown, compared and replayed in turn."""

import hashlib
import json
import shutil
import zipfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from made_logs import made
from mutated import Content, altered
from short_runs import CHAIN, SHORT, chain_log

from fmus.fmi.build import build, identity
from fmus.vehicles.tables import BadInput
from orchestrator.execution import replay_model, replays
from orchestrator.execution.simulate import simulate
from orchestrator.log import schema, tools
from orchestrator.log.container import LogUnreadable
from orchestrator.log.export import export, to_pandas
from orchestrator.log.reader import Log
from orchestrator.log.time_series import Series
from orchestrator.log.tools import BROKEN, WHOLE, verify
from orchestrator.results import replayed_outputs
from orchestrator.results.difference import differences
from orchestrator.results.run_data import RunData
from orchestrator.results.views.flat_views import draw_side
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load

REFUSED = BadInput, LogUnreadable, replays.UnfitLog


log = pytest.fixture(scope="module")(chain_log)


def fmu_of(track="flexible"):
    """Our own build of the chain."""
    (part,) = assemble(load("hanging_chain", track, CHAIN)).parts
    return build(part.kind, part.config)


def shortened(log, topics, kept):
    """Content of the log with the first ``kept`` rows of some topics."""
    content = Content(log)
    names = {number: topic for number, (topic, _, _) in content.channels.items()}
    content.chunks = [
        [(n, *(each[:kept] for each in part)) if names[n] in topics else (n, *part) for n, *part in piece]
        for piece in content.chunks
    ]
    return content


def replayed(path, component="chain", given=None, *window):
    """Verdict of a replay."""
    with replay_model.open_replay(path, component, given) as again:
        return again.verify(*window)


def test_an_fmu_that_only_the_log_vouches_for_is_not_run(log, tmp_path):
    """An FMU that only the log vouches for is not run: the log of a stranger names it, with its hash."""
    mark, stranger = tmp_path / "ran", tmp_path / "stranger.fmu"
    with zipfile.ZipFile(fmu_of()) as ours, zipfile.ZipFile(stranger, "w") as theirs:
        for name in ours.namelist():
            content = ours.read(name)
            if name.endswith("track_flexible_fmu.py"):
                content = f"open({str(mark)!r}, 'w').close()\n".encode() + content
            theirs.writestr(name, content)

    def named(system, scene):
        digest = hashlib.sha256(stranger.read_bytes()).hexdigest()
        system["instances"][0] |= {"path": str(stranger), "sha256": digest}

    strange = altered(log, tmp_path / "strange.mcap", named)
    assert verify(strange).code == WHOLE
    with pytest.raises(BadInput, match="another build"):
        replayed(strange)
    with replay_model.open_replay(strange, "chain", "rigid") as again:
        assert again.model.fmu.name == "TrackRigid.fmu"
    assert not mark.exists()


def test_replay_builds_what_it_steps(log):
    with replay_model.open_replay(log, "chain", None) as again:
        assert identity(again.model.fmu) == identity(fmu_of())
        verdict = again.verify()
    assert verdict.equal, verdict.sentence
    assert verdict.steps == 20
    with Log(log) as opened:
        assert "path" not in json.loads(opened.attachment("system.json"))["instances"][0]


@pytest.mark.long
@pytest.mark.parametrize("other", ["rigid", "fmu"])
def test_an_answer_holds_what_answered_and_can_be_replayed(log, tmp_path, other):
    rigid = fmu_of("rigid")
    given = other if other == "rigid" else tmp_path / "mine.fmu"
    if other == "fmu":
        given.write_bytes(rigid.read_bytes())
    answer = tmp_path / "answer.mcap"
    with replay_model.open_replay(log, "chain", str(given)) as again:
        assert not again.model.as_recorded
        again.record(answer)
    assert verify(answer).code == WHOLE
    with Log(log) as source, Log(answer) as log_of_answer:
        made = {"of": str(log), "digest": source.digest(), "component": "chain"}
        assert log_of_answer.metadata["replay"] == made
        (entry,) = log_of_answer.table("system.json")["instances"]
        assert entry["sha256"] == identity(rigid)
        assert entry["fmu"] == ("TrackRigid.fmu" if other == "rigid" else "mine.fmu")
        assert log_of_answer.topics["/chain/links"].every == 7
        assert differences(RunData(log_of_answer), RunData(source))["tension"].absolute > 0
        if other == "rigid":
            scene, theirs = (each.table("scene.json") for each in (log_of_answer, source))
            assert (scene["track"]["model"], theirs["track"]["model"]) == ("rigid", "flexible")
            assert scene["vehicle"] == theirs["vehicle"]
        else:
            assert "scene.json" not in log_of_answer.attachments, "the scene of that FMU is unknown"
    if other == "rigid":
        draw_side(answer, tmp_path / "answer.png")
    else:
        with pytest.raises(BadInput):
            draw_side(answer, tmp_path / "answer.png")
        with pytest.raises(BadInput):
            replayed(answer)
    with replay_model.open_replay(answer, "chain", None if other == "rigid" else str(given)) as again:
        assert again.model.as_recorded
        verdict = again.verify()
        assert verdict.equal, verdict.sentence
        twin = again._replace(parameters={**again.parameters, "start.position.x": 1e-12}).verify()
    assert not twin.equal


def test_an_fmu_file_that_is_what_ran_is_compared(log, tmp_path):
    copy = tmp_path / "copy.fmu"
    copy.write_bytes(fmu_of().read_bytes())
    with replay_model.open_replay(log, "chain", str(copy)) as again:
        assert again.model.as_recorded
        assert again.verify().equal
        again.record(tmp_path / "own.mcap")
    with Log(log) as one, Log(tmp_path / "own.mcap") as two:
        assert two.table("scene.json") == one.table("scene.json")
        for topic in ("/chain/in", "/chain/out", "/chain/links"):
            assert two.hashes()[topic] == one.hashes()[topic]


@pytest.mark.long
def test_other_numbers_answer_to_the_same_inputs(log, tmp_path):
    """Other numbers give the run with those numbers, to the bit, because a chain has no inputs."""
    heavier = "vehicle.gravity=10.0"
    run = tmp_path / "run.mcap"
    assert simulate(load("hanging_chain", "flexible", (*CHAIN, heavier)), run)["status"] == "ok"
    answer = tmp_path / "answer.mcap"
    with replay_model.open_replay(log, "chain", None, settings=[heavier]) as again:
        assert not again.model.as_recorded
        assert again.record(answer) == 20
    assert verify(answer).code == WHOLE
    with Log(log) as source, Log(answer) as mine, Log(run) as theirs:
        assert mine.metadata["replay"]["set"] == heavier
        assert mine.table("scene.json") == theirs.table("scene.json") != source.table("scene.json")
        for topic in ("/chain/out", "/chain/links"):
            assert mine.hashes()[topic] == theirs.hashes()[topic] != source.hashes()[topic]
        (tension,) = (
            one for one in replayed_outputs.compared(source, mine, "chain", (0.0, 0.01)) if one.signal == "tension.max"
        )
    assert tension.t[-1] == pytest.approx(0.01)
    assert tension.replayed == pytest.approx(tension.recorded * 10.0 / 9.81, rel=1e-4)
    assert replayed(answer).equal
    with replay_model.open_replay(log, "chain", None, settings=["vehicle.gravity=9.81"]) as again:
        assert again.model.as_recorded, "nothing was changed, so the recorded model must run"
        assert again.record(tmp_path / "half.mcap", 0.01) == 10


def test_a_replay_of_no_step_is_no_success(log, cotrack, tmp_path):
    content = shortened(log, ("/chain/out", "/chain/links"), 1)
    content.chunks = [[part for part in piece if len(part[1]) == 1] for piece in content.chunks]
    start = content.hash_again().write(tmp_path / "start.mcap")
    with replay_model.open_replay(start, "chain", None) as again:
        verdict = again.verify()
        assert (verdict.steps, verdict.difference, verdict.equal) == (0, None, False)
        assert again.record(tmp_path / "answer.mcap") == 0
    assert not (tmp_path / "answer.mcap").exists()
    for more, said in ((), "nothing was compared"), (("--with", "rigid", "-o", "b.mcap"), "holds no step of 'chain'"):
        status, out, err = cotrack("replay", start, "--component", "chain", *more)
        assert status == 1
        assert said in out + err
    assert not (tmp_path / "b.mcap").exists()
    content.chunks = []
    none = content.hash_again().write(tmp_path / "none.mcap")
    with pytest.raises(replays.UnfitLog):
        replayed(none)
    for command in (("compare", none, log), ("view", none, "-o", "v.png")):
        assert cotrack(*command)[0] == 2


def test_a_log_that_was_cut_off_or_has_a_gap_is_replayed_as_far_as_all_of_it_goes(log, tmp_path):
    content = shortened(log, ("/chain/in",), 7)
    del content.metadata["closing"]
    ragged = content.write(tmp_path / "ragged.mcap")
    with pytest.raises(replays.UnfitLog, match="log recover"):
        replayed(ragged)
    assert tools.recover(ragged, tmp_path / "saved.mcap").code == tools.RECOVERED
    verdict = replayed(tmp_path / "saved.mcap")
    assert (verdict.equal, verdict.steps) == (True, 7), verdict.sentence
    content = Content(log)
    content.chunks = [
        [(number, *(np.delete(each, (7, 8), axis=0) if len(rows) > 9 else each for each in (rows, times)))
         for number, rows, times in piece]
        for piece in content.chunks
    ]  # fmt: skip
    gap = content.hash_again().write(tmp_path / "gap.mcap")
    with pytest.raises(replays.UnfitLog, match=r"lacks its inputs from t = 0\.007 to 0\.009 s"):
        replayed(gap)


def test_names_in_a_log_lead_nowhere(log, tmp_path):
    """Names of instances, attachments and topics in a log create no files; only requested ones exist."""
    content = Content(log)
    scene, system = (json.loads(content.attachments[name]) for name in ("scene.json", "system.json"))
    system["instances"][0]["name"] = "../../evil"
    system["instances"][0]["fmu"] = "../../../evil.fmu"
    tables = {"scene.json": scene | {"title": "../../$\\frac$"}, "system.json": system}
    content.attachments = {name: json.dumps(table).encode() for name, table in tables.items()}
    content.attachments |= {"../../evil": b"x", "/tmp/evil": b"x"}
    for number, (topic, described, about) in content.channels.items():
        content.channels[number] = (topic.replace("chain", "../../evil"), described, about)
    inner = tmp_path / "a" / "b" / "c"
    inner.mkdir(parents=True)
    evil = content.hash_again().write(inner / "evil.mcap")
    before = set(tmp_path.rglob("*"))
    files = export(evil, inner / "csv")
    assert len(set(files)) == 4
    assert all(file.resolve().parent == (inner / "csv").resolve() for file in files)
    tools.recover(evil, inner / "saved.mcap")
    with pytest.raises(REFUSED):
        replayed(evil, "../../evil")
    copy = tmp_path / "copy.fmu"
    copy.write_bytes(fmu_of().read_bytes())
    with replay_model.open_replay(evil, "../../evil", str(copy)) as again:  # the user trusts this one
        again.record(inner / "answer.mcap")
    allowed = {inner / "csv", *files, inner / "saved.mcap", inner / "answer.mcap", copy}
    assert set(tmp_path.rglob("*")) - before <= allowed


def test_a_log_of_another_version_can_be_drawn(log, tmp_path):
    """A log of another version can be drawn: unknown keys, missing keys; but no absurd numbers."""

    def older(system, scene):
        scene["vehicle"]["sprocket"]["colour"] = "red"
        del scene["vehicle"]["material"], scene["run"]

    draw_side(altered(log, tmp_path / "older.mcap", older), tmp_path / "older.png")
    for change in ({"teeth": 10**9}, {"outer_radius": "x"}, {"pin_radius": float("nan")}):

        def wild(system, scene, change=change):
            scene["vehicle"]["sprocket"].update(change)

        with pytest.raises(BadInput):
            draw_side(altered(log, tmp_path / "wild.mcap", wild), tmp_path / "wild.png")


def test_one_bit_of_an_input_is_named_where_it_is(tmp_path):
    """A changed bit of an input is named: a sprocket that differs by one ULP at step 50.

    The replay of the drive says so, and that of the track, which received it.
    """
    settings = ("run.stop=0.08", "expect={}", "drive.ramp_start=0", "run.links=8")
    whole = tmp_path / "whole.mcap"
    assert simulate(load("rig", "rigid", settings), whole)["status"] == "ok"
    content = Content(whole)
    with Log(whole) as log:
        names = log.topics["/drive/out"].names
    place = schema.layout(schema.places(names)).starts[names.index("sprocket.angular_velocity.y")]
    content.nudge("/drive/out", int(place), 50)
    edited = content.write(tmp_path / "edited.mcap", old_seal=True)
    with pytest.raises(LogUnreadable):
        replayed(edited, "drive")
    nudged = content.hash_again().write(tmp_path / "nudged.mcap")
    for component, step in (("drive", 50), ("track", 51)):
        assert replayed(whole, component, None, (0.03, 0.06)).equal
        with replay_model.open_replay(nudged, component, None) as again:
            verdict = again.verify()
            assert again.verify((0.0, 0.001 * (step - 1))).difference is None
            assert again.verify((0.03, 0.06)).difference == verdict.difference
        assert not verdict.equal
        assert verdict.difference.step == step
    assert (verify(edited).code, verify(nudged).code) == (BROKEN, WHOLE)


def test_another_fmu_may_have_its_inputs_in_another_order(monkeypatch):
    """It starts with those of the first step; one with other inputs is refused."""
    recorded = Series(np.array([0.0, 1.0]), np.ones(2), ("a", "b"), np.array([[1.0, 2.0], [3.0, 4.0]]))
    component = SimpleNamespace(name="x", inputs=("b", "a"))
    assert replays.inputs_of(component, recorded).values.tolist() == [[2.0, 1.0], [4.0, 3.0]]
    assert replays.inputs_of(SimpleNamespace(name="x", inputs=("a", "b")), recorded) is recorded
    with pytest.raises(replays.UnfitLog, match=r"not those of the log \(c\)"):
        replays.inputs_of(SimpleNamespace(name="x", inputs=("a", "b", "c")), recorded)
    monkeypatch.setattr(replay_model, "built_here", lambda fmu: False)
    log = SimpleNamespace(topics={"/x/in": None}, read=lambda topic: recorded)
    for as_recorded, first in ((False, {"a": 1.0, "b": 2.0}), (True, {})):
        model = SimpleNamespace(as_recorded=as_recorded, fmu=Path("mine.fmu"))
        assert replay_model._first_inputs(log, component, model) == first


# --- commands ----------------------------------------------------------------------------------------


@pytest.mark.long
def test_replays_with_another_model_other_numbers_and_of_answers(cotrack, tmp_path):
    assert cotrack(*SHORT, "--log", "a.mcap")[0] == 0
    replay = ("replay", "a.mcap", "--component", "chain")
    out = cotrack.done("replay", "a.mcap", "--with", "rigid", "--picture", "x.png")
    assert "tension.max" in out
    assert (out.splitlines()[-1], Path("x.png").stat().st_size > 10_000) == ("x.png", True)
    with Log(tmp_path / "a-chain-rigid.mcap") as log:
        assert len(log.read("/chain/out").t) == 21
    out = cotrack.done(*replay, "--set", "vehicle.gravity=10")
    assert out.splitlines()[-1] == "log a-chain-vehicle.gravity=10.mcap"
    assert next(line for line in out.splitlines() if line.startswith("tension.max")).split()[-1] == "0.0000"
    assert cotrack.done(*replay, "--set", "vehicle.gravity=9.81").startswith("equal: ")
    assert cotrack.done("replay", "a-chain-rigid.mcap", "--component", "chain").startswith("equal: ")
    with replay_model.open_replay(Path("a.mcap"), "chain", None) as again:
        shutil.copy(again.model.fmu, "mine.fmu")
    assert cotrack.done(*replay, "--with", "mine.fmu").startswith("equal: "), "the file is not what ran"
    out = cotrack.done("replay", "a-chain-rigid.mcap", "--component", "chain", "--with", "mine.fmu")
    assert out.splitlines()[-1] == "log a-chain-rigid-chain-mine.mcap"


@pytest.mark.parametrize(
    ("window", "said"),
    [
        (("--from", "0.02", "--to", "0.01"), "from 0.02 to 0.01: the first instant must not be after the last"),
        (("--from", "3", "--to", "4"), "from 3 to 4: the run is recorded from 0 to 0.02 s"),
    ],
)
def test_a_window_outside_of_the_run_is_refused_by_every_command(cotrack, tmp_path, window, said):
    assert cotrack(*SHORT, "--no-estimate", "--log", "a.mcap")[0] == 0
    for command in (
        ("replay", "a.mcap"), ("log", "export", "a.mcap", "-o", "e.csv", "--topic", "/chain/out"),
        ("view", "a.mcap", "-o", "f.gif"), ("plot", "a.mcap", "chain.speed", "-o", "p.png"),
        ("compare", "a.mcap", "a.mcap"), ("compare", "a.mcap", "a.mcap", "--map", "chain.speed=chain.speed"),
        ("analyse", "a.mcap", "validity"),
    ):  # fmt: skip
        assert said in cotrack.refused(*command, *window), command
    with pytest.raises(LookupError, match=said), Log("a.mcap") as log:
        to_pandas(log, "chain.speed", window=(float(window[1]), float(window[3])))
    assert not [file for file in tmp_path.iterdir() if file.suffix in (".csv", ".gif", ".png")]
    assert cotrack("log", "export", "a.mcap", "-o", "e.csv", "--topic", "/chain/out", "--from", "0.02")[0] == 0


@pytest.mark.long
def test_different_scenes_are_compared_when_asked(cotrack):
    for name, *settings in (
        ("a",), ("b", "--track", "rigid", "--step", "2 ms", "--coupling", "jacobi"),
        ("c", "--set", "vehicle.gravity=9.9"), ("d", "--set", "chain.span=0.7"),
        ("e", "--set", "name=mine", "--set", "expect.rest.expected=3"),
    ):  # fmt: skip
        assert cotrack(*SHORT, "--no-estimate", *settings, "--log", f"{name}.mcap")[0] in (0, 1)
    for same in ("b", "e"):
        assert "pins" in cotrack.done("compare", f"{same}.mcap", "a.mcap")
    for other, apart in (("c", "vehicle.gravity = 9.9 and 9.8"), ("d", "chain.span = 0.7 and 0.8")):
        said = f"{other}.mcap ('hanging_chain') and a.mcap ('hanging_chain') are runs of different scenes: {apart}"
        assert said in cotrack.refused("compare", f"{other}.mcap", "a.mcap")
        assert cotrack("compare", f"{other}.mcap", "a.mcap", "--different")[0] == 0
    assert "runs of different scenes: assembly" in cotrack.refused("truth", "rig", "--against", "a.mcap")


# --- recorded and answered, with known differences ---------------------------------------------------

T = 0.001 * np.arange(101)
FORCE = 100.0 * np.sin(2.0 * np.pi * 20.0 * T)


def wrote(path, rows, every=1, names=("sprocket.force.x", "none", "own")):
    topic = {"/left_track/out": [(name, "N") for name in names]}
    rows = {"/left_track/out": (T, np.stack(rows, axis=1))}
    return made(path, topic, rows, every={"/left_track/out": every})


@pytest.fixture
def answered(tmp_path):
    """A log of every second step, and an answer 3 N larger from 40 ms on and 7 N less at 50 ms."""
    now = FORCE + 3.0 * (T > 0.0395)
    now[50] = FORCE[50] - 7.0
    zero, log = np.zeros(len(T)), wrote(tmp_path / "a.mcap", (FORCE, 0 * T, 0 * T + 1.0), every=2)
    return log, wrote(tmp_path / "b.mcap", (now, zero, zero + 1.0), names=("sprocket.force.x", "none", "other"))


def test_peak_rms_and_parting(answered):
    with Log(answered[0]) as log, Log(answered[1]) as answer:
        (comparison,) = replayed_outputs.compared(log, answer, "left_track")
    assert (comparison.signal, comparison.unit, len(comparison.t)) == ("sprocket.force.x", "N", 51)
    assert comparison.peak == pytest.approx((-7.0, 0.05))
    assert comparison.parting_time == pytest.approx(0.04)
    assert comparison.largest == pytest.approx(abs(np.append(FORCE[::2], (FORCE + 3.0)[40::2])).max())
    row = replayed_outputs.lines([comparison])[1].split()
    n = np.count_nonzero(T[::2] > 0.0395) - 1
    assert float(row[4]) == pytest.approx(np.sqrt((9.0 * n + 49.0) / 51.0), rel=1e-4)
    assert float(row[2]) == pytest.approx(np.sqrt(np.mean(FORCE[::2] ** 2)), rel=1e-4)


def test_what_never_parts_says_so(tmp_path):
    same = wrote(tmp_path / "a.mcap", (FORCE, T, T))
    near = wrote(tmp_path / "b.mcap", (FORCE + 0.99, T, T))
    far = wrote(tmp_path / "c.mcap", (FORCE + 1.05, T, T))
    with Log(same) as log, Log(near) as one, Log(far) as other:
        assert np.isnan(replayed_outputs.compared(log, one, "left_track")[0].parting_time)
        assert "never" in replayed_outputs.lines(replayed_outputs.compared(log, one, "left_track"))[1]
        assert replayed_outputs.compared(log, other, "left_track")[0].parting_time == 0.0


def test_the_picture(answered, tmp_path):
    with Log(answered[0]) as log, Log(answered[1]) as answer:
        comparisons = replayed_outputs.compared(log, answer, "left_track")
    replayed_outputs.draw(comparisons, tmp_path / "x.png", "one & <other> $x$")
    assert (tmp_path / "x.png").stat().st_size > 10_000
    with pytest.raises(BadInput):
        replayed_outputs.draw(comparisons, tmp_path / "x.nothing", "")
