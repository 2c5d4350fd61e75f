"""The summary of a run: its checks, figures and energy balance, as they are printed."""

import json
import re
from dataclasses import replace
from importlib import resources
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from short_runs import SHORT, last

from orchestrator.execution import summary, summary_text
from orchestrator.execution.log_report import summary_of
from orchestrator.execution.summary_text import MAX_PHASES, WIDTH, _phases, lines
from orchestrator.log.tools import WHOLE, verify
from orchestrator.results.analyses.phases import Phase
from orchestrator.results.measures import FIGURES
from orchestrator.results.units import figure
from orchestrator.scene.scene import load

WIDE = 10_000  # columns: no line is wrapped


def labelled(label, result):
    """Text behind a label of a summary."""
    (line,) = (line for line in lines(result, width=WIDE) if line.startswith(f"  {label}  "))
    return line.removeprefix(f"  {label}").lstrip()


@pytest.mark.long
def test_an_open_ledger_is_not_a_success(cotrack, tmp_path):
    """An open energy balance is a failure: a chain without checks falls 20 cm per step."""
    text = (resources.files("orchestrator") / "gallery" / "released_chain.toml").read_text(encoding="utf-8")
    (tmp_path / "fall.toml").write_text(text.partition("[expect")[0], encoding="utf-8")
    fall = ("run", "fall.toml", "--no-estimate", "--set", "chain.links=8", "--stop", "0.6", "--json")
    for step, wanted in (("50 ms", 1), ("2 ms", 0)):
        status, out, err = cotrack(*fall, "--step", step, "--set", f"track.step={step}")
        result = last(out)
        assert (result["status"], result["checks"]) == ("ok", {})
        assert status == wanted, (step, result["energy"])
        assert ("ledger" in err) == bool(wanted)
        assert lines(result)[0] == f"fall, flexible links: {'energy balance open' if wanted else 'ok'}"


@pytest.mark.long
def test_a_failed_check_is_exit_1(cotrack):
    """Also one whose signals were not recorded."""
    status, out, _ = cotrack(*SHORT, "--set", "expect.rest.expected=1")
    result = last(out)
    assert (status, result["status"], result["checks"]["rest"]["ok"]) == (1, "ok", False)
    told = "checks NOT met: rest; 0 of 3 checks are met; 2 begin after the end"
    assert lines(result)[0] == f"hanging_chain, flexible links: {told}"
    status, out, err = cotrack("run", "hanging_chain", "--set", "track.link_outputs=false", "--json")
    assert status == 1, err
    checks = last(out)["checks"]
    assert (checks["rest"]["ok"], checks["tension"]["ok"], checks["tension"]["value"]) == (True, False, None)


CHAIN, SETTLE = ("hanging_chain", "flexible"), ("settle", "rigid")
CHECK = 'expect.{}={{signal="chain.tension.max", expected=0, tolerance=1e9{}}}'
LAW = 'expect={third_law={measure="third_law", expected=0, tolerance=1e-10}}', "symmetric=true"
MEANS, AFTER = "mean of 0.01 to 0.02 s", "1 s is after the end of the run, 0.02 s: "
NOT_MADE = "Not made, third law: third_law needs"
ONE_BEYOND = "2 of 3 checks met; 1 beyond its end."


def later(window):
    return "expect={}", CHECK.format("now", ""), CHECK.format("later", f", {window}"), CHECK.format("rest", "")


@pytest.mark.parametrize(("scene", "settings", "first", "key", "content", "told", "page"), [
    (CHAIN, later("from=0.02, to=0.03"), "2 of 3 checks are met; 1 begins after the end", "checks_after_end", ["later"],
     "", ONE_BEYOND),
    (CHAIN, later("from=0.01, to=0.03"), "2 of 3 checks are met; 1 ends after the end", "checks_after_end", ["later"],
     "", ONE_BEYOND),
    (CHAIN, later("from=0.01, to=0.02"), "3 of 3 checks are met", "checks_after_end", [], "", "3 of 3 checks met."),
    (CHAIN, ["run.window={from=1}"], "", "passed_over", [f"run.window.from = {AFTER}there are no means"], "", ""),
    (CHAIN, ["run.window={from=0.01, to=1}"], "", "passed_over", [f"run.window.to = {AFTER}means end there"],
     MEANS, ""),
    (CHAIN, ["run.window={from=0.01, to=0.02}"], "", "passed_over", [], MEANS, ""),
    (SETTLE, [*LAW, "run.outputs=2"], "0 of 1 checks are met; 1 left out", "checks_left_out", ["third_law"],
     "run, 0 to 0.02 s, one step in 2 & left out: third_law needs the outputs of every step: run.outputs = 1, not 2",
     NOT_MADE),
    (SETTLE, [*LAW, "run.inputs=false"], "0 of 1 checks are met; 1 left out", "checks_left_out", ["third_law"],
     "check third_law is left out: third_law needs the inputs of every step: run.inputs = true", NOT_MADE),
    (SETTLE, LAW, "1 of 1 checks are met", "checks_left_out", [], "", ""),
])  # fmt: skip
def test_what_the_record_does_not_cover_is_told(cotrack, scene, settings, first, key, content, told, page):
    """In the summary, in --json, in the summary of the log and in the report; it is no failure."""
    run = ("run", scene[0], "--track", scene[1], "--stop", "0.02", "--no-estimate", "--json")
    result = last(cotrack.done(*run, *(part for each in settings for part in ("--set", each))))
    read = summary_of(result["log"])
    assert [*result[key]] == content == [*read[key]]
    assert result["checks_left_out"] == read["checks_left_out"]
    printed = lines(read, width=WIDE)  # --json has null for a mean that is none
    assert printed[0].startswith(f"{scene[0]}, {scene[1]} links: ok; ")
    assert printed[0].endswith(first)
    assert all(any(words in line for line in printed) for words in told.split(" & "))
    if key == "passed_over":
        assert any("mean of " in line for line in printed) == bool(told)
    if page:
        cotrack.done("report", result["log"], "-o", "page.html")
        assert page in Path("page.html").read_text(encoding="utf-8")


def test_checks_that_cannot_be_made_say_why(cotrack):
    status, out, err = cotrack(
        *SHORT,
        *("--set", "run.outputs=1000", "--set", "run.links=1000"),
        *("--set", 'expect.span={measure="span_tension", of="upper", expected=1, tolerance=1}'),
        *("--set", 'expect.top={measure="tension_top", expected=1, tolerance=1}'),
        *("--set", 'expect.late={signal="chain.speed", expected=1, tolerance=1, from=0.01}'),
    )
    assert status == 1, err
    notes = {name: check["note"] for name, check in last(out)["checks"].items() if name != "rest"}
    nothing = "there is nothing to measure in this scene and window"
    unrecorded = "'chain.speed' was not recorded between 0.01 and 0.02 s"
    assert notes == {"span": nothing, "top": nothing, "late": unrecorded}
    assert [name for name, check in last(out)["checks"].items() if check["ok"]] == ["rest"]
    assert last(out)["observables"]["tension_max"] > 0


def test_a_check_may_name_any_figure_that_a_summary_shows(cotrack):
    names = "tension_max", "tension_mean", "sag", "weight"
    given = [f'expect.{name}={{measure="{name}", expected=1, tolerance=1}}' for name in names]
    status, out, err = cotrack(*SHORT, "--no-estimate", *(text for one in given for text in ("--set", one)))
    assert status == 1, err
    checks, shown = last(out)["checks"], last(out)["observables"]
    assert {name: checks[name]["value"] for name in names[:3]} == {name: shown[name] for name in names[:3]}
    assert checks["weight"]["note"] == "there is nothing to measure in this scene and window"
    assert "weight" not in shown


@pytest.mark.parametrize("error", [None, KeyError("ours"), TypeError("ours")])
def test_a_measure_that_breaks_is_a_crash_when_all_else_is_written(cotrack, monkeypatch, error):
    """Log, other figures and page are whole; the status is 1, which a sweep does not keep as an answer."""

    def sag(*_):
        if error:
            raise error
        return 1.0

    monkeypatch.setitem(FIGURES, "sag", replace(FIGURES["sag"], value=sag))
    check = "--no-estimate", "--set", "expect={}", "--set", 'expect.x={measure="sag", expected=1, tolerance=1}'
    status, out, err = cotrack(*SHORT, *check)
    said = f"cotrack: internal error: {type(error).__name__}: {error}; run 'cotrack --debug ...' to see where\n"
    assert (status, err) == ((1, said) if error else (0, ""))
    assert last(out)["observables"]["tension_max"] > 0
    assert verify(last(out)["log"]).code == WHOLE
    assert cotrack("report", last(out)["log"], "-o", "page.html")[::2] == (status, err)
    assert Path("page.html").stat().st_size > 10_000
    swept = "--vary", "run.stop=0.02", "--workers", "1", "-o", "s"
    assert cotrack("sweep", "hanging_chain", *check, *swept)[0] == status
    assert bool(json.loads(next(Path("s/cases").iterdir()).read_text())["rows"]) == (not error)


def test_headline_figures_have_their_window(cotrack):
    result = last(cotrack.done("run", "hanging_chain", "--stop", "1.5", "--no-estimate", "--json"))
    assert set(result["windows"]) == set(result["observables"])
    assert result["windows"]["tension_max"] == {"from": 0.0, "to": 1.5}
    assert result["windows"]["sag"] == {"from": 0.5, "to": 1.5}
    assert result["phases"] == [], "without a hull there are no phases"
    told = lines(result)
    for window, figure_of in (
        ("whole run, 0 to 1.5 s", "largest link tension "),
        ("mean of 0.5 to 1.5 s", "mean link "),
    ):
        below = told[told.index(f"  {window}") + 1]
        assert below.startswith(f"    {figure_of}")
        assert "kN" in below


def test_turns_of_the_last_second_are_left_to_phases():
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
        "simulated_time": 9.0, "observables": observables, "windows": summary.windows(observables, load("turn"), 9.0),
    }  # fmt: skip
    out, without = ([line.split() for line in lines(result | {"phases": phases})] for phases in ([turned], []))
    assert not any("242.6" in line for line in out)
    assert ["largest", "link", "tension", "42", "kN", "in", "right", "track", "at", "3.743", "s"] in out
    assert ["turn", "3.6", "6", "1.96", "4.77", "42", "3.743", "right", "track"] in out, (
        "rates and radii are in a table of their own"
    )
    assert ["right", "3.6", "6", "-0.25", "-0.31", "7.9"] in out
    throughout = [line.split() for line in lines(result | {"phases": [turned | {"end": 9.0}]})]
    assert ["turn", "radius", "242.6", "m"] in throughout, "that of the phase has the entry into the turn"
    means = "speed 0 m/s, yaw rate -1e-05 rad/s, turn radius 242.6 m, steering moment 0 kN m, power left 7.5e-07 kW"
    k = without.index(["mean", "of", "8", "to", "9", "s"])
    assert [" ".join(line) for line in without[k + 1 : k + 6]] == means.split(", "), "rounding is 0"


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
    line = labelled("energy balance", summary.empty("a", None) | {"energy": energy})
    sides = [re.findall(r"([\d.]+) (kJ|J) ([a-z ]+)", side) for side in line.split(" = ")]
    units = {unit for side in sides for _, unit, _ in side}
    numbers = [{what.strip(): int(number.replace(".", "")) for number, _, what in side} for side in sides]
    return numbers, units.pop(), 10 ** len(sides[0][0][0].partition(".")[2])


def test_what_came_in_is_what_became_of_it_in_the_printed_digits():
    """Sums of printed numbers, which plain rounding misses, of energies of any size and sign; each right to a digit."""
    random, missed = np.random.default_rng(0), 0
    for _ in range(300):
        scale = 10.0 ** random.uniform(1.0, 8.0)
        dissipated, covered, towed, delivered, gravity, spring = random.normal(size=6) * scale
        flows = abs(dissipated), 0.01 * covered, abs(towed), delivered
        energy = energy_of(scale, *flows, gravity=gravity, spring=spring)
        (came, went), unit, digits = balance_of(energy)
        assert sum(came.values()) == sum(went.values())
        factor = digits / (1e3 if unit == "kJ" else 1.0)
        assert max(*came.values(), *went.values()) >= 100, "fewer than three digits"
        assert abs(came["put in by the drives"] - scale * factor) <= 1.0 + 1e-6
        assert abs(went.get("dissipated", 0) - flows[0] * factor) <= 1.0 + 1e-6
        parts = (scale, *(-one for one in (*flows, energy["residual"], *energy["stored"].values())))
        missed += sum(round(part * factor) for part in parts) != 0
    assert missed > 30, "rounding alone would do"
    energy = energy_of(258e3, 167e3, 0.0, 82e3, 4e3, gravity=-11.8e3)
    assert "motion" in " ".join(balance_of(energy)[0][1])
    told = labelled("energy ledger", summary.empty("a", None) | {"energy": energy})
    assert "258000 J put in = " in told
    assert "82000 J done on the towed load + 4000 J delivered to winch" in told


@pytest.mark.parametrize(("work", "shown"), [(0.0, False), (4e-4, False), (2e-3, True)])
def test_a_balance_without_flows_says_so(work, shown):
    energy = energy_of(work, work, 0.0, 0.0, 0.0)
    text = labelled("energy balance", summary.empty("a", None) | {"energy": energy})
    assert text.startswith("less than 1 mJ flowed (") is not shown
    assert ("put in by the drives = " in text) is shown


def entry(component, place, time=2.0, value=1.0, what="lift", severity="warning"):
    """Entry of the validity ledger."""
    limit = 0.2 if what == "lift" else 0.0
    return {"what": what, "component": component, "time": time, "place": place, "value": value, "limit": limit,
            "severity": severity}  # fmt: skip


SIDES = ("left_track", "right_track")
WHEELS = [entry(side, f"road_wheel[{k}]", 2.0 - 0.1 * k, 0.3 + 0.1 * k) for side in SIDES for k in range(1, 7)]


@pytest.mark.parametrize(("entries", "said"), [
    (WHEELS, ["left_track and right_track from 1.4 s on: without load at road_wheel[1, 2, 3, 4, 5, 6]: 0.9 s,"]),
    ([WHEELS[0], *WHEELS[2:4]], ["left_track from 1.6 s on: without load at road_wheel[1, 3, 4]: 0.7 s,"]),
    ([WHEELS[0], WHEELS[7]], ["without load at road_wheel[1] of left_track and road_wheel[2] of right_track: 0.5 s,"]),
    ([entry("left_track", "sprocket, pin 3"), entry("right_track", "idler", 1.0)],
     ["from 1 s on: without load at sprocket, pin 3 of left_track and idler of right_track: 1 s,"]),
    ([entry(SIDES[0], ""), entry(SIDES[1], "")], ["left_track and right_track from 2 s on: without load: 1 s,"]),
    ([entry(SIDES[0], ""), WHEELS[0]], ["left_track from 2 s on: without load: 1 s", "at road_wheel[1]: 0.4 s"]),
    ([WHEELS[0], entry(SIDES[0], "", what="belly", severity="failure")], ["at road_wheel[1]:", "failure: left_track"]),
])  # fmt: skip
def test_findings_that_differ_only_in_their_place_are_one_line(entries, said):
    """All names, the first time, the worst value; another kind, or a whole track, is another line."""
    whole = lines(summary.empty("a", None) | {"validity": entries}, verbose=False, width=WIDE)
    shown = [line for line in whole if "validity" in line]
    assert len(shown) == len(said)
    assert all(words in line for words, line in zip(said, shown, strict=True)), shown


def test_warnings_of_one_text_are_one_line():
    warned = [{"component": side, "text": text, "time": 1.0 + (side == "right_track"), "count": 2}
              for text in ("slow", "hot") for side in SIDES]  # fmt: skip
    shown = lines(summary.empty("a", None) | {"warnings": warned})
    assert [line for line in shown if "warning" in line] == [
        f"! warning: left_track and right_track at 1 s, 4 times: {text}" for text in ("slow", "hot")
    ]


def test_a_short_summary_hides_no_result_and_nothing_that_is_wrong():
    """Met checks, ledger and cost are left out; of many phases the longest in motion stay; what is wrong comes last."""
    met = {"value": 10.0008, "expected": 10.0, "tolerance": 0.02, "ok": True, "note": "", "what": "pins of left"}
    warned = [{"component": "drive", "text": f"slow {k}", "time": 1.0, "count": 2} for k in range(12)]
    figures = {"tension_max": 42e3, "distance": 3.0, "tension_mean": 9e3}
    phase = dict.fromkeys(Phase._fields, float("nan")) | {
        "kind": "steady", "turning": "", "speed": 1700.0, "way": 1.0, "tension_track": "", "power": 5e3,
    }  # fmt: skip
    ends = [0.0, 4.0, 4.5, 5.0, 7.0, 8.0, 9.5, 10.5, 12.0, 12.4, 13.0]  # s: the longest phase is a rest
    phases = [phase | {"start": start, "end": end} for start, end in pairwise(ends)]
    phases[0]["kind"] = "rest"
    cost = {"wall_time": 1.0, "steps": 10, "evaluations": 20, "iterations": 0, "rejected": 0}
    quiet = summary.empty("straight", "rigid") | {
        "status": "ok", "checks": {"pins_left": met, "pins_right": met}, "phases": phases, "wall_time": 1.0,
        "energy": energy_of(3e5, 1e5, 0.0, 0.0, 0.0), "components": {"left_track": cost}, "log": "a.mcap", "seal": "ab",
        "simulated_time": 1.0, "real_time_factor": 1.0, "log_bytes": 1, "observables": figures,
        "windows": {name: {"from": 0.0, "to": 1.0} for name in figures},
    }  # fmt: skip

    def shown(told, *words):
        return [any(each in line for line in told) for each in words]

    short, whole = lines(quiet, verbose=False), lines(quiet)
    assert short[-1] == f"  {'log':17}  a.mcap (0.0 MB); more with --verbose"
    assert set(short[:-1]) < set(whole)
    starts = [line.split()[1] for line in short if line.startswith(("  steady", "  rest"))]
    assert len(starts) == MAX_PHASES == len(phases) - 2
    assert not {"0", "12"} & set(starts), "the rest, and the shortest in motion"
    assert all(shown(short, "largest link", "distance", "energy balance"))
    assert not any(shown(short, "pins_left", "seal of", "computed for"))
    assert all(shown(whole, "pins_left = 10.0008", "(pins of left)", "seal of the log", "computed for 1 s"))
    for severity in ("warning", "failure"):
        loud = quiet | {
            "checks": quiet["checks"] | {"speed": met | {"value": 9.0, "ok": False}}, "warnings": warned,
            "validity": [entry("chassis", "", what="belly", severity=severity)],
        }  # fmt: skip
        found = lines(loud, verbose=False, width=WIDE)
        quieter = lines(quiet, verbose=False, width=WIDE)
        assert found[1 : len(quieter)] == quieter[1:]
        wrong = found[len(quieter) :]
        assert all(line.startswith("! ") for line in wrong)
        assert sum("warning: drive at 1 s, 2 times: slow" in line for line in wrong) == 12
        assert len(wrong) == 12 + 2
        assert all(shown(wrong, "NOT speed = 9", f"validity, {severity}: chassis"))


@pytest.mark.parametrize("width", [WIDTH, 80])
def test_lines_are_as_wide_as_asked_and_words_stay_whole(width):
    """So do numbers with their units."""
    warned = {"component": "drive", "text": "a word of 3.5 kN " * 30, "time": 1.0, "count": 1}
    places = {"pin_force": "in pin 51 of the left track, which a long name has, at 3.92 s"}
    result = summary.empty("a", None) | {
        "energy": energy_of(258e3, 167e3, 0.0, 82e3, 4e3, gravity=-11.8e3), "warnings": [warned], "places": places,
        "observables": {"pin_force": 2e4}, "windows": {"pin_force": {"from": 0.0, "to": 1.0}},
    }  # fmt: skip
    found, one_each = (lines(result, width=each) for each in (width, WIDE))
    assert max(map(len, found)) <= width
    assert len(found) > len(one_each)
    assert not {line.split()[0] for line in found} & {"kN", "kJ", "%"}
    assert " ".join(found).split() == " ".join(one_each).split()


def test_a_table_that_is_too_wide_goes_on_in_a_second_one():
    phase = {
        "kind": "acceleration", "start": 0.7, "end": 1.5, "speed_start": 0.03, "speed_end": 1.56, "speed": 0.6,
        "way": 0.5504, "power": 47.4e3, "slip_left": 0.012, "slip_right": 0.27, "tension": 38.37e3, "tension_t": 1.2,
        "tension_track": "right_track", "turning": "", "yaw_rate": 0.0, "yaw_rate_most": 0.0, "radius": 0.0,
    }  # fmt: skip
    narrow, wide = (_phases([phase], True, width) for width in (80, WIDTH))
    assert [len(narrow), len(wide)] == [6, 3]
    assert max(map(len, narrow)) <= 80 < max(map(len, wide)) <= WIDTH
    assert narrow[3].split() == ["phase", "from", "to", "at", "in"]
    assert narrow[2].split() + narrow[5].split()[3:] == wide[2].split()


@pytest.mark.parametrize(("status", "last"), [("failed", ["! failed: too fast"]), ("interrupted", [])])
def test_the_end_of_a_run_is_told(status, last):
    result = summary.empty("a", None) | {"status": status, "message": "too fast"}
    found = lines(result)
    assert found[0] == f"a: {status}"
    assert [line for line in found if line.startswith("!")] == last


def test_figures_have_no_exponents_and_no_negative_zero():
    texts = [figure(value, 2) for value in (1.2e2, 1.7e3, -0.0, -19.4, 0.35, 99999.0, float("nan"))]
    assert texts == ["120", "1700", "0", "-19", "0.35", "99999", "not a number"]
    rounded = {"value": -8.9e-16, "expected": 0.0, "tolerance": 1e-10, "ok": True, "note": "", "what": ""}
    result = summary.empty("a", None) | {"checks": {"third_law": rounded}}
    assert labelled("check", result) == "ok  third_law = 0, expected 0 +- 1e-10"
    larger = result | {"checks": {"third_law": rounded | {"value": 8.9e-15}}}
    assert labelled("check", larger).startswith("ok  third_law = 8.9e-15, expected")


TENSION = {
    "asked": 14380.0, "standing": [14380.0, 14380.2], "start": [17.96e3, 17.5e3], "drawn": False, "why": "",
    "sag": 0.0828, "loads": [[20e3, 16.2e3], [20e3, 16e3]], "others": [{}, {}], "settlement": 0.0974,
}  # fmt: skip


@pytest.mark.parametrize(("change", "rows"), [
    ({}, ["track tension 17.96 and 17.5 kN 14.38 kN asked", "standing on level, hard ground 14.38 kN",
          "sag of the longest free span 82.8 mm", "settlement 97.4 mm", "road wheels carry 20, 16.2 and 20, 16 kN"]),
    ({"drawn": True, "start": [16.3e3], "loads": [[69.6, 71.0], [69.6, 71.0]]},
     ["track tension 16.3 kN 14.38 kN asked, as drawn", "standing on level, hard ground 14.38 kN",
      "sag of the longest free span 82.8 mm standing", "settlement 97.4 mm standing", "road wheels carry 69.6, 71 N"]),
    ({"loads": [[20e3]] * 2, "others": [{"idler": 4e3, "tail": 3.5e3}] * 2},
     ["track tension 17.96 and 17.5 kN 14.38 kN asked", "standing on level, hard ground 14.38 kN",
      "sag of the longest free span 82.8 mm", "settlement 97.4 mm", "road wheels carry 20, idler 4, tail 3.5 kN"]),
    ({"standing": [], "why": "it tips over", "start": [14380.0], "drawn": True},
     ["track tension 14.38 kN 14.38 kN asked, as drawn; it does not stand: it tips over"]),
])  # fmt: skip
def test_the_tension_asked_and_had_is_told(change, rows):
    found = summary_text.track_tension(TENSION | change)
    assert [" ".join(line.split()) for line in found] == ["at the start", *rows]
    short = lines(summary.empty("a", None) | {"track_tension": TENSION | change}, verbose=False)
    assert [" ".join(line.split()) for line in short[1:3]] == ["at the start", rows[0]]
    assert summary_text.track_tension({}) == []


@pytest.mark.parametrize(
    ("scene", "links", "doubt"), [("turn", "rigid", True), ("turn", "flexible", False), ("straight", "rigid", False)]
)
def test_a_pin_force_of_rigid_links_in_a_turn_has_a_part_that_is_not_known(monkeypatch, scene, links, doubt):
    monkeypatch.setitem(
        summary.OBSERVABLES, "pin_force", SimpleNamespace(shown=SimpleNamespace(place=lambda run: "in 3"))
    )
    said = summary.places({"pin_force": 1.0}, None, load(scene, links))
    assert said == {"pin_force": "in 3" + ", its part across up to a constant" * doubt}
