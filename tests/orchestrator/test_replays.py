"""Replay steps our own build or an FMU that the user names; answers can be replayed in turn."""

import hashlib
import json
import zipfile
from pathlib import Path

import pytest
from mutated import Content

from fmus.fmi.build import build, identity
from fmus.vehicles.tables import BadInput
from orchestrator.execution import replay_model, replays
from orchestrator.execution.simulate import simulate
from orchestrator.log import tools
from orchestrator.log.container import LogUnreadable
from orchestrator.log.export import export
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.log.tools import BROKEN, WHOLE, verify
from orchestrator.results.answer_comparison import answers
from orchestrator.results.difference import differences
from orchestrator.results.run_data import RunData
from orchestrator.results.views.flat_views import draw_side
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load

SETTINGS = ("run.stop=0.02", "chain.links=8", "run.links=7", "expect={}")


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Log of a hanging chain of eight links."""
    path = tmp_path_factory.mktemp("replay") / "chain.mcap"
    assert simulate(load("hanging_chain", "flexible", SETTINGS), path)["status"] == "ok"
    return path


def altered(log, path, change):
    """The log with another system.json and scene.json; all checksums are valid."""
    content = Content(log)
    tables = {name: json.loads(content.attachments[f"{name}.json"]) for name in ("system", "scene")}
    change(**tables)
    content.attachments |= {f"{name}.json": json.dumps(table).encode() for name, table in tables.items()}
    return content.write(path)


def fmu_of(log):
    """Our own build of the chain."""
    with Log(log) as opened:
        (part,) = assemble(replay_model._scene(opened)).parts
    return build(part.kind, part.config)


def test_an_fmu_that_only_the_log_vouches_for_is_not_run(log, tmp_path):
    """An FMU that only the log vouches for is not run: the log of a stranger names it, with its hash."""
    mark, stranger = tmp_path / "ran", tmp_path / "stranger.fmu"
    with zipfile.ZipFile(fmu_of(log)) as ours, zipfile.ZipFile(stranger, "w") as theirs:
        for name in ours.namelist():
            content = ours.read(name)
            if name.endswith("track_flexible_fmu.py"):
                content = f"open({str(mark)!r}, 'w').close()\n".encode() + content
            theirs.writestr(name, content)

    def named(system, scene):
        system["instances"][0] |= {
            "path": str(stranger), "sha256": hashlib.sha256(stranger.read_bytes()).hexdigest()
        }  # fmt: skip

    strange = altered(log, tmp_path / "strange.mcap", named)
    assert verify(strange).code == WHOLE
    said = "another build of 'TrackFlexible.fmu': name an FMU with --with"
    with pytest.raises(BadInput, match=said), replay_model.open_replay(strange, "chain", None):
        pass
    with replay_model.open_replay(strange, "chain", "rigid") as again:
        assert again.model.fmu.name == "TrackRigid.fmu"
    assert not mark.exists()


def test_replay_builds_what_it_steps(log):
    with replay_model.open_replay(log, "chain", None) as again:
        assert identity(again.model.fmu) == identity(fmu_of(log))
        verdict = again.verify()
    assert verdict.equal, verdict.sentence
    assert verdict.steps == 20
    with Log(log) as opened:
        assert "path" not in json.loads(opened.attachment("system.json"))["instances"][0]


@pytest.mark.long
@pytest.mark.parametrize("other", ["rigid", "fmu"])
def test_an_answer_holds_what_answered_and_can_be_replayed(log, tmp_path, other):
    rigid = build("TrackRigid", assemble(load("hanging_chain", "rigid", SETTINGS)).parts[0].config)
    given = other if other == "rigid" else tmp_path / "mine.fmu"
    if other == "fmu":
        given.write_bytes(rigid.read_bytes())
    answer = tmp_path / "answer.mcap"
    with replay_model.open_replay(log, "chain", str(given)) as again:
        assert not again.model.as_recorded
        again.answer(answer)
    assert verify(answer).code == WHOLE
    with Log(log) as source, Log(answer) as log_of_answer:
        assert log_of_answer.metadata["replay"] == {
            "of": str(log), "digest": source.digest(), "component": "chain"
        }  # fmt: skip
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
        with pytest.raises(BadInput, match="does not say of which scene"):
            draw_side(answer, tmp_path / "answer.png")
        with pytest.raises(BadInput, match="name its FMU with --with"), replay_model.open_replay(answer, "chain", None):
            pass
    with replay_model.open_replay(answer, "chain", None if other == "rigid" else str(given)) as again:
        assert again.model.as_recorded
        verdict = again.verify()
        assert verdict.equal, verdict.sentence
        twin = again._replace(parameters={**again.parameters, "start.position.x": 1e-12}).verify()
    assert not twin.equal


def test_an_fmu_file_that_is_what_ran_is_compared(log, tmp_path):
    copy = tmp_path / "copy.fmu"
    copy.write_bytes(fmu_of(log).read_bytes())
    with replay_model.open_replay(log, "chain", str(copy)) as again:
        assert again.model.as_recorded
        assert again.verify().equal
        again.answer(tmp_path / "own.mcap")
    with Log(log) as one, Log(tmp_path / "own.mcap") as two:
        assert two.table("scene.json") == one.table("scene.json")
        for topic in ("/chain/in", "/chain/out", "/chain/links"):
            assert two.hashes()[topic] == one.hashes()[topic]


@pytest.mark.long
def test_other_numbers_answer_to_the_same_inputs(log, tmp_path):
    """Other numbers give the run with those numbers, to the bit, because a chain has no inputs."""
    heavier = "vehicle.gravity=10.0"
    run = tmp_path / "run.mcap"
    assert simulate(load("hanging_chain", "flexible", (*SETTINGS, heavier)), run)["status"] == "ok"
    answer = tmp_path / "answer.mcap"
    with replay_model.open_replay(log, "chain", None, settings=[heavier]) as again:
        assert not again.model.as_recorded
        assert again.answer(answer) == 20
    assert verify(answer).code == WHOLE
    with Log(log) as source, Log(answer) as mine, Log(run) as theirs:
        assert mine.metadata["replay"]["set"] == heavier
        assert mine.table("scene.json") == theirs.table("scene.json") != source.table("scene.json")
        for topic in ("/chain/out", "/chain/links"):
            assert mine.hashes()[topic] == theirs.hashes()[topic] != source.hashes()[topic]
        (tension,) = (one for one in answers(source, mine, "chain", (0.0, 0.01)) if one.signal == "tension.max")
    assert tension.t[-1] == pytest.approx(0.01)
    assert tension.answered == pytest.approx(tension.recorded * 10.0 / 9.81, rel=1e-4)
    with replay_model.open_replay(answer, "chain", None) as again:
        assert again.model.as_recorded
        assert again.verify().equal
    with replay_model.open_replay(log, "chain", None, settings=["vehicle.gravity=9.81"]) as again:
        assert again.model.as_recorded, "nothing was changed, so the recorded model must run"
        assert again.answer(tmp_path / "half.mcap", 0.01) == 10


@pytest.mark.study
def test_an_answer_of_native_fmus_is_replayed_by_native_fmus(tmp_path):
    scene = load("rig", "rigid", ("run.stop=0.02", "expect={}", "drive.ramp_start=0"))
    assert simulate(scene, tmp_path / "run.mcap", native=True)["status"] == "ok"
    with replay_model.open_replay(tmp_path / "run.mcap", "drive", None, settings=["drive.speed=1"]) as again:
        again.answer(tmp_path / "answer.mcap")
    with replay_model.open_replay(tmp_path / "answer.mcap", "drive", None) as again:
        assert again.model.native
        assert again.verify().equal


def test_a_replay_of_no_step_is_no_success(log, tmp_path):
    content = Content(log)
    content.chunks = []
    empty = content.hash_again().write(tmp_path / "empty.mcap")
    with (
        replay_model.open_replay(empty, "chain", None) as again,
        pytest.raises(replays.UnfitLog, match="does not hold the steps"),
    ):
        again.verify()
    content = Content(log)
    topics = {number: topic for number, (topic, _, _) in content.channels.items()}
    content.chunks = [
        [
            (number, rows[:1], times[:1])
            for number, rows, times in content.chunks[0]
            if topics[number] in ("/chain/out", "/chain/links")
        ]
    ]
    start = content.hash_again().write(tmp_path / "start.mcap")
    with replay_model.open_replay(start, "chain", None) as again:
        verdict = again.verify()
        assert (verdict.steps, verdict.difference, verdict.equal) == (0, None, False)
        assert verdict.sentence.startswith("nothing was compared: the log holds 0 steps")
        assert again.answer(tmp_path / "answer.mcap") == 0
    assert not (tmp_path / "answer.mcap").exists()


def test_a_log_that_was_cut_off_is_replayed_as_far_as_all_of_it_goes(log, tmp_path):
    content = Content(log)
    topics = {number: topic for number, (topic, _, _) in content.channels.items()}
    content.chunks = [
        [
            (number, *(each[:7] for each in part)) if topics[number] == "/chain/in" else (number, *part)
            for number, *part in content.chunks[0]
        ]
    ]
    del content.metadata["closing"]
    ragged = content.write(tmp_path / "ragged.mcap")
    with replay_model.open_replay(ragged, "chain", None) as again, pytest.raises(replays.UnfitLog, match="log recover"):
        again.verify()
    assert tools.recover(ragged, tmp_path / "saved.mcap").code == tools.RECOVERED
    with replay_model.open_replay(tmp_path / "saved.mcap", "chain", None) as again:
        verdict = again.verify()
    assert (verdict.equal, verdict.steps) == (True, 7), verdict.sentence


def test_names_in_a_log_lead_nowhere(log, tmp_path):
    """Names of instances, attachments and topics in a log create no files; only requested ones exist."""
    content = Content(log)
    scene, system = (json.loads(content.attachments[name]) for name in ("scene.json", "system.json"))
    system["instances"][0]["name"] = "../../evil"
    system["instances"][0]["fmu"] = "../../../evil.fmu"
    content.attachments = {
        "scene.json": json.dumps(scene | {"title": "../../$\\frac$"}).encode(),
        "system.json": json.dumps(system).encode(),
        "../../evil": b"x",
        "/tmp/evil": b"x",
    }
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
    with pytest.raises((BadInput, LogUnreadable, replays.UnfitLog)), replay_model.open_replay(evil, "../../evil", None):
        pass
    copy = tmp_path / "copy.fmu"
    copy.write_bytes(fmu_of(log).read_bytes())
    with replay_model.open_replay(evil, "../../evil", str(copy)) as again:  # the user trusts this one
        again.answer(inner / "answer.mcap")
    allowed = {inner / "csv", *files, inner / "saved.mcap", inner / "answer.mcap", copy}
    assert set(tmp_path.rglob("*")) - before <= allowed


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda system, scene: system.update(instances=7), "system.json: instances = 7"),
        (lambda system, scene: system["instances"].append(system["instances"][0]), "two instances have one name"),
        (lambda system, scene: system["instances"][0].update(name="track"), "no component 'chain': one of track"),
        (lambda system, scene: system["instances"][0].pop("sha256"), "was stepped without an FMU"),
        (lambda system, scene: system["instances"][0].update(parameters={"x": 10**400}), "parameters"),
        (lambda system, scene: scene.update(vehicle="/etc/passwd"), "scene.json: vehicle = '/etc/passwd'"),
        (lambda system, scene: scene["run"].update(step=10**400), "run.step = 99999"),
        (lambda system, scene: scene.update(assembly="pendulum"), "scene.json"),
        (lambda system, scene: scene.update(assembly=["x"]), "assembly = ['x']"),
        (lambda system, scene: scene.clear(), "assembly = None"),
    ],
)
def test_a_scene_or_system_that_cannot_be_is_refused_in_a_sentence(log, tmp_path, change, said):
    forged = altered(log, tmp_path / "forged.mcap", change)
    refusal = (BadInput, LogUnreadable, replays.UnfitLog)
    with pytest.raises(refusal) as caught, replay_model.open_replay(Path(forged), "chain", None):
        pass
    assert said.replace("99999", str(10**400)[:5]) in str(caught.value)
    assert len(str(caught.value)) < 400


def test_a_log_of_another_version_can_be_drawn(log, tmp_path):
    """A log of another version can be drawn: unknown keys, missing keys; but no absurd numbers."""

    def older(system, scene):
        scene["vehicle"]["sprocket"]["colour"] = "red"
        del scene["vehicle"]["material"], scene["run"]

    draw_side(altered(log, tmp_path / "older.mcap", older), tmp_path / "older.png")
    for key, value in (("teeth", 10**9), ("outer_radius", "x"), ("pin_radius", float("nan"))):

        def wild(system, scene, key=key, value=value):
            scene["vehicle"]["sprocket"][key] = value

        with pytest.raises(BadInput, match=rf"scene\.json: vehicle\.sprocket\.{key} = "):
            draw_side(altered(log, tmp_path / "wild.mcap", wild), tmp_path / "wild.png")


def test_a_run_that_blew_up_is_compared_in_silence(log, tmp_path, recwarn):
    with Log(log) as whole:
        topics = {topic: list(zip(about.names, about.units, strict=True)) for topic, about in whole.topics.items()}
        attachments = {name: whole.attachment(name) for name in whole.attachments}
        with Recorder(tmp_path / "blown.mcap", topics, attachments, whole.metadata) as recorder:
            for topic in topics:
                series = whole.read(topic)
                for k, sequence in enumerate(whole.sequence(topic).tolist()):
                    recorder.write(topic, sequence, series.t[k], series.h[k], series.values[k] * 1e200 * k)
            recorder.close("failed", "blown up", 20)
        with Log(tmp_path / "blown.mcap") as blown:
            apart = differences(RunData(blown), RunData(whole))
    assert apart["tension"].relative > 1e100
    assert not [each for each in recwarn if issubclass(each.category, RuntimeWarning)]


def test_one_bit_of_an_input_is_named_where_it_is(tmp_path):
    """A changed bit of an input is named: a sprocket that differs by one ULP at step 40.

    The replay of the drive says so, and that of the track, which received it.
    """
    settings = ("run.stop=0.08", "expect={}", "drive.ramp_start=0", "run.links=8")
    whole = tmp_path / "whole.mcap"
    assert simulate(load("rig", "rigid", settings), whole)["status"] == "ok"
    content = Content(whole)
    with Log(whole) as log:
        layout = log._recorded["/drive/out"].layout
        content.nudge(
            "/drive/out", int(layout.starts[log.topics["/drive/out"].names.index("sprocket.angular_velocity.y")]), 40
        )
    edited = content.write(tmp_path / "edited.mcap", old_seal=True)
    with pytest.raises(LogUnreadable, match=r"not as it was sealed: .*the record of /drive/out is changed"):
        replay_model.open_replay(edited, "drive", None).__enter__()
    nudged = content.hash_again().write(tmp_path / "nudged.mcap")
    for component, step in (("drive", 40), ("track", 41)):
        with replay_model.open_replay(whole, component, None) as again:
            assert again.verify((0.03, 0.06)).equal
        with replay_model.open_replay(nudged, component, None) as again:
            verdict = again.verify()
            assert again.verify((0.0, 0.001 * (step - 1))).difference is None
            assert again.verify((0.03, 0.06)).difference == verdict.difference
        assert not verdict.equal
        assert verdict.difference.step == step
    assert (verify(edited).code, verify(nudged).code) == (BROKEN, WHOLE)
