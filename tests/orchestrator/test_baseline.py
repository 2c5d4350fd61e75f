"""The baseline: states that are kept and completed, one evaluation of every kind of link, and what it finds off."""

import copy
import json
import subprocess
import sys

import numpy as np
import pytest

from fmus.vehicle import BadInput
from orchestrator.cli import main
from orchestrator.studies import baseline, baseline_file, evaluations, growth
from orchestrator.studies.baseline_file import FILE, Grown
from orchestrator.studies.chain_states import Elastic, code, completed, direction, keep
from orchestrator.studies.evaluations import KINDS, SOFT, Chain
from orchestrator.studies.gathering import Source, gather, sources
from orchestrator.studies.projections import GROUPS, vector

PITCH = 0.1524
SHORT = (
    Source("rig", "rig", "rigid", ("drive.ramp_start=0", "drive.ramp_time=0.1"), 0.025),
    Source("bench", "sprocket_bench", "rigid", (), 0.012),
    Source("held", "released_chain", "rigid", ("chain.links=8",), 0.012),
)
CONTACT = ("contact residual", "contact matrix", "wrenches", "contact powers")


SELDOM = "general", "engineering"  # cables with other strains: a study
EACH = [pytest.param(kind, marks=pytest.mark.study) if kind in SELDOM else kind for kind in KINDS]


@pytest.fixture(scope="module")
def made(tmp_path_factory, request):
    """A baseline of three short runs, as it is read again, of the kinds of links that are tested."""
    file = tmp_path_factory.mktemp("baseline") / "small.npz"
    tested = {kind: own for kind, own in KINDS.items()
              if kind not in SELDOM or any(kind in item.nodeid for item in request.session.items)}  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(baseline, "KINDS", tested)
        baseline.make("0123456789abcdef", file, 1, SHORT, (), ())
    return baseline_file.load(file)


def loop(links: int = 24, states: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Pins and velocities of a loop that is no circle and turns; opposite links are parallel."""
    turn = 2.0 * np.pi * np.arange(links) / links
    angle = turn + 0.2 * np.arange(1, states + 1)[:, None] * np.sin(2.0 * turn + 0.5)
    pins = 0.3 + 1.001 * PITCH * np.cumsum(np.stack([np.cos(angle), np.sin(angle)], axis=-1), axis=1)
    return pins, np.stack([-3.0 * pins[..., 1], 3.0 * pins[..., 0]], axis=-1)


def test_directions_and_their_codes():
    codes = np.arange(1 << 16)
    unit = direction(codes)
    assert np.abs((unit**2).sum(axis=-1) - 1.0).max() < 1e-15
    assert np.array_equal(code(7.0 * unit), codes)
    angles = np.random.default_rng(1).uniform(-np.pi, np.pi, 1000)
    found = direction(code(np.stack([np.cos(angles), np.sin(angles)], axis=-1)))
    assert np.abs(found[:, 0] * np.sin(angles) - found[:, 1] * np.cos(angles)).max() < 7e-5


def test_kept_states_are_near_and_closed():
    pins, velocities = loop()
    wheels = np.array([[[0.3, -0.2, 0.7, 1.0, -2.0, 5.0]]] * len(pins))
    kept = keep(pins, velocities, wheels, PITCH, True)
    assert sum(array.nbytes for array in kept) < 6 * pins.size
    full = completed(kept, PITCH, True, 3)
    chords = np.roll(full.coordinates.position, -1, axis=1) - full.coordinates.position
    length = PITCH * (1.0 + kept.stretch[:, None])
    assert np.abs(kept.stretch - 1e-3).max() < 1e-6
    assert np.abs(np.linalg.norm(chords[0], axis=-1) / length[0] - 1.0).max() < 1e-4
    assert np.abs(full.coordinates.position[0][:, [0, 2]] - pins[0]).max() < 5e-5
    assert np.abs(full.rates.position[0][:, [0, 2]] - velocities[0]).max() < 1e-2
    assert np.abs(full.coordinates.position[0][:, 1]).max() == 0.0
    assert np.abs(full.coordinates.position[3][:, 1]).max() > 1e-3
    assert np.abs(full.rigid.turn[..., 0] ** 2 + (full.rigid.turn[..., 1:] ** 2).sum(-1) - 1.0).max() < 1e-15
    x, y, z = np.moveaxis(full.wheels[0, 0, 4:7], -1, 0)
    w = full.wheels[0, 0, 3]
    turned = np.arctan2(-2 * (x * z - w * y), 1 - 2 * (y * y + z * z))  # of its x axis, towards -z
    assert turned == pytest.approx(-1.4, abs=1e-3)
    again, other = completed(kept, PITCH, True, 3), completed(kept, PITCH, True, 4)
    assert np.array_equal(full.accelerations.begin, again.accelerations.begin)
    assert not np.array_equal(full.accelerations.begin, other.accelerations.begin)


def test_a_state_that_is_not_finite_is_not_kept():
    pins, velocities = loop()
    pins[1, 2, 0] = np.nan
    with pytest.raises(ValueError, match="not finite"):
        keep(pins, velocities, np.zeros((4, 0, 6)), PITCH, True)


@pytest.mark.parametrize("kind", [kind for kind in EACH if kind != "rigid"])
def test_the_matrix_is_the_derivative_of_the_residual(kind):
    """Of all coordinates, along a direction; so the adapter takes nothing from the condensation but arithmetic."""
    run = gather(SHORT[2])
    states = run.completed()
    state, chain, h = states.at(1), Chain(kind, run.config, run.parameters, SOFT), 2e-2
    by = evaluations.slopes(evaluations.coefficients(evaluations.RADIUS), h)
    found = chain.evaluate(state, h, vector())
    model = chain._model
    shape = model.s.q.shape
    d = Elastic(*(np.zeros_like(part) for part in state.coordinates))
    flat, at = vector()[: model.s.q.size].reshape(shape), chain._layout
    for field, place, axes in at:
        part = getattr(d, field)
        part[(..., axes) if axes else ...] = flat[place] if axes else flat[place][:, 0]
    if not run.config["track"]["closed"]:
        d.position[0] = d.axis[0] = 0.0  # the ground's
        flat = flat.copy()
        flat[0, : model.kit.LAYOUT.fixed] = 0.0
        found = chain.evaluate(state, h, np.concatenate([flat.ravel(), np.zeros(10)]))

    def residual(step: float) -> np.ndarray:
        def moved(part: Elastic, rate: float) -> Elastic:
            return Elastic(*(a + step * rate * b for a, b in zip(part, d, strict=True)))

        moved_state = state._replace(
            coordinates=moved(state.coordinates, 1.0),
            rates=moved(state.rates, by.v),
            accelerations=moved(state.accelerations, by.vdot),
        )
        return chain.evaluate(moved_state, h, vector()).residual

    step = 1e-6
    numeric = (residual(step) - residual(-step)) / (2.0 * step)
    assert np.abs(found.matrix - numeric).max() < 1e-4 * np.abs(numeric).max()
    assert np.abs(1.01 * found.matrix - numeric).max() > 3e-3 * np.abs(numeric).max()


def test_the_file_is_what_was_made(made):
    assert made.made["commit"] == "0123456789abcdef"
    assert {"numpy", "numba", "processor"} <= set(made.made)
    assert [run.name for run in made.runs] == [source.name for source in SHORT]
    assert made.states == sum(len(values) for values in made.numbers["cable"])
    run = gather(SHORT[0])
    for kept, again in zip(made.runs[0].kept, run.kept, strict=True):
        assert np.array_equal(kept, again)
    assert made.runs[0].config == json.loads(json.dumps(run.config))


@pytest.mark.parametrize("kind", EACH)
def test_the_same_tree_is_the_same(made, kind):
    apart, places = baseline.deviations(kind, made)
    assert len(places) == made.states
    assert apart.max() < 1e-12
    brief, _ = baseline.deviations(kind, made, brief=2)
    assert len(brief) == 2 * len(SHORT)


def with_vehicle(known, *keys: str, off: float = 1e-9):
    """The baseline, its chains with a number of the vehicle that is ``off`` by so much of it."""
    runs = []
    for run in known.runs:
        table = vehicle = copy.deepcopy(run.config["vehicle"])
        for key in keys[:-1]:
            table = table[key]
        table[keys[-1]] *= 1.0 + off
        runs.append(run._replace(config=run.config | {"vehicle": vehicle}))
    return known._replace(runs=runs)


def missed(kind: str, known, **how) -> set[str]:
    apart, _ = baseline.deviations(kind, known, **how)
    return {group for group, column in zip(GROUPS[kind], apart.T, strict=True) if column.max() > baseline.TOLERANCE}


@pytest.mark.parametrize("kind", ["cable", "planar", "beam", "rigid"])
def test_a_contact_that_is_off_by_a_billionth_is_found(made, kind):
    assert missed(kind, made) == set()
    assert set(CONTACT) <= missed(kind, with_vehicle(made, "contact", "sprocket", "stiffness"))
    # planar links hardly slide on wheels so early: their power is a hundredth of what powers are relative to
    assert set(CONTACT[:3]) <= missed(kind, with_vehicle(made, "contact", "wheel", "stiffness"))
    assert "contact matrix" in missed(kind, with_vehicle(made, "contact", "wheel", "friction"))


def one_force_off(monkeypatch) -> None:
    """The twin: of the contact forces of a bare chain the middle one in size is off by 1e-9, and no other."""
    evaluate = Chain.evaluate

    def off(self, *arguments, **named):
        found = evaluate(self, *arguments, **named)
        if self.variant == evaluations.BARE:
            size = np.sort(np.abs(found.residual)[np.abs(found.residual) > 100.0])
            if len(size):
                found.residual[np.abs(found.residual) == size[len(size) // 2]] *= 1.0 + 1e-9
        return found

    monkeypatch.setattr(Chain, "evaluate", off)


@pytest.mark.parametrize("kind", ["cable", "planar", "beam", "rigid"])
def test_one_contact_force_that_is_off_by_a_billionth_is_found(made, kind, monkeypatch):
    one_force_off(monkeypatch)
    assert missed(kind, made) == {"contact residual"}


@pytest.mark.parametrize(
    ("kind", "keys", "groups"),
    [
        ("cable", ("section", "bending"), {"soft residual"}),
        ("planar", ("track", "mass"), {"soft residual", "soft matrix"}),
        ("beam", ("material", "shear_modulus"), {"soft residual", "soft matrix", "matrix"}),
        pytest.param(
            "engineering", ("section", "area"), {"soft residual", "soft matrix", "matrix"}, marks=pytest.mark.study
        ),
        ("rigid", ("track", "mass"), {"residual", "matrix"}),
    ],
)
def test_links_that_are_off_by_a_billionth_are_found(made, kind, keys, groups):
    assert groups <= missed(kind, with_vehicle(made, *keys))


def test_torsion_that_is_off_by_a_hundred_millionth_is_found(made):
    """Links hardly twist: a tenth of that hides behind bending and shear."""
    assert {"residual", "soft residual", "report"} <= missed("beam", with_vehicle(made, "section", "torsion", off=1e-8))


def test_a_number_that_is_none_is_infinitely_far(made, monkeypatch):
    evaluate = Chain.evaluate

    def off(self, *arguments, **named):
        found = evaluate(self, *arguments, **named)
        return found._replace(report=found.report * np.nan)

    monkeypatch.setattr(Chain, "evaluate", off)
    assert missed("rigid", made, brief=1) == {"report"}


# --- runs and errors -------------------------------------------------------------------------------


def known_growth() -> Grown:
    t = growth.EVERY * np.arange(51)
    values = np.stack([np.sin(t) + k for k in range(len(growth.SIGNALS))], axis=1)
    changes = [values + 1e-14 * np.exp(3.0 * t)[:, None] * s for s in (1.0, -0.5)]
    return growth.grown(growth.RUNS[0], [values, *changes])


def test_a_run_may_come_apart_as_one_ulp_does(monkeypatch):
    known = known_growth()
    assert np.allclose(known.growth[-1], 1e-14 * np.exp(3.0), rtol=0.05)
    monkeypatch.setattr(baseline_file, "load", lambda file: baseline_file.Baseline({}, [], {}, {}, [known], {}))
    for factor, good in ((0.0, True), (20.0, True), (1e4, False)):
        run = known.values + factor * known.growth
        monkeypatch.setattr(baseline, "trajectory", lambda pair, stop, run=run: (None, run[:26]))
        rows = baseline.one_run(0, "", "", 0, True)
        assert len(rows) == len(growth.SIGNALS)
        assert all(row.ok is good for row in rows)
        assert all(len(row["series"]) == 25 for row in rows)


def test_one_ulp_is_one_ulp():
    (setting,) = growth.changed(growth.RUNS[0], "gravity")
    key, _, value = setting.partition("=")
    assert key == "vehicle.gravity"
    assert float(value) == np.nextafter(9.81, 10.0)


def test_an_error_must_not_be_larger(monkeypatch):
    window = baseline.WINDOWS[0].name
    before = {window: {"torque": {"error": 0.02, "doubt": 1e-5}, "position": {"error": 0.0, "doubt": 0.0}}}
    monkeypatch.setattr(baseline_file, "load", lambda file: baseline_file.Baseline({}, [], {}, {}, [], before))
    for error, good in ((0.01, True), (0.0203, True), (0.021, False)):
        now = {"torque": {"error": error, "doubt": 1e-5}, "position": {"error": 0.0, "doubt": 0.0}}
        monkeypatch.setattr(baseline, "errors", lambda window, now=now: now)
        rows = baseline.one_error(0, "", "", 0, False)
        assert [row.ok for row in rows] == [good, True]


# --- the study -------------------------------------------------------------------------------------


def test_sources_are_all_scenes_with_tracks_and_all_families():
    names = [source.name for source in sources()]
    assert len(set(names)) == len(names) > 120
    for part in ("upside down", "rolled over", "obstacle", "locked", "tension at the", "released", "element=beam"):
        assert any(part in name for name in names), part


def test_without_a_baseline_there_is_one_sentence(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(baseline_file, "FILE", tmp_path / "none.npz")
    monkeypatch.setattr(sys, "argv", ["cotrack", "study", "baseline", "-o", str(tmp_path / "found")])
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr().err
    assert ended.value.code == 2
    assert "there is no baseline" in said
    assert len(said.splitlines()) == 1
    (tmp_path / "broken.npz").write_bytes(b"PK")
    with pytest.raises(BadInput, match="cannot be read"):
        baseline_file.load(tmp_path / "broken.npz")
    with pytest.raises(BadInput, match="must be the hash"):
        baseline.make("HEAD", tmp_path / "x.npz")


def test_the_study_writes_tables_and_a_figure(made, monkeypatch, capsys, tmp_path):
    file = tmp_path / "small.npz"
    baseline_file.save(file, made._replace(grown=[known_growth()]))
    cases = [case for case in baseline.cases(True, file) if case.name in ("rigid", growth.RUNS[0].name)]
    known = known_growth()
    monkeypatch.setattr(baseline, "trajectory", lambda pair, stop: (None, known.values))
    monkeypatch.setattr(baseline, "cases", lambda quick: cases)
    monkeypatch.setattr(sys, "argv", ["cotrack", "study", "baseline", "--workers", "1", "-o", str(tmp_path / "found")])
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr()
    assert not ended.value.code, said.err
    assert "| a | rigid: contact residual, relative |" in said.out
    assert f"| b | {growth.RUNS[0].name}: {growth.SIGNALS[0]}, over the growth of one ulp |" in said.out
    assert {f.name for f in (tmp_path / "found").iterdir() if f.is_file()} == {
        "baseline.csv", "baseline.md", "baseline.png", "baseline.svg",
    }  # fmt: skip


def test_runs_that_a_file_lacks_are_added_and_the_rest_stays(made, monkeypatch, tmp_path):
    file, known, asked = tmp_path / "small.npz", known_growth(), []
    baseline_file.save(file, made._replace(grown=[known]))
    monkeypatch.setattr(
        baseline, "_signals", lambda pair, settings: asked.append((pair.name, settings)) or known.values + len(asked)
    )
    lacking = growth.Pair("turn", "flexible", 4.0, 0.5)
    baseline.add("abcdef01", file, 1, (growth.RUNS[0], lacking))
    assert {name for name, _ in asked} == {"turn, flexible"}
    assert len({settings for _, settings in asked}) == 1 + len(growth.CHANGED)
    found = baseline_file.load.__wrapped__(file)
    assert [one.name for one in found.grown] == [known.name, "turn, flexible"]
    assert found.made["turn, flexible"] == "abcdef01"
    assert found.made["commit"] == made.made["commit"]
    np.testing.assert_allclose(found.grown[1].values, known.values + 1)
    assert found.states == made.states


# --- this tree -------------------------------------------------------------------------------------

of_this_tree = pytest.mark.skipif(not FILE.is_file(), reason="orchestrator/studies/baseline.npz is not made yet")


@of_this_tree
@pytest.mark.parametrize("kind", EACH)
def test_this_tree_is_that_of_the_baseline(kind):
    """A state or two of every other run; ``cotrack study baseline`` takes all."""
    known = baseline_file.load(FILE)
    assert known.states >= baseline.STATES
    assert missed(kind, known, brief=1, every=2) == set()


@of_this_tree
def test_this_tree_with_one_contact_force_off_is_not(monkeypatch):
    known = baseline_file.load(FILE)
    one_force_off(monkeypatch)
    assert missed("cable", known, brief=1, every=4) == {"contact residual"}


@of_this_tree
@pytest.mark.study
def test_the_quick_form_on_this_tree(environment, tmp_path):
    command = [sys.executable, "-m", "orchestrator", "study", "baseline", "--quick", "-o", str(tmp_path)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
