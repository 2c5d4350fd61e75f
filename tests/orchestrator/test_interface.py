"""Python interface: the same run, numbers and refusals as the command line."""

import re
from pathlib import Path

import cotrack as package
import numpy as np
import pytest
from short_runs import SHORT, last

from fmus.vehicles.tables import BadInput
from orchestrator import recorded_run
from orchestrator.log.reader import Log, Missing


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    log = tmp_path_factory.mktemp("interface") / "chain.mcap"
    return package.run("hanging_chain", {"run.stop": 0.02}, estimate=False, log=log, progress=False)


def test_a_run_equals_that_of_the_command_line(run, cotrack, tmp_path):
    out = cotrack.done(*SHORT, "--no-estimate", "--log", tmp_path / "command.mcap")
    assert run.ok
    command, timed = last(out), {"log", "log_bytes", "seal", "startup_time", "wall_time", "cpu_time", "components"}
    differing = {key for key in command if command[key] != run.summary[key]}
    assert differing <= {*timed, "real_time_factor"}
    with Log(tmp_path / "command.mcap") as other, Log(run.log) as log:
        assert log.digest() == other.digest()
        _, values = log.signal("chain.tension.max")
    assert (run["chain.tension.max"].values == values).all()


def test_an_opened_log_has_the_summary_of_its_run(run):
    opened = package.Run(run.log)
    for key in ("status", "checks", "observables", "energy", "simulated_time", "communication_steps", "seal"):
        assert opened.summary[key] == run.summary[key], key
    assert opened.ok
    assert str(opened) == str(run)
    head, *below = str(run).splitlines()
    assert head == "hanging_chain, flexible links: ok; 1 of 3 checks are met; 2 begin after the end"
    assert any("real time" in line for line in below)
    assert "more with --verbose" in " ".join(str(run).split())
    assert repr(run) == f"{head}; log {run.log}"
    assert f"<pre>{str(run)[:80]}" in run._repr_html_()


def test_figures_are_means_over_the_window_of_the_scene(tmp_path):
    settings = {"run.stop": 0.02, "run.window": {"from": "5 ms", "to": 0.01}}
    run = package.run("hanging_chain", settings, estimate=False, log=tmp_path / "a.mcap", progress=False)
    values = run["chain.tension.mean"].between(0.005, 0.01).values
    assert len(values) == 6
    for each in (run, package.Run(run.log)):
        assert each.summary["observables"]["tension_mean"] == pytest.approx(values.mean(), rel=1e-12)
        assert each.summary["windows"]["tension_mean"] == {"from": 0.005, "to": 0.01}
        assert each.summary["windows"]["tension_max"] == {"from": 0.0, "to": 0.02}
        assert "\n  mean of 0.005 to 0.01 s\n    mean link tension " in str(each)


def test_signals_have_units_and_families_a_column_for_each_member(run):
    tension = run["chain.link[*].tension"]
    assert (tension.unit, tension.values.shape) == ("N", (len(tension.t), 64))
    single = run["chain.link[3].tension"]
    assert (tension.values[:, 2] == single.values).all()
    middle = 0.5 * (tension.t[0] + tension.t[1])
    assert tension.at(middle) == pytest.approx(tension.values[:2].mean(axis=0), rel=1e-12)
    assert single.at(-1.0) == single.values[0]
    assert single.between(0.005, 0.015).t == pytest.approx([0.01])
    assert repr(single).startswith(f"chain.link[3].tension: {len(single.t)} values from 0 to 0.02 s, ")
    assert (single.max.value, single.min.value) == (single.values.max(), single.values.min())
    assert single.at(single.max.t) == single.max.value
    assert repr(single).endswith(f" to {single.max.value:.5g} N, largest at {single.max.t:.4g} s")
    assert tension.max.value == tension.values.max()
    assert tension.max.value in tension.at(tension.max.t)
    assert f"{len(tension.t)} x 64 values" in repr(tension)
    with pytest.raises(Missing, match=r"did you mean 'chain\.tension\.max'"):
        run["chain.tension.maxx"]
    with pytest.raises(Missing, match=r"'chain\.link\[\*\]\.\*' matches signals in N and Pa: no family"):
        run["chain.link[*].*"]
    frame = run.frame("chain.tension.*", start=0.01)
    assert frame.attrs["units"]["chain.tension.max"] == "N"
    assert frame.index[0] == pytest.approx(0.01)


def test_signals_are_named_one_by_one_or_in_lists(run):
    names = ["chain.tension.max", "chain.tension.mean"]
    for given in ([names], [tuple(names)], [names[0], names[1:]]):
        assert {*run.frame(*given)} == {*names}
        assert len(run.plot(*given).figure.axes[0].lines) == 2
    assert run.plot(["chain.link[*].tension"], waterfall=True).figure.axes


def test_pictures_pages_and_analyses(run, tmp_path):
    picture = run.plot("chain.tension.max", end=0.01)
    (line,) = picture.figure.axes[0].lines
    assert line.get_xdata().max() == pytest.approx(0.01)
    assert picture.save(tmp_path / "a.svg").read_text().lstrip().startswith("<?xml")
    assert picture._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(BadInput, match="is no family of signals"):
        run.plot("chain.tension.max", waterfall=True)
    assert run.analyse("links").table().rows
    assert "hanging_chain" in run.report(tmp_path / "page.html").read_text()
    assert {each.absolute for each in run.compare(package.Run(run.log)).values()} == {0.0}


def test_settings_are_a_table_or_texts(tmp_path):
    table = package.load("hanging_chain", settings={"vehicle.track.mass": np.float64(20), "run.stop": "20 ms"})
    assert table == package.load("hanging_chain", None, ["vehicle.track.mass=20", "run.stop=0.02"])
    assert (table.vehicle.track.mass, table.run.stop) == (20.0, 0.02)
    changed = table.changed({"vehicle.track.mass": 18.02})
    assert changed == package.load("hanging_chain", settings={"run.stop": 0.02})
    with pytest.raises(BadInput):
        table.changed({"run.stopp": 1})
    with pytest.raises(BadInput, match=r"track = 'rigid': a scene that is loaded has its track model"):
        package.run(table, track="rigid", log=tmp_path / "a.mcap")
    assert not [*tmp_path.iterdir()]


TEST, COLUMNS = "test.csv", {"chain.tension.max": "pull"}


def fitted(free=("vehicle.track.mass",), data=TEST, columns=COLUMNS, scene="hanging_chain", **options):
    return package.fit(scene, data, columns, free, "fitted", **options)


REFUSED = {  # calls with a bad argument, of a run and its log
    "scene": lambda run: package.run("hanging_chian"),
    "setting": lambda run: package.run("hanging_chain", {"run.stopp": 1}),
    "text": lambda run: package.run("hanging_chain", ["run.stop"]),
    "track": lambda run: package.run("hanging_chain", track="stiff"),
    "track of a loaded scene": lambda run: package.run(package.load("hanging_chain"), track="rigid"),
    "stop": lambda run: package.run("hanging_chain", stop=-1),
    "step": lambda run: package.run("hanging_chain", step="1 m"),
    "vehicle": lambda run: package.load("straight", settings={"vehicle": "m1133"}),
    "no log": lambda run: package.Run("none.mcap"),
    "a log that is none": lambda run: package.Log(TEST),
    "signal": lambda run: run["chain.tension.maxx"],
    "family": lambda run: run["chain.link[*].*"],
    "frame": lambda run: run.frame("chain.tension.maxx"),
    "backward frame": lambda run: run.frame("chain.tension.max", start=1, end=0),
    "plot": lambda run: run.plot("chain.tension.max", waterfall=True),
    "two forms": lambda run: run.plot("chain.link[*].tension", place=True, frequency=True),
    "at": lambda run: run.plot("chain.link[*].tension", at=[0.01]),
    "beyond": lambda run: run.plot("chain.tension.max", start=3),
    "picture": lambda run: run.plot("chain.tension.max").save("a.txt"),
    "analysis": lambda run: package.analyse(run.log, "powr"),
    "option": lambda run: run.analyse("links", links=3),
    "late": lambda run: run.analyse("links", start=3, end=4),
    "backward": lambda run: run.analyse("links", start=0.02, end=0.01),
    "which track": lambda run: run.analyse("links", track="right_track"),
    "no seat": lambda run: run.analyse("ride"),
    "no road wheel": lambda run: run.analyse("wheel-loads"),
    "no drive": lambda run: run.analyse("spectrum", signals=["chain.tension.max"], orders=True),
    "no signal": lambda run: run.analyse("spectrum"),
    "window of a spectrum": lambda run: run.analyse("spectrum", signals=["chain.tension.max"], shape="round"),
    "place": lambda run: run.analyse("life", by="time"),
    "line": lambda run: run.analyse("fatigue", sn="90 MPa"),
    "instant": lambda run: run.analyse("deformation", at=[3.0]),
    "report": lambda run: run.report("page.html", columns=COLUMNS),
    "reference": lambda run: run.compare("none.mcap"),
    "compared": lambda run: package.compare(run.log, "none.mcap"),
    "column": lambda run: run.compare_measured(TEST, {"chain.tension.max": "force"}),
    "no column": lambda run: run.compare_measured(TEST, {}),
    "unit": lambda run: run.compare_measured(TEST, {"chain.tension.max": "pull:m"}),
    "clock": lambda run: run.compare_measured(TEST, COLUMNS, clock="hour"),
    "shift": lambda run: run.compare_measured(TEST, COLUMNS, shift="later"),
    "time in common": lambda run: run.compare_measured(TEST, COLUMNS, shift=9.0),
    "export": lambda run: package.export(run.log, "out.csv", signals=["chain.tension.maxx"]),
    "nothing to fit": lambda run: fitted(free=()),
    "free": lambda run: fitted(free=("vehicle.track.masss",)),
    "free twice": lambda run: fitted(free=("vehicle.track.mass", "vehicle.track.mass")),
    "range": lambda run: fitted(free=("vehicle.track.mass=10:",)),
    "backward range": lambda run: fitted(free=("vehicle.track.mass=20:10",)),
    "outside": lambda run: fitted(free=("vehicle.track.mass=30:40",)),
    "zero": lambda run: fitted(free=("start.heading",), scene="straight"),
    "no number": lambda run: fitted(free=("track.start",)),
    "data twice": lambda run: fitted(data=[TEST, TEST]),
    "noise": lambda run: fitted(noise={"chain.sag": 1.0}),
    "part, native": lambda run: fitted(scene=run.log, part="chain", native=True),
    "part, settings": lambda run: fitted(scene=run.log, part="chain", settings={"run.stop": 1}),
    "vary": lambda run: package.sweep("hanging_chain", ["chain.span"], "swept"),
    "another sweep": lambda run: [package.sweep("hanging_chain", {"chain.span": [value], "run.stop": [0.01]}, "swept",
                                                estimate=False) for value in (0.7, 0.8)],
    "sample": lambda run: package.sweep("hanging_chain", {"chain.span": [0.7]}, "swept", sample=3),
    "course": lambda run: package.life("none.toml"),
}  # fmt: skip


@pytest.mark.parametrize("refused", REFUSED)
def test_refusals_name_arguments_and_no_option_of_the_command_line(run, refused, tmp_path, monkeypatch):
    """A whole command, "cotrack run --for ride", may be advised: it makes what the call lacks."""
    monkeypatch.chdir(tmp_path)
    Path(TEST).write_text("t,pull\n" + "".join(f"{0.001 * k},{k}\n" for k in range(20)))
    with pytest.raises((ValueError, RuntimeError, LookupError, OSError)) as told:
        REFUSED[refused](run)
    assert not re.search(r"(?<![\w-])--?[a-z]", re.sub(r"cotrack [a-z]+ [^;,]*", "", str(told.value))), told.value
    assert {file.name for file in tmp_path.iterdir()} <= {TEST, "fitted", "swept"}


def test_a_run_with_a_missed_check_is_returned(tmp_path, capfd):
    check = {"signal": "chain.tension.max", "expected": 0.0, "tolerance": 1.0}
    settings = {"run.stop": 0.02, "expect.slack": check}
    missed = package.run("hanging_chain", settings, log=tmp_path / "a.mcap", estimate=False)
    assert not missed.ok
    assert missed.summary["status"] == "ok"
    assert "! NOT slack = " in str(missed)
    assert "... hanging_chain: components are built and initialised" in capfd.readouterr().err


def test_a_run_that_failed_says_why_and_its_log_is_the_one_that_it_left(run, monkeypatch):
    """Which may have another name than the one that was asked for."""
    left = run.log.with_name("chain.running.mcap")
    failed = package.Run(left, run.summary | {"status": "failed", "message": "the disk is full", "log": str(left)})
    assert not failed.ok
    assert str(failed).splitlines()[1] == "  the disk is full"
    monkeypatch.setattr(recorded_run, "simulate", lambda scene, path, **options: {"log": str(left)})
    assert package.run("hanging_chain", log=run.log.with_name("a.mcap"), progress=False).log == left


@pytest.mark.long
def test_the_example_of_the_page_runs(tmp_path, monkeypatch, capsys):
    """Shortened: a stop of 0.05 s and windows in it; that of the page on results."""
    readme = (Path(__file__).parents[2] / "orchestrator" / "results.md").read_text(encoding="utf-8")
    (example,) = (block for block in re.findall(r"```python\n(.*?)```", readme, re.DOTALL) if "cotrack.run(" in block)
    for text, short in (("stop=0.5", "stop=0.05"), ("start=0.2", "start=0.02")):
        assert text in example
        example = example.replace(text, short)
    monkeypatch.chdir(tmp_path)
    exec(example, {})
    out = capsys.readouterr().out
    assert out.startswith("straight, rigid links: ok")
    assert "chassis.speed: " in out
    assert {file.name for file in tmp_path.iterdir()} == {"logs", "tension.png", "straight.html"}
