"""Sweeps: points of a design, rows equal to single runs, what continues after an end, further figures."""

import csv
import errno
import json
import pickle
import re
from pathlib import Path

import numpy as np
import pytest
from designs import shown
from matplotlib.figure import Figure
from scipy.stats import qmc
from short_runs import last

import orchestrator as offered
from fmus.vehicles.tables import BadInput
from orchestrator.execution import summary
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.log.log_file import LogFailed
from orchestrator.log.reader import Log
from orchestrator.results import chain_measures, output_files
from orchestrator.results.analyses import links
from orchestrator.results.run_data import EVER, RunData
from orchestrator.results.table import Column, Table
from orchestrator.scene.scene import load
from orchestrator.studies import Row, parameter_sweep, sensitivity
from orchestrator.studies.variations import Design

CHAIN = ("--set", "chain.links=8", "--set", "run.stop=0.02 s")
MODELS = ("sweep", "hanging_chain", *CHAIN, "--vary", "track.model=rigid,flexible")
SPANS = ("--vary", "chain.span=0.7:0.8:2", "--workers", 1)  # in this process


def rows_of(folder):
    return list(csv.DictReader((folder / "sweep.csv").open()))


# --- points ---


def test_a_grid_has_every_combination_in_exact_decimals():
    design = Design.of(["x.mu=0.3:0.8:6", "track.model=rigid, flexible", "rig.tension=20:40:3 kN"])
    numbers = [0.3, 0.4, 0.5, 0.6, 0.7, 0.8]
    assert shown(design) == [(x, m, f) for x in numbers for m in ("rigid", "flexible") for f in (20.0, 30.0, 40.0)]
    assert design.settings(design.points[10]) == ("x.mu=0.4", "track.model=flexible", "rig.tension=30 kN")
    assert [(one.key, one.unit, one.is_number) for one in design.variations] == [
        ("x.mu", "", True), ("track.model", "", False), ("rig.tension", "kN", True),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "numbers", "settings"),
    [
        ("k=20 kN,25 kN", [20.0, 25.0], ["20 kN", "25 kN"]),
        ("k=20,22.5, 25 kN", [20.0, 22.5, 25.0], ["20 kN", "22.5 kN", "25 kN"]),
        ("k=20 kN:40 kN:2", [20.0, 40.0], ["20 kN", "40 kN"]),
        ("k=1:-1:3", [1.0, 0.0, -1.0], ["1", "0", "-1"]),
        ("k=1e-3:1e-2:2", [1e-3, 1e-2], ["0.001", "0.01"]),
        ("k=5:9:1", [5.0], ["5"]),
        ("k=8,0.30,1e3", [8.0, 0.3, 1000.0], ["8", "0.30", "1e3"]),
        ("k=1 kN/m, 2 kN/m", [1.0, 2.0], ["1 kN/m", "2 kN/m"]),
        ("k=2,off", ["2", "off"], ["2", "off"]),
        ("k=0:1:4", [0.0, 1 / 3, 2 / 3, 1.0], ["0", repr(1 / 3), repr(2 / 3), "1"]),
    ],
)
def test_values_of_a_key(text, numbers, settings):
    design = Design.of([text])
    assert shown(design) == [(number,) for number in numbers]
    assert [design.settings(point)[0] for point in design.points] == [f"k={setting}" for setting in settings]


def test_a_latin_hypercube_is_that_of_scipy():
    design = Design.of(["a=2:1 s", "m=x,y", "b=-10:30"], sample=5, seed=3)
    unit = qmc.LatinHypercube(2, seed=np.random.default_rng(3)).random(5)
    points = qmc.scale(unit, [1.0, -10.0], [2.0, 30.0])
    assert shown(design) == [(a, m, b) for m in "xy" for a, b in points.tolist()]
    assert float(design.settings(design.points[0])[0][2:-2]) == points[0, 0], "a setting lost digits"
    for column, low, width in ((0, 1.0, 1.0), (1, -10.0, 40.0)):
        assert sorted(np.floor((points[:, column] - low) / width * 5)) == [0, 1, 2, 3, 4]
    assert shown(Design.of(["a=1:2 s", "m=x,y", "b=-10:30"], 5, 4)) != shown(design)


# --- rows ---


@pytest.mark.long
def test_rows_equal_single_runs_bit_by_bit(cotrack, tmp_path):
    out = cotrack.done(*MODELS, *SPANS[:2], "-o", "found")  # in processes of their own
    assert "| rigid | 0.7 | ok | 1 of 5; 4 begin after the end |" in out
    names = {"sweep.csv", "sweep.md", "sweep.parquet", "sweep.png", "sweep.svg"}
    assert {file.name for file in (tmp_path / "found").iterdir()} == {*names, "cases", "sweep.json"}
    assert {line.removeprefix("found/") for line in out.splitlines()[-5:]} == names
    assert not list(tmp_path.rglob("*.mcap")), "a log was kept"
    rows = rows_of(tmp_path / "found")
    places = [(model, span) for model in ("rigid", "flexible") for span in ("0.7", "0.8")]
    assert [(row["track.model"], row["chain.span"]) for row in rows] == places
    for row in (rows[0], rows[3]):
        own = ("--set", f"track.model={row['track.model']}", "--set", f"chain.span={row['chain.span']}")
        single = last(cotrack("run", "hanging_chain", *CHAIN, *own, "--json")[1])
        units = dict.fromkeys(("tension_max", "pin_force", "pin_force_high", "tension_mean", "end_tension"), "N")
        units["sag"] = "m"
        assert {name: float(row[f"{name}, {unit}"]) for name, unit in units.items()} == single["observables"]
        wanted = {
            "check rest": single["checks"]["rest"]["value"], "energy residual": single["energy"]["residual_relative"],
            "estimated error": single["error"]["total"],
        }  # fmt: skip
        errors = single["error"]["observables"]
        assert {*errors} == {"pins", "tension"}
        for name, error in errors.items():
            wanted[f"estimated error of {name}"] = error["total"]
            wanted[f"estimated error of {name}, {error['unit']}"] = error["absolute"]
        assert {name: float(row[name]) for name in wanted} == wanted
        assert (row["status"], row["checks not met"]) == ("ok", "")
    assert len({row["sag, m"] for row in rows}) == 4, "rows do not belong to their settings"


@pytest.mark.long
def test_the_function_returns_the_table_that_it_writes(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    settings = {"chain.links": 8, "run.stop": 0.02, "expect.rest.expected": 1}
    arguments = dict(sample=2, seed=7, track="flexible", estimate=False, keep_logs=True)
    vary = ["vehicle.track.mass=20:25 kg"]
    table = offered.sweep("hanging_chain", vary, tmp_path, settings=settings, **arguments)
    assert table.csv() == (tmp_path / "sweep.csv").read_text()
    assert json.loads((tmp_path / "sweep.json").read_text())["seed"] == 7
    read, frame = parquet.read_table(tmp_path / "sweep.parquet"), table.frame()
    assert read.schema.field("sag").metadata == {b"unit": b"m"}
    assert read.schema.field("vehicle.track.mass").metadata == {b"unit": b"kg"}
    assert read["sag"].to_pylist() == frame["sag"].tolist()
    assert frame["sag"].nunique() == 2
    assert "estimated error" not in read.column_names
    assert frame["checks not met"].tolist() == ["rest", "rest"]
    for name in frame["log"]:
        with offered.Log(tmp_path / name) as log:
            assert (log.closing["status"], log.metadata["run"]["track"]) == ("ok", "flexible")
    texts = [f"{key}={value}" for key, value in settings.items()]
    again = offered.sweep("hanging_chain", vary, tmp_path, settings=texts, **arguments)
    assert again == table, "settings as texts are the same sweep"


def fake(monkeypatch, *ends):
    """Replace the runs by these: exceptions to raise, or entries of a summary; return the scenes that ran."""
    scenes, queue = [], list(ends)

    def simulate(scene, path, **options):
        scenes.append(scene)
        assert (options["native"], options["estimated"], options["raise_faults"]) == (False, True, True)
        end = queue.pop(0)
        if isinstance(end, BaseException):
            raise end
        return summary.empty(scene.name, scene.variant) | {"status": "ok", "observables": {"sag": 1.0}} | end

    monkeypatch.setattr(parameter_sweep, "simulate", simulate)
    return scenes


def test_a_case_that_fails_is_a_row_with_its_sentence(cotrack, monkeypatch, tmp_path):
    open_ledger = {"residual_relative": 0.4, "integration_relative": {}}
    unknown = {"total": None, "observables": {}, "message": "the run is too short"}
    ended = {"error": unknown, "checks": {"rest": {"value": 0.5, "ok": False}}}
    lost = {"status": "failed", "message": "link 7 is lost", "error": None}
    fake(monkeypatch, BadInput("no idler position"), {"energy": open_ledger, "message": "40 % is open"}, lost, ended)
    status, out, err = cotrack(*MODELS, *SPANS, "-o", "found")
    assert status == 1
    assert "4 rows, 3 not as they should be, 1 miss checks of the scene\n" in err
    rows = rows_of(tmp_path / "found")
    heads = "track.model", "chain.span", "status", "checks", "checks not met", "sag, m", "check rest", "estimated error"
    assert [*rows[0]] == [*heads, "energy residual", "warnings", "wall_time, s", "log", "note"]
    assert out.splitlines()[0] == f"| {' | '.join((*heads, 'energy residual', 'note'))} |"
    assert out.splitlines()[5].startswith("| flexible | 0.8 | ok | 0 of 1 | rest | 1 | 0.5 |")
    assert [(row["track.model"], row["status"], row["sag, m"], row["note"]) for row in rows] == [
        ("rigid", "failed", "", "BadInput: no idler position"), ("rigid", "ok", "1.0", "40 % is open"),
        ("flexible", "failed", "1.0", "link 7 is lost"),
        ("flexible", "ok", "1.0", "estimated error: not known, the run is too short"),
    ]  # fmt: skip


# --- continuation ---


def test_an_interrupted_sweep_continues_where_it_stopped(cotrack, monkeypatch, tmp_path):
    """The second start runs what is missing; a number planted into the stored row shows that the first row is read."""
    first = fake(monkeypatch, {"observables": {"sag": 0.5}}, KeyboardInterrupt())
    assert (cotrack(*MODELS, *SPANS, "-o", "found")[0], len(first)) == (1, 2)
    assert not (tmp_path / "found" / "sweep.csv").exists()
    (stored,) = (tmp_path / "found" / "cases").iterdir()
    assert '"sag": 0.5' in stored.read_text()
    stored.write_text(stored.read_text().replace('"sag": 0.5', '"sag": 0.25'))
    second = fake(monkeypatch, *({} for _ in range(3)))
    assert cotrack(*MODELS, *SPANS, "-o", "found")[0] == 0
    ran = [(scene.variant, scene.chain.span) for scene in second]
    assert ran == [("rigid", 0.8), ("flexible", 0.7), ("flexible", 0.8)]
    assert [row["sag, m"] for row in rows_of(tmp_path / "found")] == ["0.25", "1.0", "1.0", "1.0"]


def caused(error, cause):
    error.__context__ = cause
    return error


@pytest.mark.parametrize(("end", "again"), [
    (OSError(errno.EMFILE, "Too many open files"), True),
    (MemoryError(), True),
    (LogFailed("no space left on device"), True),
    (KeyError("a fault of ours"), True),
    (caused(BadInput("the scene cannot be read"), OSError(errno.EMFILE, "Too many open files")), True),
    (BadInput("no idler position"), False),
    (ComponentFailed("chain: no convergence"), False),
    ({"status": "failed", "message": "link 7 is lost", "energy": None}, False),
])  # fmt: skip
def test_only_answers_of_the_model_are_kept(cotrack, monkeypatch, end, again):
    """A case that the machine failed runs again, and the command says so; a refusal is a row for ever."""
    fake(monkeypatch, end, {})
    one = ("sweep", "hanging_chain", *CHAIN, "--track", "rigid", *SPANS, "-o", "found")
    assert cotrack(*one)[0] == 1
    second = fake(monkeypatch, {})
    status, _, err = cotrack(*one)
    assert (len(second), status) == ((1, 0) if again else (0, 1))
    assert ("runs that the machine failed are done again: 1" in err) == again


VARY = "['track.model=rigid,flexible', 'chain.span=0.7:0.8:2']"


@pytest.mark.parametrize(("other", "said"), [
    (("--no-estimate",), "estimated is true there and false here"),
    (("--native",), "native is false there and true here"),
    (("--set", "run.step=2 ms"), "setting run.step is 'not set' there and '2 ms' here"),
    (("--vary", "run.links=1,2"), f"vary is {VARY} there and {VARY[:-1]}, 'run.links=1,2'] here"), ((), ""),
    (("-o", "found/sweep.csv"), ""),
])  # fmt: skip
def test_a_folder_holds_one_sweep(cotrack, monkeypatch, tmp_path, other, said):
    fake(monkeypatch, *({} for _ in range(4)))
    assert cotrack(*MODELS, *SPANS, "-o", "found")[0] == 0
    kept = {file: file.read_bytes() for file in (tmp_path / "found").glob("sweep.[cjmp]*")}
    status, _, err = cotrack(*MODELS, *SPANS, "-o", "found", *other)
    assert status == (2 if other else 0)
    assert kept == {file: file.read_bytes() for file in kept}
    if said:
        holds = f"cotrack: output 'found': holds another sweep, of hanging_chain over {VARY}: {said}:"
        assert err == f"{holds} choose another folder\n"
    (tmp_path / "found" / "sweep.json").write_text("[]")
    assert "is not that of a sweep: choose another folder" in cotrack.refused(*MODELS, *SPANS, "-o", "found")


def test_cases_can_be_sent_to_other_machines(tmp_path):
    """A case contains its scene, so it needs no file of the sweep; equal cases have equal stores."""
    design = Design.of(["chain.span=0.7,0.8"])
    cases = parameter_sweep.plan(design, "hanging_chain", tmp_path, track="rigid", settings=["chain.links=8"]).cases
    sent = pickle.loads(pickle.dumps(cases))
    assert [case.arguments[0].chain.span for case in sent] == [0.7, 0.8]
    assert {case.arguments[0].variant for case in sent} == {"rigid"}
    assert [repr(case) for case in sent] == [repr(case) for case in cases]
    assert re.search("chain.span=0.7$", cases[0].name)


def test_tables_and_pictures_are_written_whole_or_not_at_all(tmp_path):
    class Full(Figure):
        """Picture for which the disk has no room."""

        def savefig(self, path):
            path.write_bytes(b"half")
            raise OSError(errno.ENOSPC, "No space left on device")

    (tmp_path / "sweep.png").write_bytes(b"before")
    with pytest.raises(BadInput, match=r"sweep\.png.* cannot be written: No space left on device"):
        output_files.save_results(tmp_path, "sweep", Table("", (Column("a", "a"),), [(1.0,)]), Full())
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir() if file.suffix != ".md"} == {
        "sweep.csv": b"a\n1.0\n", "sweep.png": b"before",
    }  # fmt: skip


# --- further figures ---


@pytest.mark.long
def test_further_figures_are_those_of_the_log(cotrack, call, tmp_path):
    wanted = ("--for", "sag", "--for", "max:chain.tension.max", "--for", "links", "--for", "ride")
    options = (*CHAIN, "--no-estimate", "--keep-logs", *SPANS)
    status, _, err = cotrack("sweep", "hanging_chain", *wanted, *options, "-o", "found")
    assert status == 0, err
    assert any(line.startswith("1/2 chain.span=0.7: tension max 699.25 N, ") for line in call.progress)
    for number, row in enumerate(rows_of(tmp_path / "found"), 1):
        with Log(tmp_path / "found" / "logs" / f"{number}.mcap") as log:
            run = RunData(log)
            _, tension = run.signal("chain.tension.max")
            assert float(row["max:chain.tension.max, N"]) == tension.max()
            assert float(row["sag, m"]) == chain_measures.sag(run, "", EVER)
            largest = links.summary(run).table().records()
        heads = [head for head in row if head.startswith("links ") and head.endswith("largest, kN")]
        assert sorted(float(row[head]) for head in heads) == sorted(each["largest"] for each in largest)
        assert row["note"].startswith("ride: ")


# --- sensitivities ---

SHORT = ("chain.links=8", "run.stop=0.02", "expect={}")
MASS, GRAVITY, SPAN, WIDTH = "vehicle.track.mass", "vehicle.gravity", "chain.span", "vehicle.track.width"


def sensitivity_of(folder, *keys, settings=SHORT):
    return sensitivity.sensitivity("hanging_chain", folder, keys, track="rigid", settings=settings)[0]


def derivative(found, key, figure):
    return found.derivatives[list(found.numbers).index(key), list(found.figures).index(figure)]


@pytest.mark.long
def test_a_hanging_chain_pulls_in_proportion_to_its_weight(tmp_path):
    """All forces are in proportion to mass and gravity, the sag to neither; the span acts as two runs say."""
    found = sensitivity_of(tmp_path / "s", MASS, GRAVITY, SPAN, WIDTH)
    for name in ("tension_max", "tension_mean", "end_tension"):
        for key in (MASS, GRAVITY):
            assert derivative(found, key, name) == pytest.approx(found.figures[name], rel=1e-4)
            assert derivative(found, key, name) != pytest.approx(1.02 * found.figures[name], rel=1e-4)
        assert derivative(found, WIDTH, name) == 0.0
    assert abs(derivative(found, MASS, "sag")) < 1e-4 * found.figures["sag"]
    settings = ((*SHORT, f"{SPAN}={span}") for span in (0.796, 0.804))
    low, high = (sensitivity_of(tmp_path / each[-1], WIDTH, settings=each).figures for each in settings)
    for name in ("tension_max", "sag"):
        by_runs = (high[name] - low[name]) / 0.01
        assert derivative(found, SPAN, name) == pytest.approx(by_runs, rel=1e-3)
        assert derivative(found, SPAN, name) != pytest.approx(1.02 * by_runs, rel=1e-3)


def test_a_switch_and_noise_have_no_derivative(tmp_path, monkeypatch):
    """A figure that jumps beside the number, one that jumps behind 0.05 %, and one with noise of 1e-5."""

    def figures(scene, *_):
        x = scene.vehicle.track.mass / 18.02
        known = {"tension_max": x**2, "tension_mean": 1.0 + (x > 1.0), "sag": x + (x > 1.0005)}
        known["end_tension"] = x + 1e-5 * np.sin(1e9 * x)
        return [Row("", "", {"status": "ok", **known})]

    monkeypatch.setattr(sensitivity, "run_case", figures)
    found = sensitivity_of(tmp_path / "s", MASS)
    assert derivative(found, MASS, "tension_max") == pytest.approx(2.0, rel=1e-3)
    assert np.isnan(derivative(found, MASS, "tension_mean"))
    assert derivative(found, MASS, "sag") == pytest.approx(1.0, rel=1e-6)
    assert derivative(found, MASS, "end_tension") == pytest.approx(1.0, rel=sensitivity.AGREE)
    assert found.steps[0].tolist()[:1] == [1e-4]
    assert found.steps[0, list(found.figures).index("end_tension")] > 1e-4
    assert "rough" in found.table().markdown()


def test_the_command_of_sensitivities_makes_no_run_twice(cotrack, monkeypatch):
    settings = [part for text in SHORT for part in ("--set", text)]
    asked = "sensitivity", "hanging_chain", "--track", "rigid", *settings, "--of", MASS, "--workers", "1", "-o", "s"
    out = cotrack.done(*asked, "--for", "max:chain.tension.max")
    assert f"| {MASS} | 18.02 | 7." in out
    assert Path("s/sensitivity.png").stat().st_size > 5_000

    fake(monkeypatch)
    assert cotrack.done(*asked, "--for", "max:chain.tension.max") == out


def test_all_numbers_of_a_vehicle_by_default():
    found = sensitivity.numbers_of(load("straight", "rigid"), ())
    assert {"vehicle.suspension.stiffness", "vehicle.road_wheel.x.1", "vehicle.contact.ground.friction"} <= {*found}
    assert not [key for key in found if key.startswith("vehicle.life")]
    assert all(found.values())
