"""Links are recorded often enough to show tooth passings, or a warning says so; what is between records; memory."""

import math
import re
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.cosim.observers import MEANS
from orchestrator.execution import replay_model
from orchestrator.execution.resume import resume
from orchestrator.execution.simulate import NO_INPUTS, simulate
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.log.recorder import Recorder
from orchestrator.log.tools import WHOLE, verify
from orchestrator.results.difference import differences
from orchestrator.results.measures import FIGURES, OBSERVABLES
from orchestrator.results.run_data import RunData, Window
from orchestrator.scene.scene import load
from orchestrator.scene.system_scene import LONGEST_INTERVAL, NYQUIST, SAMPLES, aliasing_warning, links_every
from tests.benchmarks.process import isolated

STEPS, RATES = st.floats(1e-5, 1e-2), st.floats(0.1, 1e3)


@given(STEPS, RATES)
def test_ten_samples_a_tooth_or_every_step(step, teeth):
    every = links_every(step, teeth)
    assert every == 1 or 1.0 / (every * step * teeth) >= SAMPLES * (1.0 - 1e-9)
    assert every == LONGEST_INTERVAL or 1.0 / ((every + 1) * step * teeth) < SAMPLES, "more often than needed"
    assert every == 1 or not aliasing_warning(every, step, teeth)
    assert (links_every(step, 0.0), aliasing_warning(1000, step, 0.0)) == (LONGEST_INTERVAL, ""), "without teeth"


@given(STEPS, RATES, st.integers(1, 1000))
def test_the_frequency_that_shows_is_that_of_the_samples(step, teeth, every):
    sentence = aliasing_warning(every, step, teeth)
    assert bool(sentence) == (NYQUIST * teeth * every * step > 1.0)
    if sentence and (advice := re.search(r"; run\.links = (\d+) resolves it", sentence)):
        assert int(advice[1]) < every, "advised where it is set"
        assert not aliasing_warning(int(advice[1]), step, teeth), "it does not resolve it"
    elif sentence:
        advice = re.search(r"; --step (\S+)ms( with run\.links = 1)? resolves it$", sentence)
        assert bool(advice[2]) == (every > 1)
        assert not aliasing_warning(1, (1.0 - 1e-9) * 1e-3 * float(advice[1]), teeth)
        assert aliasing_warning(1, 2.0 * 1e-3 * float(advice[1]), teeth), "it is shorter than needed"
        assert aliasing_warning(1, step, teeth), "the twin: records of every step resolve it"
    if sentence and teeth * every * step < 1e3:
        shown = float(sentence.partition("shows at ")[2].split()[0])
        t = np.arange(200) * every * step
        own, seen = np.cos(2 * np.pi * teeth * t), np.cos(2 * np.pi * shown * t)
        assert shown <= 0.5 / (every * step) * (1 + 1e-3)
        if shown * t[-1] < 20.0:  # else four digits are too few for so many periods
            assert np.abs(own - seen).max() < 0.1


@pytest.mark.parametrize(("scene", "settings", "speed"), [
    ("straight", (), 20.0), ("turn", (), 12.0), ("pivot", (), 10.0), ("rig", (), 3.0), ("hanging_chain", (), 0.0),
    ("brake_turn", (), 10.0), ("differential", (), 10.0 + 0.5 * 4.0),  # of the side without brake; of both
    ("rig", ("drive.mode=torque", "drive.torque=10", "drive.speed=0"), 20.0),
    ("straight", ("drive.speed_points=[[0, 0], [1, -30], [2, 5]]", "drive.speed=0"), 30.0),
])  # fmt: skip
def test_top_speed_is_what_the_scene_asks_for(scene, settings, speed):
    variant = load(scene, None, settings)
    teeth = variant.vehicle.sprocket.teeth if speed else 0
    assert variant.teeth_rate == pytest.approx(teeth * speed / (2.0 * math.pi))
    assert load(scene, None, (*settings, "run.links=7")).links_every == 7


# --- records that are too sparse --------------------------------------------------------------------

# it drives off so fast that bodies penetrate each other
WILD = 'run.allow=["penetration", "tooth_jump"]'
BRIEF = (
    "run.stop=0.08", "run.step=1 ms", "expect={}", "drive.ramp_start=0", "drive.ramp_time=0.01", "drive.speed=40", WILD,
)  # fmt: skip
RARE = "run.links=20"  # 1 sample in 20 ms, 64 teeth per second


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Logs of the same run with links at every step and at one in 20."""
    folder = tmp_path_factory.mktemp("logs")
    logs = {}
    for name, links in (("all", "run.links=1"), ("rare", RARE)):
        logs[name] = folder / f"{name}.mcap"
        summary = simulate(load("rig", "rigid", (*BRIEF, "run.checkpoints=0.03", links)), logs[name])
        assert summary["status"] == "ok", summary["message"]
        assert len(summary["warnings"]) == (name == "rare")
    return logs


@pytest.mark.long
def test_seldom_records_say_what_happened_between_them(runs):
    with Log(runs["all"]) as log, Log(runs["rare"]) as rare:
        every, seldom = log.read("/track/links"), rare.read("/track/links/between")
        records = rare.read("/track/links")
        assert "/track/links/between" not in log.topics
        assert rare.unit("track.link[1].tension.most") == "N"
    n, means = every.values.shape[1], np.array([".force." in name for name in every.names])
    assert means.any()
    assert not means.all()
    mean, least, most = np.split(seldom.values, 3, axis=1)
    assert seldom.names[:1] + seldom.names[n : n + 1] == ("link[1].tension.mean", "link[1].tension.least")
    for k in range(1, 5):
        own = every.values[20 * k - 19 : 20 * k + 1]
        np.testing.assert_allclose(least[k], own.min(axis=0), rtol=1e-12, atol=1e-8)
        np.testing.assert_allclose(most[k], own.max(axis=0), rtol=1e-12, atol=1e-8)
        np.testing.assert_allclose(records.values[k, means], own[:, means].mean(axis=0), rtol=1e-12, atol=1e-8)
        np.testing.assert_array_equal(records.values[k, ~means], own[-1, ~means])
        assert np.abs(records.values[k, means] - own[-1, means]).max() > 1.0, "those of the last step"
        np.testing.assert_allclose(mean[k], own.mean(axis=0), rtol=1e-12, atol=1e-9)
        assert np.abs(mean[k] - every.values[20 * k - 20 : 20 * k].mean(axis=0)).max() > 1.0, "one step earlier"
    np.testing.assert_array_equal(most[0], every.values[0])


def test_what_happens_between_records_may_be_asked_for(tmp_path):
    path = tmp_path / "asked.mcap"
    summary = simulate(load("rig", "rigid", (*BRIEF, "run.links=2", "run.between=true")), path)
    assert (summary["status"], summary["warnings"]) == ("ok", [])
    with Log(path) as log:
        most, records = log.read("/track/links/between"), log.read("/track/links")
    n = len(records.names)
    assert most.names[2 * n] == "link[1].tension.most"
    assert (most.values[:, 2 * n] >= most.values[:, n]).all()
    np.testing.assert_array_equal(most.t, records.t)


@pytest.mark.long
def test_they_go_on_and_are_replayed_as_others(runs, tmp_path):
    assert verify(runs["rare"]).code == WHOLE
    resume(runs["rare"], tmp_path / "again.mcap", 0.045)
    with Log(runs["rare"]) as log, Log(tmp_path / "again.mcap") as again:
        assert again.metadata["resumed"]["step"] == "40", "checkpoints do not lie on records of links"
        assert again.digest() == log.digest()
    with replay_model.open_replay(runs["rare"], "track", None) as once_more:
        assert once_more.verify().equal


def test_a_run_without_recorded_inputs_records_little_and_is_not_repeated(tmp_path):
    sizes = {}
    for inputs in ("true", "false"):
        for stop in ("0.3", "1.3"):
            often = ("run.step=1 ms", "run.outputs=100", "run.links=100", "expect={}")
            changes = (f"run.stop={stop}", f"run.inputs={inputs}", *often)
            path = tmp_path / f"{stop}.mcap"
            result = simulate(load("rig", "rigid", changes), path)
            assert result["status"] == "ok"
            sizes[inputs, stop] = path.stat().st_size
        warned = [entry["text"] for entry in result["warnings"]]
        assert (result["energy"] is None, warned == [NO_INPUTS]) == (inputs == "false", inputs == "false")
    with_inputs, without = (sizes[inputs, "1.3"] - sizes[inputs, "0.3"] for inputs in ("true", "false"))
    # ten rows take some 48 kB, a little more or less as the clock closes chunks, each with its index
    assert without < 55_000
    assert with_inputs > 5 * without
    assert verify(path).code == WHOLE
    with Log(path) as log:
        assert not [topic for topic in log.topics if topic.endswith("/in")]
        assert not [name for name in log.attachments if name.startswith("checkpoint")]
        assert len(log.read("/track/out").t) == 14
    with pytest.raises(LogUnreadable, match=r"its inputs were not recorded \(run\.inputs = false\)"):
        resume(path, tmp_path / "more.mcap")
    with pytest.raises(LogUnreadable), replay_model.open_replay(path, "track", None):
        pass


# --- every figure of every step and of every seventh -------------------------------------------------

SEVENTH, H = 7, 1e-3  # steps between records; s
GROUPS = ["tension", "position", "force", "ground", "sliding", "depth", "wheels", "teeth", "rims", "horns", "moment"]
ALL = f"track.link_outputs={GROUPS}"
STOP = "{stiffness=1e6, gap=0.001, damping=1e3}"
OF_FALLS = (
    "sag", "end_tension", "joint_force", "joint_force_spread", "hoop_strain", "fall_time", "half_fall_time",
    "behind_free_fall",
)  # fmt: skip
OF_SPANS = "polygon_ripple", "span_tension", "span_moment_ratio", "tight_span_enters"
OF_BOTH = "pins_passed", "pins_per_revolution", "chain_speed_ratio"
TURNS = (
    "driver.arcs=[[10, 0.3]]", "driver.speed=1.5", "driver.ramp_start=0", "driver.ramp_time=0.15", "start.state=drawn",
    "run.step=0.001", 'run.allow=["penetration", "tooth_jump", "belly"]',
)  # fmt: skip
BENCHES = {  # scene, settings, begin of the window, its figures: None all others
    "vehicle": (
        "serpentine",
        (*TURNS, "run.stop=0.42", ALL, "drive.steering={}", f"vehicle.suspension.bump_stop={STOP}", "ground.grade=0.05",
         f"vehicle.suspension.rebound_stop={STOP}", "vehicle.tensioner.recoil={stiffness=5e5, preload=33e3}"),
        0.042, None,
    ),
    "soil": ("serpentine", (*TURNS, "run.stop=0.21", "ground.soil={name='dry_sand'}", ALL), 0.0, ("rut_depth",)),
    "rig": (
        "rig",
        ("run.stop=0.42", "drive.ramp_start=0", "drive.ramp_time=0.1", "drive.speed=4", WILD),
        0.042, (*OF_SPANS, *OF_BOTH),
    ),
    "chain": ("folded_chain", ("run.stop=0.88",), 0.0, OF_FALLS),
}  # fmt: skip


def thinned(path, out, first, averaged=False):
    """Write a log of every seventh record of outputs and links, from ``first`` on, which says that it has every one.

    ``averaged``: forces of links are means of the seven steps.
    """
    with Log(path) as log:
        topics = {topic: [*zip(about.names, about.units, strict=True)] for topic, about in log.topics.items()}
        attachments = {name: log.attachment(name) for name in log.attachments}
        with Recorder(out, topics, attachments, log.metadata) as recorder:
            for topic in topics:
                series, numbers = log.read(topic), log.sequence(topic).tolist()
                often = not topic.endswith(("/out", "/links"))
                rows = [k for k, number in enumerate(numbers) if often or number % SEVENTH == first]
                values = series.values.copy()
                means = [column for column, name in enumerate(series.names) if MEANS.fullmatch(name)]
                for row in rows[1:] if averaged and topic.endswith("/links") and means else ():
                    values[row, means] = series.values[row - SEVENTH + 1 : row + 1, means].mean(axis=0)
                for k in rows:
                    recorder.write(topic, numbers[k], series.t[k], series.h[k], values[k])
            recorder.close(**{key: log.closing[key] for key in ("status", "message", "steps", "results")})
    return out


def figures(path, begin, wanted):
    """Measures of each part that they can be of, and observables, of a log by name; the reason of what is absent."""
    found = {}
    with Log(path) as log, np.errstate(all="ignore"):
        run = RunData(log)
        window = Window(begin, run.span[1])
        asked = {(name, of): partial(one, run, of, window) for name, one in FIGURES.items() for of in one.of or ("",)}
        asked |= {(name, "observable"): partial(one.value, run, window) for name, one in OBSERVABLES.items()}
        for key, value in asked.items():
            if key[0] in wanted:
                try:
                    found[key] = float(value()), ""
                except (ArithmeticError, LookupError, ValueError) as reason:
                    found[key] = np.nan, str(reason)
    return found


@pytest.fixture(scope="module")
def readings(tmp_path_factory):
    """Figures of each bench: of every step, of every seventh, and of the record of every step as it is thinned."""
    folder, found = tmp_path_factory.mktemp("seventh"), {}
    taken = {*OF_FALLS, *OF_SPANS, *OF_BOTH, "rut_depth"}
    for bench, (scene, settings, begin, names) in BENCHES.items():
        wanted = names or {*FIGURES, *OBSERVABLES} - taken
        logs = {}
        for every in (1, SEVENTH):
            logs[every] = folder / f"{bench}{every}.mcap"
            often = (*settings, "expect={}", f"run.outputs={every}", f"run.links={every}")
            assert simulate(load(scene, "rigid", often), logs[every])["status"] == "ok"
        own = [figures(logs[every], begin, wanted) for every in (1, SEVENTH)]
        for first in (0, *range(0, SEVENTH, 2)):
            own.append(figures(thinned(logs[1], folder / "thin.mcap", first, len(own) == 2), begin, wanted))
        stop = next(float(text.removeprefix("run.stop=")) for text in settings if text.startswith("run.stop="))
        found[bench] = *own[:3], own[3:], SEVENTH * H / (stop - begin)
    return found


@pytest.mark.long
def test_every_figure_of_every_seventh_step_is_explained_or_absent(readings):
    """Two conditions: it is that of the record of every step when thinned; and that of every step lies among those of
    four ways to thin it, as far off as these differ among each other, and an interval at the window's ends.
    """
    known, wrong = set(), []
    for bench, (every, seventh, thin, phases, share) in readings.items():
        for key, (value, reason) in every.items():
            other, absent = seventh[key]
            if not np.isfinite(value):
                assert absent == reason or not np.isfinite(other), key
                continue
            known.add(key[0])
            if not np.isfinite(other):
                assert "every step: run.outputs = 1, not 7" in absent, (key, absent)
                continue
            ways = [phase[key][0] for phase in phases]
            room = max(ways) - min(ways) + share * max(map(abs, ways))
            if other != pytest.approx(thin[key][0], rel=1e-9, abs=1e-12) or not (
                min(ways) - room <= value <= max(ways) + room
            ):
                wrong.append((bench, key, value, other, thin[key][0], ways))
    assert not wrong, chr(10).join(map(repr, wrong))
    assert known == {*FIGURES, *OBSERVABLES}, "a figure without a bench that has it"


@pytest.mark.long
def test_what_needs_every_step_would_be_found(readings):
    """The twin: without its declaration ``third_law`` of every seventh step is far from that of every step."""
    every, seventh, thin, phases, _ = readings["vehicle"]
    key = "third_law", ""
    assert every[key][0] < 1e-12 < 0.1 < min(phase[key][0] for phase in phases)
    assert thin[key][0] > 0.1
    assert seventh[key] == (
        pytest.approx(np.nan, nan_ok=True),
        "third_law needs the outputs of every step: run.outputs = 1, not 7",
    )


# --- memory -------------------------------------------------------------------------------------------

HALF = ["symmetric=true", "planar=true", "run.step=2 ms"]  # the fast form of a vehicle


@pytest.mark.long
def test_a_long_run_needs_no_more_memory_than_a_short_one():
    """A run of 15 s needs no more memory than one of 3 s; its whole log would take 57 MB more."""
    short, long = isolated("memory_run", scene="straight", track="flexible", stops=(3.0, 15.0), settings=HALF)
    assert long < short + 30.0


@pytest.mark.long
def test_what_is_read_for_a_summary_or_a_difference_is_not_kept(tmp_path):
    path = tmp_path / "log.mcap"
    assert simulate(load("straight", "rigid", ["run.stop=0.1 s", "run.links=1", "expect={}"]), path)["status"] == "ok"
    with Log(path, kept=0) as log, Log(path, kept=0) as other:
        errors = differences(RunData(log), RunData(other))
        assert max(one.relative for one in errors.values()) == pytest.approx(0.0, abs=1e-12)
        with path.open("r+b") as stream:
            stream.write(bytes(path.stat().st_size))  # what is read again is not there
        with pytest.raises(LogUnreadable):
            log.read("/chassis/out")
