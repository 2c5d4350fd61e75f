"""``cotrack fit``: known numbers are found again, as sure as is said, and all that is no answer is named."""

import json
from pathlib import Path

import numpy as np
import pytest
from made_logs import made

from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results.run_data import EVER, RunData
from orchestrator.scene.scene import load
from orchestrator.studies import fit as fitting
from orchestrator.studies import least_squares

GALLERY = Path(__file__).resolve().parents[2] / "orchestrator" / "gallery"
SETTINGS = ("chain.links=8", "run.stop=0.05", "run.links=1", "track.start=displaced", "expect={}")
SIGNALS = {name: name for name in ("chain.tension.max", "chain.joint[4].position.z")}
SPAN, MASS = "chain.span=0.5:0.95", "vehicle.track.mass=10:40 kg"
TRUTH = {"chain.span": 0.72, "vehicle.track.mass": 17.0}
T = np.arange(0.0, 0.0501, 0.001)


def signals(folder, settings, scene="hanging_chain"):
    """Signals of a run at T by name."""
    simulate(load(scene, "rigid", settings), folder / "run.mcap")
    with Log(folder / "run.mcap") as log:
        run = RunData(log)
        return {name: np.interp(T, *run.signal(name, EVER)) for name in SIGNALS}


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """Signals with the numbers TRUTH."""
    settings = [*SETTINGS, *(f"{key}={value}" for key, value in TRUTH.items())]
    return signals(tmp_path_factory.mktemp("truth"), settings)


@pytest.fixture(scope="module")
def noise(measured):
    """One per cent of the size of each signal."""
    return {name: 0.01 * float(np.sqrt(np.mean(values**2))) for name, values in measured.items()}


@pytest.fixture
def data(measured, noise, tmp_path):
    """Function that writes a file with noise of a seed; None: without."""

    def write(seed=None, of=measured, form="%.17g"):
        drawn = np.random.default_rng(seed).standard_normal((len(of), len(T))) if seed is not None else 0.0
        size = np.array(list(noise.values()))[:, None]
        values = np.array(list(of.values())) + size * drawn
        path = tmp_path / f"data{seed}.csv"
        np.savetxt(path, np.vstack([T, values]).T, form, ",", header=",".join(["t", *measured]), comments="")
        return path

    return write


def fitted(file, folder, free=(SPAN, MASS), more=(), **options):
    settings = [*SETTINGS, *more]
    return fitting.fit("hanging_chain", file, SIGNALS, free, folder, track="rigid", settings=settings, **options)


def deviations(found, factor=1.0):
    """Distance of each number from ``factor`` times the truth in standard errors."""
    true = [factor * TRUTH[record["key"]] for record in found.table.records()]
    return [(a - b) / e for a, b, e in zip(found.answer.numbers, true, found.answer.errors, strict=True)]


def test_exact_data_give_the_numbers_back(data, noise, tmp_path):
    found = fitted(data(), tmp_path / "fit", noise=noise)
    assert found.answer.numbers == pytest.approx(list(TRUTH.values()), rel=1e-5)
    assert found.answer.numbers != pytest.approx([1.02 * value for value in TRUTH.values()], rel=1e-5)
    assert not found.ok, "without noise, the stated noise is wrong"
    assert "the differences are not the stated noise" in found.verdict


@pytest.mark.long
def test_noisy_data_give_the_numbers_within_their_errors(data, noise, tmp_path):
    """Errors are those of the scatter: the sum of 10 squares in units of the errors is chi-squared."""
    found = [fitted(data(seed), tmp_path / "fit", noise=noise) for seed in range(5)]
    assert all(one.ok and one.verdict.startswith("fitted: ") for one in found), [one.verdict for one in found]
    squares, off = (float(np.sum(np.square([deviations(one, factor) for one in found]))) for factor in (1.0, 1.02))
    low, high = 2.16, 25.2  # 0.5 and 99.5 % of chi-squared with 10 degrees of freedom
    assert low < squares < high
    assert off > high, "numbers 2 per cent off would be noticed"


def test_two_files_with_one_set_of_numbers(data, noise, tmp_path):
    """The same file twice has the same best numbers, and errors that are less by the root of two."""
    file = data(3)
    again = tmp_path / "again.csv"
    again.write_bytes(file.read_bytes())
    once, twice = (fitted(one, tmp_path / "fit", noise=noise) for one in (file, [file, again]))
    assert twice.answer.numbers == pytest.approx(once.answer.numbers, rel=1e-6)
    assert np.multiply(twice.answer.errors, 2.0**0.5) == pytest.approx(once.answer.errors, rel=1e-3)
    assert twice.answer.errors != pytest.approx(once.answer.errors, rel=0.2)
    assert len(twice.residuals.records()) == 4
    with pytest.raises(fitting.BadInput, match="is given twice, which would make errors too small"):
        fitted([file, file], tmp_path / "fit", noise=noise)


@pytest.mark.long
def test_files_of_two_scenes_with_one_set_of_numbers(data, noise, tmp_path):
    """Each file is of its own scene: the same chain hangs on the Moon."""
    moon, earth = tmp_path / "moon.toml", data(3)
    text = (GALLERY / "hanging_chain.toml").read_text()
    moon.write_text(text.replace('"m113"', '{ base = "m113", gravity = "1.62 m/s^2" }'))
    there = signals(tmp_path, [*SETTINGS, *(f"{key}={value}" for key, value in TRUTH.items())], str(moon))
    file = data(4, there)
    found = fitted([earth, f"{moon}={file}"], tmp_path / "fit", noise=noise)
    assert found.ok, found.verdict
    assert max(map(abs, deviations(found))) < 4.0
    assert not fitted([earth, file], tmp_path / "fit", noise=noise).ok, "the Moon's file as one of the Earth"


def test_a_part_with_recorded_inputs_has_the_fit_of_the_whole(data, noise, tmp_path):
    """A hanging chain is one component without inputs, so both have the same runs."""
    file = data(3)
    simulate(load("hanging_chain", "rigid", [*SETTINGS, "chain.span=0.72"]), tmp_path / "run.mcap")
    whole = fitted(file, tmp_path / "whole", [MASS], ["chain.span=0.72"], noise=noise)
    part = fitting.fit(str(tmp_path / "run.mcap"), file, SIGNALS, [MASS], tmp_path / "part", part="chain", noise=noise)
    assert part.answer.numbers == whole.answer.numbers
    assert part.answer.errors == whole.answer.errors


def write_parquet(path, columns):
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    parquet.write_table(arrow.table({"t": T, **columns}), path)


def write_mf4(path, columns):
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(v, T, name=name) for name, v in columns.items()])
        file.save(path, overwrite=True)


def write_tdms(path, columns):
    nptdms = pytest.importorskip("nptdms")
    times = {"wf_increment": 0.001, "wf_start_offset": 0.0}
    with nptdms.TdmsWriter(path) as file:
        file.write_segment([nptdms.ChannelObject("g", name, v, times) for name, v in columns.items()])


def write_mcap(path, columns):
    topics = {"/chain/out": [(name.removeprefix("chain."), "") for name in columns]}
    made(path, topics, {"/chain/out": (T, np.stack([*columns.values()], axis=1))}, None, ("chain",))


@pytest.mark.long
@pytest.mark.parametrize("write", [write_parquet, write_mf4, write_tdms, write_mcap])
def test_each_format_has_the_fit_of_csv(data, noise, tmp_path, write):
    file = data(3)
    columns = dict(zip(SIGNALS, np.loadtxt(file, delimiter=",", skiprows=1)[:, 1:].T, strict=True))
    other = tmp_path / f"data.{write.__name__.removeprefix('write_')}"
    write(other, columns)
    by_csv, found = (fitted(one, tmp_path / "fit", [MASS], ["chain.span=0.72"], noise=noise) for one in (file, other))
    assert found.answer.numbers == pytest.approx(by_csv.answer.numbers, rel=1e-12)
    assert found.answer.errors == pytest.approx(by_csv.answer.errors, rel=1e-12)
    write(other, {name: 1.001 * values for name, values in columns.items()})
    off = fitted(other, tmp_path / "fit", [MASS], ["chain.span=0.72"], noise=noise)
    assert off.answer.numbers != pytest.approx(by_csv.answer.numbers, rel=1e-12)


def test_noise_is_estimated_and_that_is_said(data, noise, tmp_path):
    found = fitted(data(3), tmp_path / "fit")
    assert found.ok
    assert any("whether or not the model is right" in note for note in found.answer.notes)
    estimated = [record["noise"] for record in found.residuals.records()]
    assert estimated == pytest.approx(list(noise.values()), rel=0.3)
    assert max(map(abs, deviations(found))) < 4.0


def test_samples_of_the_window_and_of_the_run_count(data, measured, noise, tmp_path):
    """Of 51 samples to 0.05 s, 31 are up to 0.03 s, and all of a file that is twice as long."""
    file = tmp_path / "a=b.csv"
    whole = np.loadtxt(data(3), delimiter=",", skiprows=1)
    later = whole.copy()
    later[:, 0] += whole[-1, 0] + 0.001
    np.savetxt(file, np.vstack([whole, later]), "%.17g", ",", header=",".join(["t", *measured]), comments="")
    found = [fitted(file, tmp_path / "fit", [MASS], ["chain.span=0.72"], noise=noise, end=end) for end in (0.03, 9.0)]
    assert [one.residuals.records()[0]["samples"] for one in found] == [31, 51]


def test_a_wrong_model_is_no_success_without_a_noise(data, tmp_path):
    """The mass alone cannot explain another span: residuals follow the motion, whatever noise is taken from them."""
    found = fitted(data(3), tmp_path / "fit", [MASS])
    assert not found.ok
    assert found.verdict.startswith("no fit: the residuals of chain.")
    assert " are no noise, neighbours are correlated by " in found.verdict


WHOLE, ROUNDED = "%.17g", ["%.3f", "%.5g", "%.5g"]


@pytest.mark.parametrize(("form", "close"), [(WHOLE, 1e-9), (ROUNDED, 1e-4)])
def test_a_record_of_a_run_is_fitted_exactly(data, tmp_path, form, close):
    """With all digits or few of them: what is left is no model error, and errors are those of the precision."""
    found = fitted(data(form=form), tmp_path / "fit")
    assert found.ok, found.verdict
    assert found.verdict.endswith(", exact: residuals are at the precision of record and search")
    assert any(note.startswith("residuals of chain.tension.max ") for note in found.answer.notes)
    assert found.answer.numbers == pytest.approx(list(TRUTH.values()), rel=close)
    assert max(map(abs, deviations(found))) < 4.0
    assert min(found.answer.errors) > 1e-9 * TRUTH["chain.span"], "errors are below what can be told"


@pytest.mark.parametrize(("form", "size"), [(WHOLE, 1e-5), (ROUNDED, 5e-4)])
def test_a_smooth_rest_above_the_digits_is_no_exact_fit(data, measured, tmp_path, form, size):
    """The twins: what no number explains, 1e-5 of a signal, or 5e-4 of it where five digits are written."""
    off = {name: values * (1.0 + size * np.sin(300.0 * T)) for name, values in measured.items()}
    found = fitted(data(of=off, form=form), tmp_path / "fit")
    assert not found.ok
    assert "exact" not in found.verdict
    assert " are no noise, neighbours are correlated by " in found.verdict


def test_a_shift_that_cannot_be_found_is_refused(data, noise, tmp_path):
    """Started far off, the run is unlike the record wherever that is laid."""
    options = {"noise": noise, "more": ["chain.span=0.55"]}
    with pytest.raises(fitting.BadInput, match=r"^shift find: the run of the start differs from .* its clock cannot"):
        fitted(data(3), tmp_path / "fit", [MASS], shift="find", **options)


def test_a_wrong_noise_is_no_success(data, noise, tmp_path):
    found = fitted(data(3), tmp_path / "fit", noise={name: 0.5 * size for name, size in noise.items()})
    assert not found.ok
    assert 3.0 < found.answer.chi2 < 5.0
    assert found.verdict.startswith("no fit: chi2/n is ")


def test_numbers_that_cannot_be_told_apart_are_named(data, noise, tmp_path):
    """The chain touches no ground, so no signal depends on its friction; the mass is found beside it."""
    free = "vehicle.contact.ground.friction", MASS
    found = fitted(data(3), tmp_path / "fit", free, noise=noise, more=["chain.span=0.72"])
    assert "no signal depends on vehicle.contact.ground.friction" in found.verdict
    assert found.answer.errors[0] == np.inf
    assert found.answer.numbers[1] == pytest.approx(17.0, abs=4.0 * found.answer.errors[1])


def test_a_bound_that_is_met_is_no_success(data, noise, tmp_path):
    found = fitted(data(3), tmp_path / "fit", ["vehicle.track.mass=18:40 kg"], noise=noise, more=["chain.span=0.72"])
    assert "vehicle.track.mass ends at its bound, 18" in found.verdict


@pytest.mark.long
def test_a_fit_goes_on_where_it_was_interrupted(data, noise, tmp_path, monkeypatch):
    """Runs that are finished are not made again, and the answer is the same."""
    file = data(3)
    whole = fitted(file, tmp_path / "whole", noise=noise)
    made = []

    def counted(*arguments, **options):
        made.append(1)
        if len(made) == 7:
            raise KeyboardInterrupt
        return simulate(*arguments, **options)

    monkeypatch.setattr(least_squares, "simulate", counted)
    with pytest.raises(KeyboardInterrupt):
        fitted(file, tmp_path / "fit", noise=noise)
    before = len(list((tmp_path / "fit" / "cases").iterdir()))
    assert before == 5  # the first run, which reads the units, is not one of them
    again = fitted(file, tmp_path / "fit", noise=noise)
    assert again.answer.numbers == whole.answer.numbers
    assert len(made) - 7 == len(list((tmp_path / "fit" / "cases").iterdir())) - before + 1


def test_the_command_writes_a_scene_that_runs(cotrack, data, noise, tmp_path):
    mapped = [part for name in SIGNALS for part in ("--map", f"{name}={name}", "--noise", f"{name}={noise[name]!r}")]
    settings = [part for text in SETTINGS for part in ("--set", text)]
    free = "--free", SPAN, "--free", MASS
    asked = "fit", "hanging_chain", "--track", "rigid", "--data", data(3), *mapped, *settings, *free, "-o", "f"
    status, out, err = cotrack(*asked)
    assert (status, err) == (0, "")
    assert out.startswith("fitted: 2 numbers by 102 samples of 2 signals, chi2/n ")
    result = json.loads(Path("f/fit.json").read_text())
    numbers = {record["key"]: record["fitted"] for record in result["numbers"]}
    assert result["ok"]
    for name in ("fitted.toml", "fitted_vehicle.toml"):
        assert (
            f"  # fitted to {tmp_path / 'data3.csv'}, 0 s added to its times; standard error "
            in Path("f", name).read_text()
        )
    scene = load("f/fitted.toml")
    same = load("hanging_chain", "rigid", [*SETTINGS, *(f"{key}={value!r}" for key, value in numbers.items())])
    assert {**scene.resolved(), "name": ""} == {**same.resolved(), "name": ""}
    assert Path("f/fit.png").stat().st_size > 10_000
    status, repeated, err = cotrack(*asked)
    assert (status, repeated) == (0, out)
    names = "fit.csv, fit.md, fit.png, fit.svg, fit.json, fitted.toml, fitted_vehicle.toml, residuals.csv"
    assert err == f"cotrack: in f are replaced: {names}\n"
    kept = {name: Path("f", name).read_bytes() for name in ("fitted.toml", "fitted_vehicle.toml")}
    Path("f/residuals.csv").write_bytes(asked[5].read_bytes())
    Path("scene.toml").write_text(kept["fitted.toml"].decode().replace("fitted_v", "f/fitted_v"))
    of_own_scene, of_own_data = [*asked], [*asked]
    of_own_scene[1], of_own_data[5] = "f/fitted.toml", "f/residuals.csv"
    of_own_vehicle = ["fit", "scene.toml", *asked[2:]]
    for words, name in (
        (of_own_scene, "fitted.toml"), (of_own_data, "residuals.csv"), (of_own_vehicle, "fitted_vehicle.toml"),
    ):  # fmt: skip
        assert f"'f/{name}' cannot be written: it is a file that is read" in cotrack.refused(*words)
    assert {name: Path("f", name).read_bytes() for name in kept} == kept


@pytest.mark.parametrize(
    ("free", "said"),
    [
        ("chain.spann", "free chain.spann: hanging_chain.toml has no such number ('spann'): did you mean 'span'?"),
        ("chain.span.x", "free chain.span.x: hanging_chain.toml has no such number ('x'): it has no parts"),
        ("track.start", "free track.start: is \"displaced\" in hanging_chain.toml, and a real number is needed"),
        ("chain.links", "free chain.links: is 8 in hanging_chain.toml, and a real number is needed"),
        ("run.stop", "free run.stop: cannot be changed a little: hanging_chain.toml: run: stop = 0.050005 s must be"),
        ("chain.span=1", "free chain.span=1: must be KEY or KEY=FROM:TO"),
        ("chain.span=0.5:0.6", "free chain.span=0.5:0.6: the scene has "),
        ("chain.span=0.9:0.5", "free chain.span=0.9:0.5: FROM must be below TO"),
        ("start.heading", "free start.heading: the scene has 0, so a range KEY=FROM:TO must say"),
    ],
)  # fmt: skip
def test_a_number_that_cannot_be_fitted_is_refused(data, tmp_path, free, said):
    with pytest.raises(fitting.BadInput) as refused:
        fitted(data(), tmp_path / "fit", [free])
    assert str(refused.value).startswith(said)
    assert not (tmp_path / "fit").exists()


def test_every_scene_needs_the_numbers(data, tmp_path):
    file = data()
    with pytest.raises(fitting.BadInput, match=r"^free chain\.span: rig\.toml has no such number \('chain'\)"):
        fitting.fit("hanging_chain", [file, f"rig={file}"], SIGNALS, [SPAN], tmp_path / "fit")
    assert not (tmp_path / "fit").exists()


def test_a_signal_that_no_run_has_is_refused(data, tmp_path):
    with pytest.raises(fitting.BadInput, match=r"^a run of hanging_chain has no signal 'chain\.pull'"):
        fitting.fit("hanging_chain", data(), {"chain.pull": "t"}, [SPAN], tmp_path / "fit", settings=SETTINGS)
    assert not (tmp_path / "fit").exists()


def test_a_noise_of_no_signal_is_refused(cotrack, data):
    err = cotrack.refused(
        "fit", "hanging_chain", "--track", "rigid", "--data", data(), "--map", "chain.tension.max=chain.tension.max",
        "--free", "chain.span", "--noise", "chain.sag=1", "-o", "f",
    )  # fmt: skip
    assert err == "cotrack: noise chain.sag: this signal is given no column\n"
