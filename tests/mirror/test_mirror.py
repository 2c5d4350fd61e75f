"""Every output of every component against independent code from states, inputs and other outputs.

Each kind of link drives a vehicle that starts turned and elsewhere, speeds up, yaws, brakes and nods; ends, soft links
and the hull have runs of their own (``runs``). `tests/README.md` says how to add a check.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from fmus import components
from fmus.fmi.slave import BUILD, Slave
from fmus.ground.tables import number_meanings
from fmus.track.choices import TRACKS
from mirror import chassis_checks, drive_checks, driver_checks, joined_checks, runs, track_checks
from mirror.check import FAULTS, Check, View
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load, scene_names

# outputs that other tests of this module check: of tracks, of all components
COUNTED = ("solver.steps", "solver.evaluations", "solver.iterations", "solver.rejected")
STATUS = "status"
BRIEF = ("cable", "driven", "drawn cable")  # few kernels


class Kind(NamedTuple):
    """A kind of component; of flexible tracks, a kind of links."""

    fmu: str  # kind of component
    checks: tuple[Check, ...]
    zero: str = "-"  # outputs that are 0 by definition
    scene: str = "straight"  # it has such a component
    asked: str = ".*"  # outputs in which planted faults are looked for


# outputs that depend on the elasticity
STRAINED = r"tension\..*|stress\.max|link\[\d+\]\.(?!wheels).*|joint\[\d+\]\.force\.[xy]|energy\.strain"
NO_BUSHES = r"energy\..*\.pins"
FLEXIBLE = Kind("TrackFlexible", track_checks.CHECKS, NO_BUSHES)
# 0 by definition: rigid links have no strain; a chain in its plane turns no wheel about an upright axis, has level pins
# and no guides; the last pins of open chains are level; a chain that turns has no pulled ends and no damped pins
MIRRORED = {
    "TrackRigid": Kind(
        "TrackRigid",
        track_checks.CHECKS,
        r"stress\.max|link\[\d+\]\.(stress|fibre\..*)|energy\.(strain|.*\.(material|pins))|joint\[65\]\.(axis\.z|moment\..*)",
    ),
    "cable": FLEXIBLE._replace(
        zero=r"joint\[\d+\]\.axis\.z|joint\[65\]\.moment\..*|link\[\d+\]\.horn\..*|energy\..*\.guides|energy\..*\.pins"
    ),
    "turning": FLEXIBLE._replace(zero=r"energy\.work|energy\..*\.joints|energy\..*\.pins"),
    "planar": FLEXIBLE._replace(
        zero=r".*\.torque\.z|joint\[\d+\]\.(axis\.z|moment\..*)|link\[\d+\]\.horn\..*|energy\..*\.guides|energy\..*\.pins"
    ),
    "beam": FLEXIBLE._replace(zero=r"joint\[65\]\.(axis\.z|moment\..*)|energy\..*\.pins"),
    "general": FLEXIBLE._replace(asked=STRAINED),
    "engineering": FLEXIBLE._replace(asked=STRAINED),
    "Chassis": Kind("Chassis", chassis_checks.CHECKS),
    "SprocketDrive": Kind("SprocketDrive", drive_checks.CHECKS),
    "SteeringDifferential": Kind("SteeringDifferential", joined_checks.CHECKS, scene="differential"),
    "Driver": Kind("Driver", driver_checks.CHECKS, scene="serpentine"),
}
FMUS = {kind.fmu: kind for kind in MIRRORED.values()}
SOMETHING = "something where nothing is"
SOIL = r"(link\[\d+\]\.(ground|wheels|rim|horn)|joint\[\d+\]\.tooth)\..*"  # 0 for links without contact within a run


class Finding(NamedTuple):
    """Result of a check for one output in one run."""

    kind: str
    part: str
    output: str
    basis: str
    relative_error: float  # error over the tolerance
    noticed: frozenset[str]  # planted faults in the output that the check notices


@cache
def findings_of(run: str) -> tuple[Finding, ...]:
    """All checks of a run, on its outputs and on outputs with each fault planted."""
    record, findings = runs.record(run), []
    for part in record.parts.values():
        if part.name in (runs.RUNS | runs.STUDIES)[run].without:
            continue
        view = View(record, part.name)
        for check in FMUS[part.kind].checks:
            if check.applies(view):
                for output, (low, high) in check.bounds(view).items():
                    y = part[output]
                    faulty = {fault: plant(y) for fault, plant in FAULTS.items()} | {SOMETHING: y + 1.0}
                    noticed = frozenset(
                        fault for fault, z in faulty.items() if check.relative_error(z, low, high) > 1.0
                    )
                    findings.append(
                        Finding(view.kind, part.name, output, check.basis, check.relative_error(y, low, high), noticed)
                    )
    return tuple(findings)


def assert_right(run: str) -> None:
    wrong = [f for f in findings_of(run) if not f.relative_error <= 1.0]
    assert not wrong, "\n".join(
        f"{f.part}.{f.output} ({f.basis}): {f.relative_error:.3g} of what is allowed" for f in wrong[:20]
    )
    assert findings_of(run)


@pytest.mark.parametrize(
    "run", [run if run in BRIEF else pytest.param(run, marks=pytest.mark.long) for run in runs.RUNS]
)
def test_outputs_are_what_states_and_inputs_make_of_them(run):
    assert_right(run)


@pytest.mark.study
@pytest.mark.parametrize("run", runs.STUDIES)
def test_outputs_of_runs_that_compile_long(run):
    assert_right(run)


@cache
def noticed(kind: str) -> dict[str, set[str]]:
    """Faults that some check notices in some run, by output of a kind of component."""
    faults = defaultdict(set)
    for run in runs.RUNS:
        for finding in findings_of(run):
            if finding.kind == kind:
                faults[finding.output] |= finding.noticed
    return faults


@pytest.mark.long
@pytest.mark.parametrize("fault", [*FAULTS, SOMETHING])
@pytest.mark.parametrize("kind", MIRRORED)
def test_a_planted_fault_is_noticed(kind, fault):
    """A fault planted in any output is noticed by a check of that output in one of the runs."""
    nothing, asked = MIRRORED[kind].zero, MIRRORED[kind].asked
    outputs = [
        output
        for output in noticed(kind)
        if re.fullmatch(asked, output) and bool(re.fullmatch(nothing, output)) == (fault == SOMETHING)
    ]
    assert outputs or fault == SOMETHING
    missed = {output for output in outputs if fault not in noticed(kind)[output]}
    soil = {output for output in noticed(kind) if re.fullmatch(SOIL, output)}
    off_the_ground = {output for output in missed & soil if SOMETHING in noticed(kind)[output]}
    assert not missed - off_the_ground
    assert off_the_ground != soil or not soil


def test_every_kind_of_component_has_checks_and_a_scene():
    kinds = {part.kind for name in scene_names() for model in TRACKS for part in assemble(load(name, model)).parts}
    assert set(FMUS) == kinds == set(components.COMPONENT_KINDS)


# --- counters --------------------------------------------------------------------------------------


@pytest.mark.long
def test_counters_of_a_track_count_what_is_called(environment):
    """The counters of a track equal the calls in uncompiled integrators.

    Evaluations, iterations and steps are counted as they are called.
    """
    program = Path(__file__).with_name("counted.py")
    done = subprocess.run([sys.executable, str(program)], env={**environment, "NUMBA_DISABLE_JIT": "1"},
                          capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 0, done.stderr
    for kind, steps in json.loads(done.stdout).items():
        for step in steps:
            assert step["shown"] == step["counted"], kind
        last, before = np.array(steps[-1]["shown"]), np.array(steps[0]["shown"])
        assert (last > before).all(), "a counter stands still and so is not checked"
        assert len(last) == len(COUNTED)
        assert [round(1.05 * count) for count in last[:3]] != steps[-1]["counted"][:3]


# --- outputs of the FMU shell, and the list of all outputs ----------------------------------------


def shell(kind: str, config: dict, folder: Path) -> Slave:
    """A component as an FMI tool sees it, with its modelDescription, without a build."""
    folder.mkdir(parents=True)
    (folder / "config.json").write_text(json.dumps(config))
    (folder / "build.txt").write_text(BUILD)
    (folder / "shape.txt").write_text("")
    (folder / "numbers.json").write_text(json.dumps(number_meanings()))
    return type(kind, (Slave,), {"model": components.model_of(kind), "__doc__": kind})(
        instance_name=kind, resources=str(folder), visible=False
    )


def output_names(slave: Slave) -> list[str]:
    """Names of the outputs in modelDescription.xml."""
    variables = slave.to_xml().find("ModelVariables")
    return [v.get("name") for v in variables if v.get("causality") == "output"]


class SteppedSlave:
    """Slave whose status is read after each step."""

    def __init__(self, slave: Slave) -> None:
        self.slave, self.t = slave, 0.0
        self.where = {port.name: k for k, port in enumerate(slave.variables)}
        slave.setup_experiment(0.0)
        slave.enter_initialization_mode()
        slave.exit_initialization_mode()

    def step(self, **inputs: float) -> tuple[bool, int]:
        for name, value in inputs.items():
            self.slave.set_real([self.where[name]], [value])
        done = self.slave.do_step(self.t, 1e-3)
        self.t += 1e-3
        return done, self.status

    @property
    def status(self) -> int:
        return self.slave.get_integer([self.where[STATUS]])[0]


@pytest.mark.parametrize("kind", FMUS)
def test_status_says_how_the_last_step_went(kind, tmp_path):
    """The status output is 0 after a good step, 1 after a warning, 3 after a failure."""
    model = next((name for name, track in TRACKS.items() if track.fmu == kind), "flexible")
    part = next(part for part in assemble(load(FMUS[kind].scene, model)).parts if part.kind == kind)
    component = SteppedSlave(shell(kind, part.config, tmp_path / "resources"))
    first = component.slave.variables[0].name
    assert component.status == 0
    assert component.step() == (True, 0)
    if kind == "TrackFlexible":  # cables tilted by half a degree
        half = np.radians(0.25)
        tilted = {"idler.orientation.w": np.cos(half), "idler.orientation.x": np.sin(half)}
        assert component.step(**tilted) == (True, 1)
        assert component.step() == (True, 0)
    assert component.step(**{first: np.nan}) == (False, 3)
    assert component.step(**{first: 0.0}) == (False, 3)


@cache
def described() -> dict[str, set[str]]:
    """Outputs in the modelDescriptions of all components of the gallery, with each track model, by FMU."""
    from tempfile import TemporaryDirectory

    outputs, seen = defaultdict(set), set()
    with TemporaryDirectory() as folder:
        for name in scene_names():
            for model in TRACKS:
                for part in assemble(load(name, model, [runs.ALL])).parts:
                    key = part.kind, json.dumps(part.config, sort_keys=True)
                    if key not in seen:
                        seen.add(key)
                        outputs[part.kind] |= set(
                            output_names(shell(part.kind, part.config, Path(folder, str(len(seen)))))
                        )
    return outputs


# Outputs of longer chains, further wheels, return rollers and elements of the suspension; the m113 of the mirror has
# none. Equal code computes them for each link and wheel; test_vehicle_layouts.py balances the forces on rollers,
# test_chassis.py tests their motion, test_suspension.py the elements. What pins with bushes turn and rub is the
# energy that they lose in test_life.py.
OF_OTHERS = re.compile(
    r"(left\.|right\.)?(return_roller|rear_idler|torsion_bar|bump_stop|rebound_stop|recoil|(road_wheel|road_arm|suspension)\[[67]\])"
    r"|(link|joint)\[(6[6-9]|7\d|8[0-3])\]|link\[65\]|joint\[\d+\]\.(turned|rubbed)"
)


@pytest.mark.long
def test_no_output_is_without_a_check():
    """Every output has a run that shows it and a check; the test lists those without."""
    without = []
    for fmu, outputs in described().items():
        for kind in (name for name, kind in MIRRORED.items() if kind.fmu == fmu and kind.asked != STRAINED):
            looked_at = set(noticed(kind)) | {STATUS} | (set(COUNTED) if fmu.startswith("Track") else set())
            if kind == "turning":  # runs on wheels only, so it has no last pin of an open chain
                looked_at |= {output for output in outputs if output.startswith("joint[65].")}
            missing = (output for output in sorted(outputs - looked_at) if not OF_OTHERS.match(output))
            without += [f"{kind}: {output}" for output in missing]
    assert not without
    assert len(described()["TrackRigid"]) > 500


@pytest.mark.long
def test_an_output_without_a_check_would_be_named(monkeypatch):
    outputs = {"TrackRigid": {"tension.min", "tension.spread"}}
    monkeypatch.setattr(sys.modules[__name__], "described", lambda: outputs)
    with pytest.raises(AssertionError, match=r"TrackRigid: tension\.spread"):
        test_no_output_is_without_a_check()
