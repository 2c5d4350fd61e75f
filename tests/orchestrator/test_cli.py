"""The command line: its output, exit codes and files."""

import json
import os
import re
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest
from short_run import SHORT, last

from fmus.vehicles import vehicle as vehicles
from orchestrator.cli import common
from orchestrator.cli.common import message_and_status
from orchestrator.execution import summary
from orchestrator.execution.log_report import summary_of
from orchestrator.execution.summary_text import lines
from orchestrator.log.extra import BROUGHT
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.log.tools import WHOLE, verify
from orchestrator.results.analyses.phases import Phase
from orchestrator.results.units import figure, number
from orchestrator.scene import scene as scene_module
from orchestrator.scene.scene import load, scene_names

ROOT = Path(__file__).parents[2]
KEYS = {
    "scene", "track", "status", "message", "simulated_time", "startup_time", "wall_time", "cpu_time",
    "real_time_factor", "communication_steps", "rejected_steps", "log", "log_bytes", "seal", "components", "fmus",
    "energy", "error", "checks", "observables", "windows", "phases", "warnings", "validity",
    "checks_after_end", "passed_over",
}  # fmt: skip


def test_scenes_lists_the_gallery(cotrack):
    status, out, _ = cotrack("scenes")
    assert status == 0
    assert [line.split()[0] for line in out.splitlines()] == scene_names()


def test_vehicles_lists_the_packaged_ones(cotrack):
    status, out, _ = cotrack("vehicles")
    assert status == 0
    assert [line.split()[0] for line in out.splitlines()] == vehicles.names()
    assert "m113        15892 kg, 64 links, 5 road wheels a side: tracked carrier" in out  # 155,896 N of weight


def test_every_command_with_scenes_takes_a_vehicle(cotrack):
    """A file that is missing is refused by its name, so each command reads the vehicle that it is given."""
    options = {"build": ("-o", "built"), "ssp": ("-o", "own.ssp"), "sweep": ("--vary", "run.stop=1,2", "-o", "swept")}
    for command in ("run", "truth", "show", "build", "ssp", "sweep"):
        status, _, err = cotrack(command, "straight", "--vehicle", "none.toml", *options.get(command, ()))
        assert (status, err) == (2, "cotrack: no vehicle file 'none.toml'\n"), command


def test_show(cotrack):
    status, out, _ = cotrack("show", "straight", "--track", "rigid")
    assert status == 0
    assert "TrackRigid" in out
    assert "left out" in out


def test_an_open_ledger_is_not_a_success(cotrack, tmp_path):
    """An open energy balance is a failure: a chain without checks falls 20 cm per step."""
    text = (Path(scene_module.__file__).parents[1] / "gallery" / "released_chain.toml").read_text(encoding="utf-8")
    (tmp_path / "fall.toml").write_text(text.partition("[expect")[0], encoding="utf-8")
    fall = ("run", "fall.toml", "--no-estimate", "--set", "chain.links=8", "--stop", "0.6", "--json")
    for step, wanted in (("50 ms", 1), ("2 ms", 0)):
        status, out, err = cotrack(*fall, "--step", step, "--set", f"track.step={step}")
        result = last(out)
        assert (result["status"], result["checks"]) == ("ok", {})
        assert status == wanted, (step, result["energy"])
        assert ("ledger" in err) == bool(wanted)
        assert lines(result)[0] == f"fall, flexible links: {'energy balance open' if wanted else 'ok'}"


def test_run_ends_with_one_json_object(cotrack, tmp_path):
    status, out, err = cotrack(*SHORT)
    assert status == 0, err
    result = last(out)
    assert set(result) == KEYS
    assert (result["status"], result["message"]) == ("ok", "")
    assert result["communication_steps"] == 20
    assert result["simulated_time"] == pytest.approx(0.02)
    assert set(result["checks"]) == {"rest"}, "checks of windows that the run does not reach are reported"
    assert set(result["components"]["chain"]) >= {
        "wall_time",
        "steps",
        "evaluations",
        "iterations",
        "rejected",
    }
    log = tmp_path / "logs" / "hanging_chain-flexible-run.stop=0.02.mcap"
    assert result["log"] == os.path.join("logs", log.name)
    assert result["log_bytes"] == log.stat().st_size
    assert verify(log).code == WHOLE


BROKEN = "import sys; sys.modules['{module}'] = None; from orchestrator.__main__ import main; main()"


@pytest.mark.parametrize(("module", "said"), [("llvmlite", "numba (module llvmlite)"), ("pydantic", "pydantic")])
def test_a_missing_package_is_named_as_it_is_installed(environment, tmp_path, module, said):
    command = [sys.executable, "-c", BROKEN.format(module=module), "scenes"]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2
    assert line.startswith(f"cotrack: {said} is not installed: pip install -c constraints.txt -e . in the clone")


def test_a_package_that_is_needed_later_is_named_too():
    """Packages with other names, or that are there but do not fit another one; an error of ours is internal."""
    missing = ModuleNotFoundError("No module named 'google'", name="google.protobuf".partition(".")[0])
    assert message_and_status(missing)[0].startswith("protobuf (module google) is not installed: pip install")
    unfit = ImportError("Numba needs NumPy 2.3 or less", name="numba")
    assert message_and_status(unfit)[0].startswith("numba is installed but cannot be imported (Numba needs NumPy 2.3")
    half = ModuleNotFoundError("No module named 'scipy.linalg'", name="scipy.linalg")
    assert message_and_status(half)[0].startswith("scipy is installed but cannot be imported (No module named")
    assert message_and_status(unfit)[1] == message_and_status(missing)[1] == 2
    assert message_and_status(ImportError("cannot import name 'x'", name="fmus.kernels.jit"))[0].startswith(
        "internal error"
    )


def test_every_package_of_the_core_has_a_name_to_install():
    """The modules that the sources import are packages of pyproject.toml, by their own names or those they come in."""
    table = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    listed = {re.split(r"[<>=]", one)[0].lower() for one in table["dependencies"]}
    listed |= {re.split(r"[<>=]", one)[0].lower() for extra in table["optional-dependencies"].values() for one in extra}
    used = set()
    for package in ("fmus", "orchestrator"):
        for file in (ROOT / package).rglob("*.py"):
            used |= {*re.findall(r"(?m)^ *(?:from|import) (\w+)(?:[\w.]* import .*| as \w+|[.\w]*)$", file.read_text())}
    others = used - sys.stdlib_module_names - {"fmus", "orchestrator", "cotrack", "dask", "these"}
    assert {BROUGHT.get(name, name) for name in others} <= listed
    assert not {name for name in BROUGHT if name in listed}


def test_run_prints_a_summary(cotrack):
    status, out, _ = cotrack("run", "hanging_chain", "--stop", "0.02", "--log", "own.mcap")
    assert status == 0
    assert out.startswith("hanging_chain, flexible links: ok")
    assert "kN" in out
    assert "own.mcap" in out


def test_a_failed_check_is_exit_1(cotrack):
    wrong = ("--set", "expect.rest.expected=1")
    status, out, _ = cotrack(*SHORT, *wrong)
    assert status == 1
    result = last(out)
    assert result["status"] == "ok"
    assert result["checks"]["rest"]["ok"] is False
    assert (
        lines(result)[0]
        == "hanging_chain, flexible links: checks NOT met: rest; 0 of 3 checks are met; 2 begin after the end"
    )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("run", "hanging_chian"), "did you mean 'hanging_chain'?"),
        (("run", "hanging_chain", "--set", "run.stp=1"), "unknown key 'run.stp'"),
        (("run", "hanging_chain", "--step", "2 kg"), "must be a quantity in s"),
        (("run", "straight", "--set", "vehicle.chassis.mass=-1"), "vehicle.chassis.mass = -1"),
        (("run", "rig", "--set", "rig.links=40"), "rig.links = 40: the track cannot be laid out"),
        (("run", "rig", "--set", "rig.tension=1e9"), "rig.tension = 1e+09 N: not reached with the idler"),
        (("run", "hanging_chain", "--set", "track.integrator=euler"), "hanging_chain.toml: track.integrator = 'euler'"),
        (("run", "hanging_chain", "--set", "track.start=straight"), "start = 'straight': must be one of rest, polygon"),
        (("run", "hanging_chain", "--set", "vehicle=none.toml"), "none.toml"),
    ],
)
def test_bad_input_is_one_sentence_and_leaves_nothing(cotrack, tmp_path, arguments, said):
    status, out, err = cotrack(*arguments, "--json")
    assert status == 2
    assert said in err
    assert len(err.splitlines()) == 1
    assert last(out)["status"] == "failed"
    assert last(out)["message"] in err
    assert list(tmp_path.rglob("*.mcap")) == []


@pytest.mark.parametrize(
    "arguments",
    [("run",), ("fly", "straight"), ("run", "hanging_chain", "--track", "soft"), ("log", "info", "none.mcap"),
     ("replay", "none.mcap", "--component", "chain"), ("build", "straight", "--all", "-o", "x")],
)  # fmt: skip
def test_other_bad_input_is_exit_2(cotrack, arguments):
    status, _, err = cotrack(*arguments)
    assert status == 2
    assert err
    assert "Traceback" not in err


@pytest.mark.long
def test_a_log_never_replaces_what_is_no_log(cotrack, tmp_path):
    (tmp_path / "folder").mkdir()
    note = tmp_path / "note.txt"
    note.write_text("mine")
    for place, said in (
        ("folder", "it is a directory"),
        ("note.txt", "there is a file that is no log"),
        ("note.txt/a.mcap", "note.txt is no folder"),
    ):
        status, out, err = cotrack(*SHORT, "--log", place)
        assert (status, last(out)["communication_steps"]) == (2, 0)
        assert said in err
        assert len(err.splitlines()) == 1
    assert cotrack("log", "recover", "note.txt", "-o", "note.txt")[0] == 1
    assert cotrack(*SHORT, "--log", "a.mcap")[0] == 0
    for target, said in (("note.txt", "is no log"), ("a.mcap", "a.mcap is the log itself")):
        status, _, err = cotrack("replay", "a.mcap", "--component", "chain", "--with", "rigid", "-o", target)
        assert status == 2
        assert said in err
    assert verify("a.mcap").code == WHOLE
    assert note.read_text() == "mine"
    status, _, err = cotrack("build", "hanging_chain", "-o", "note.txt")
    assert status == 2
    assert "the folder note.txt cannot be made" in err


def test_errors_in_the_command_line_are_short(cotrack):
    word = "x" * 3000
    wrong = (word,), ("log", word), ("show", "rig", f"--{word}"), ("run", "rig", "--track", word), ("show", word)
    for arguments in wrong:
        status, _, err = cotrack(*arguments)
        lines = [line for line in err.splitlines() if line.startswith(("Error: ", "cotrack: "))]
        assert (status, len(lines)) == (2, 1)
        assert "xxx" in lines[0]
        assert len(lines[0]) <= 400


def test_what_cannot_be_read_back_is_refused_before_the_run(cotrack, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to(tmp_path / "link")
    said = {
        "pipe": "it is a device or a pipe",
        "/dev/null": "it is a device or a pipe",
        "link": "it is a link that leads to itself",
    }
    for name, why in said.items():
        status, out, err = cotrack(*SHORT, "--log", name)
        assert (status, last(out)["status"], len(err.splitlines())) == (2, "failed", 1)
        assert f"the log {name} cannot be written: {why}" in err


def test_a_log_that_is_being_written_is_called_so(cotrack, tmp_path):
    recorder = Recorder(tmp_path / "a.mcap", {"/a/out": [("x", "m")]}, {}, {}, flush=0.01)
    recorder.write("/a/out", 0, 0.0, 0.1, np.zeros(1))
    until = time.monotonic() + 10.0
    while not cotrack("log", "info", "a.mcap", "--json")[1].count('"messages": 1'):
        assert time.monotonic() < until
    status, out, _ = cotrack("log", "info", "a.mcap")
    assert "0 to 0 s, still being written" in out
    assert "cut off" not in out
    status, out, _ = cotrack("log", "verify", "a.mcap", "--json")
    answer = json.loads(out)
    assert (status, answer["code"]) == (1, 1)
    assert answer["sentences"][-1].endswith("has no closing record: the run has come to t = 0 s")
    recorder.close("ok", "", 0)
    assert cotrack("log", "verify", "a.mcap")[0] == 0
    assert "/a/out:\n  x [m]\n" in cotrack("log", "info", "a.mcap", "--signals")[1]


@pytest.mark.parametrize(
    ("window", "said"),
    [
        ("from=0.02, to=0.03", "2 of 3 checks are met; 1 begins after the end"),
        ("from=0.01, to=0.03", "2 of 3 checks are met; 1 ends after the end"),
        ("from=0.01, to=0.02", "3 of 3 checks are met"),  # the twin
    ],
)
def test_checks_after_the_end_are_counted(cotrack, window, said):
    """In the summary, in --json, in the summary of the log and in the report."""
    check = 'expect.{}={{signal="chain.tension.max", expected=0, tolerance=1e9{}}}'
    settings = ("expect={}", check.format("now", ""), check.format("later", f", {window}"), check.format("rest", ""))
    status, out, err = cotrack(*SHORT, "--no-estimate", *(part for each in settings for part in ("--set", each)))
    result = last(out)
    assert (status, lines(result)[0]) == (0, f"hanging_chain, flexible links: ok; {said}"), err
    covered = "end" not in said
    assert set(result["checks_after_end"]) == (set() if covered else {"later"})
    assert result["checks_after_end"] == summary_of(result["log"])["checks_after_end"]
    assert cotrack("report", result["log"], "-o", "page.html")[0] == 0
    page = Path("page.html").read_text(encoding="utf-8")
    assert ("3 of 3 checks met." if covered else "2 of 3 checks met; 1 beyond its end.") in page


def test_checks_that_cannot_be_made_say_why(cotrack):
    status, out, err = cotrack(
        *SHORT,
        *("--set", "run.outputs=1000", "--set", "run.links=1000"),
        *("--set", 'expect.span={measure="span_tension", expected=1, tolerance=1}'),
        *("--set", 'expect.top={measure="tension_top", expected=1, tolerance=1}'),
        *("--set", 'expect.late={signal="chain.speed", expected=1, tolerance=1, from=0.01}'),
    )
    assert status == 1, err
    notes = {name: check["note"] for name, check in last(out)["checks"].items() if name != "rest"}
    assert notes == {
        "span": "'span_tension' finds nothing to measure in this scene and window",
        "top": "'tension_top' finds nothing to measure in this scene and window",
        "late": "'chain.speed' was not recorded between 0.01 and 0.02 s",
    }
    assert [name for name, check in last(out)["checks"].items() if check["ok"]] == ["rest"]
    assert last(out)["observables"]["tension_max"] > 0


def test_headline_figures_have_their_window(cotrack):
    status, out, _ = cotrack("run", "hanging_chain", "--track", "flexible", "--stop", "1.5", "--no-estimate")
    assert status == 0
    assert any(line.startswith("  whole run, 0 to 1.5 s: largest link tension ") for line in out.splitlines())
    assert any(line.startswith("  mean of 0.5 to 1.5 s: mean link tension ") for line in out.splitlines())
    _, out, _ = cotrack("run", "hanging_chain", "--track", "flexible", "--stop", "1.5", "--no-estimate", "--json")
    result = last(out)
    assert set(result["windows"]) == set(result["observables"])
    assert result["windows"]["tension_max"] == {"from": 0.0, "to": 1.5}
    assert result["windows"]["sag"] == {"from": 0.5, "to": 1.5}
    assert result["phases"] == [], "without a hull there are no phases"


def test_turns_of_the_last_second_are_left_to_phases(capsys):
    """The summary of a run that turned and stands at the end leaves turn radius and rate to the phases."""
    turned = dict.fromkeys(Phase._fields, float("nan")) | {
        "kind": "turn", "turning": "right", "start": 3.6, "end": 6.0, "yaw_rate": -0.25, "yaw_rate_most": -0.31,
        "radius": 7.9, "tension": 42e3, "tension_t": 3.743, "tension_track": "right_track", "speed": 1.96, "way": 4.77,
    }  # fmt: skip
    observables = {
        "tension_max": 42e3, "weight": 1.5e5, "speed": 0.0, "yaw_rate": -1e-5, "turn_radius": 242.6,
        "steering_moment": -7.5e-14, "power_left": 7.5e-4,
    }  # fmt: skip
    result = summary.empty("turn", "flexible") | {
        "simulated_time": 9.0, "observables": observables, "phases": [turned],
        "windows": summary.windows(observables, load("turn"), 9.0),
    }  # fmt: skip
    common.summary(result)
    out = capsys.readouterr().out
    assert "242.6" not in out
    assert "largest link tension 42 kN in right track at 3.743 s" in out
    assert "3.6 to 6 s: turn right at 1.96 m/s over 4.77 m; yaw rate -0.25 rad/s, -0.31 at most, radius 7.9 m" in out
    common.summary(result | {"phases": []})
    means = "speed 0 m/s, yaw rate -1e-05 rad/s, turn radius 242.6 m, steering moment 0 kN m, power left 7.5e-07 kW"
    assert f"mean of 8 to 9 s: {means}" in capsys.readouterr().out, "rounding is 0"


FLOWS = ("kinetic", "gravity", "strain", "spring", "contact")


def energy_of(work, dissipated, covered, towed, delivered, **stored):
    """Energies as in a summary; a thousandth of the work is unaccounted for."""
    left = 1e-3 * work
    stored["kinetic"] = work - dissipated - covered - towed - delivered - left - sum(stored.values())
    return {
        "work": work, "change": sum(stored.values()), "dissipated": dissipated, "covered": covered, "towed": towed,
        "delivered": {"winch": delivered}, "stored": dict.fromkeys(FLOWS, 0.0) | stored, "residual": left,
        "residual_relative": 1e-3, "port": 0.0, "causes": {}, "integration_relative": {},
    }  # fmt: skip


def balance_of(energy):
    """Words and printed numbers of both sides of the energy balance, in units of their last digit; the unit."""
    line = next(line for line in lines(summary.empty("a", None) | {"energy": energy}) if "energy balance: " in line)
    sides = [re.findall(r"([\d.]+) (kJ|J) ([a-z ]+)", side) for side in line.partition(": ")[2].split(" = ")]
    units = {unit for side in sides for _, unit, _ in side}
    numbers = [{what.strip(): int(number.replace(".", "")) for number, _, what in side} for side in sides]
    return numbers, units.pop(), 10 ** len(sides[0][0][0].partition(".")[2])


def test_what_came_in_is_what_became_of_it_in_the_printed_digits():
    """Sums of printed numbers, which plain rounding misses, of energies of any size and sign; each right to a digit."""
    random, missed = np.random.default_rng(0), 0
    for _ in range(300):
        scale = 10.0 ** random.uniform(1.0, 8.0)
        dissipated, covered, towed, delivered, gravity, spring = random.normal(size=6) * scale
        energy = energy_of(
            scale, abs(dissipated), 0.01 * covered, abs(towed), delivered, gravity=gravity, spring=spring
        )
        (came, went), unit, digits = balance_of(energy)
        assert sum(came.values()) == sum(went.values())
        factor = digits / (1e3 if unit == "kJ" else 1.0)
        assert max(*came.values(), *went.values()) >= 100, "fewer than three digits"
        assert abs(came["put in by the drives"] - scale * factor) <= 1.0 + 1e-6
        assert abs(went.get("dissipated", 0) - abs(dissipated) * factor) <= 1.0 + 1e-6
        parts = [scale, -abs(dissipated), -0.01 * covered, -abs(towed), -delivered, -energy["residual"]]
        parts += [-one for one in energy["stored"].values()]
        missed += sum(round(part * factor) for part in parts) != 0
    assert missed > 30, "rounding alone would do"
    assert "motion" in " ".join(balance_of(energy_of(258e3, 167e3, 0.0, 82e3, 0.0, gravity=-11.8e3))[0][1])


@pytest.mark.parametrize(("work", "shown"), [(0.0, False), (4e-4, False), (2e-3, True)])
def test_a_balance_without_flows_says_so(work, shown):
    energy = energy_of(work, work, 0.0, 0.0, 0.0)
    text = "\n".join(lines(summary.empty("a", None) | {"energy": energy}))
    assert ("energy balance: less than 1 mJ flowed (" in text) is not shown
    assert ("put in by the drives = " in text) is shown


def test_ten_lines_hide_nothing_that_is_wrong():
    """Met checks, cost and ledger are left out and counted; warnings, missed checks and validity never are."""
    met = {"value": 10.0008, "expected": 10.0, "tolerance": 0.02, "ok": True, "note": "", "what": "pins of left"}
    missed = met | {"value": 9.0, "ok": False}
    warned = {"component": "drive", "text": "slow", "time": 1.0, "count": 2}
    exceeded = {"what": "belly", "component": "chassis", "time": 2.0, "place": "", "value": 1.0, "limit": 0.5}
    phase = dict.fromkeys(Phase._fields, float("nan")) | {
        "kind": "steady", "turning": "", "start": 0.0, "end": 1.0, "speed": 1700.0, "way": 1.0, "tension_track": "",
    }  # fmt: skip
    cost = {"wall_time": 1.0, "steps": 10, "evaluations": 20, "iterations": 0, "rejected": 0}
    quiet = summary.empty("straight", "rigid") | {
        "status": "ok", "checks": {"pins_left": met, "pins_right": met}, "phases": [phase] * 9, "wall_time": 1.0,
        "energy": energy_of(3e5, 1e5, 0.0, 0.0, 0.0), "components": {"left_track": cost}, "log": "a.mcap", "seal": "ab",
        "simulated_time": 1.0, "real_time_factor": 1.0, "log_bytes": 1,
    }  # fmt: skip
    short, whole = lines(quiet, common.MOST), lines(quiet)
    assert len(short) == common.MOST == 10
    assert short[-1] == f"  log a.mcap (0.0 MB); {len(whole) - 10} lines more with --verbose"
    assert [line for line in short[:-1] if line not in whole] == []
    assert any("energy balance: " in line for line in short)
    assert not any("pins_left" in line or "checksum" in line for line in short)
    for words in (
        "pins_left = 10.0008",
        "(pins of left)",
        "checksum (seal)",
        "left_track computed for 1 s; its solver: 10",
    ):
        assert any(words in line for line in whole), words
    for severity in ("warning", "failure"):
        loud = quiet | {
            "checks": quiet["checks"] | {"speed": missed}, "warnings": [warned] * 12,
            "validity": [exceeded | {"severity": severity}],
        }  # fmt: skip
        short, whole = lines(loud, common.MOST), lines(loud)
        assert short[1:15] == whole[1:15]
        assert sum("warning: drive at 1 s, 2 times: slow" in line for line in short) == 12
        assert any("NOT speed = 9" in line for line in short)
        assert any(f"validity, {severity}: chassis" in line for line in short)


def test_figures_have_no_exponents_and_no_negative_zero():
    texts = [figure(value, 2) for value in (1.2e2, 1.7e3, -0.0, -19.4, 0.35, 99999.0, float("nan"))]
    assert texts == ["120", "1700", "0", "-19", "0.35", "99999", "not a number"]
    assert number(-0.0) == "0"
    rounded = {"value": -8.9e-16, "expected": 0.0, "tolerance": 1e-10, "ok": True, "note": "", "what": ""}
    result = summary.empty("a", None) | {"checks": {"third_law": rounded}}
    assert "  ok  third_law = 0, expected 0 +- 1e-10" in lines(result)
    assert (
        "  ok  third_law = 8.9e-15, expected"
        in lines(result | {"checks": {"third_law": rounded | {"value": 8.9e-15}}})[1]
    )


def test_names_of_files_need_not_be_text(cotrack, tmp_path):
    odd = os.fsdecode(b"\xff.mcap")
    status, _, err = cotrack("log", "info", odd)
    assert status == 2
    assert "the log \\udcff.mcap cannot be read" in err
    assert cotrack(*SHORT, "--no-estimate", "--log", odd)[0] == 0
    status, out, _ = cotrack("log", "verify", odd)
    assert status == 0
    assert out.startswith("\\udcff.mcap is whole")
    assert cotrack("replay", odd, "--component", "chain", "--set", "vehicle.gravity=10", "-o", "b.mcap")[0] == 0
    with Log("b.mcap") as log:
        assert log.metadata["replay"]["of"] == "\\udcff.mcap"
    for arguments in (
        ("show", odd), ("truth", odd), ("build", odd, "-o", "x"), ("study", odd, "-o", "x"),
        ("run", "rig", "--stop", odd), ("run", "rig", "--set", odd), ("run", "rig", "--set", f"name={odd}"),
    ):  # fmt: skip
        status, _, err = cotrack(*arguments)
        assert (status, len(err.splitlines())) == (2, 1), err


def test_log_commands(cotrack, tmp_path):
    assert cotrack(*SHORT, "--log", "a.mcap")[0] == 0
    status, out, _ = cotrack("log", "info", "a.mcap")
    assert status == 0
    assert "/chain/out" in out
    assert cotrack("log", "verify", "a.mcap")[0] == 0
    status, out, _ = cotrack("log", "export", "a.mcap", "-o", "t.csv", "--signal", "chain.tension.max")
    assert status == 0
    assert (tmp_path / "t.csv").read_text().splitlines()[0] == "t [s],chain.tension.max [N]"
    content = bytearray((tmp_path / "a.mcap").read_bytes())
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) // 2])
    assert cotrack("log", "verify", "cut.mcap")[0] == 1
    assert cotrack("log", "recover", "cut.mcap", "-o", "saved.mcap")[0] in (1, 3)
    assert cotrack("log", "verify", "none.mcap")[0] == 1


def test_a_check_without_its_signals_is_not_ok(cotrack):
    status, out, err = cotrack("run", "hanging_chain", "--set", "track.link_outputs=false", "--json")
    assert status == 1, err
    checks = last(out)["checks"]
    assert checks["rest"]["ok"]
    assert not checks["tension"]["ok"]
    assert checks["tension"]["value"] is None


@pytest.mark.long
def test_build_names_variants(cotrack, tmp_path):
    status, out, _ = cotrack("build", "hanging_chain", "--track", "rigid", "-o", "fmus")
    assert status == 0
    assert [file.name for file in (tmp_path / "fmus").iterdir()] == ["TrackRigid-hanging_chain.fmu"]
    assert out.strip().endswith("TrackRigid-hanging_chain.fmu")
    status, _, err = cotrack("build", "hanging_chain", "-o", "fmus/TrackRigid-hanging_chain.fmu/below")
    assert status == 2
    assert "cannot be made" in err


def test_a_run_for_an_analysis_records_what_it_needs(cotrack, tmp_path, monkeypatch):
    """The sentence of the analysis names the option, and the option makes the analysis possible."""
    plain, made = tmp_path / "plain.mcap", tmp_path / "made.mcap"
    assert cotrack(*SHORT, "--no-estimate", "-o", plain)[0] == 0
    for analysis in ("fatigue", "deformation"):
        status, _, err = cotrack("analyse", plain, analysis)
        assert status == 2
        assert f"or cotrack run --for {analysis}" in err
    assert cotrack(*SHORT, "--no-estimate", "--for", "fatigue", "--for", "deformation", "-o", made)[0] == 0
    for analysis in ("fatigue", "deformation"):
        assert cotrack("analyse", made, analysis)[0] == 0
    assert cotrack(*SHORT, "--no-estimate", "--for", "fatigue", "--set", "run.links=5", "-o", "fifth.mcap")[0] == 0
    with Log(plain) as before, Log(made) as after, Log(Path("fifth.mcap")) as fifth:
        assert set(before.signals) < set(after.signals)
        second = [log.signal("chain.link[1].tension")[0][1] for log in (after, fifth, before)]  # time of that record
        assert second == pytest.approx(after.signal("chain.tension.max")[0][1] * np.array([1, 5, 10]))
        assert (before.signal("chain.tension.max")[1] == after.signal("chain.tension.max")[1]).all()
    status, _, err = cotrack(*SHORT, "--for", "fatig")
    assert status == 2
    assert "no analysis 'fatig': one of power, spectrum" in err
    status, _, err = cotrack(*SHORT, "--track", "rigid", "--for", "fatigue", "-o", "none.mcap")
    assert (status, Path("none.mcap").exists()) == (2, False)
    assert "--for fatigue: rigid links have no stress" in err
    monkeypatch.setitem(sys.modules, "rainflow", None)
    status, _, err = cotrack(*SHORT, "--for", "deformation", "--for", "fatigue", "-o", "none.mcap")
    assert (status, Path("none.mcap").exists()) == (2, False), "a run is made for an analysis that cannot be made"
    assert err.startswith("cotrack: rainflow is not installed: pip install -c constraints.txt -e '.[analysis]' in ")
