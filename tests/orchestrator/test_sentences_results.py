"""Sentences about results: what a command or a call refuses, what a log lacks, and what is doubted, each by its cause.

Other tests ask for the kind of an error or its status; the words are here.
"""

import re
from importlib import resources
from types import SimpleNamespace

import numpy as np
import pytest
from fit_formulas import FORMULAS, formula, solved
from life_logs import BUSHING, LENGTH, TABLE, log_of, waves, worn
from logged import logged
from made_logs import ATTITUDE, SEAT_MOTION, STEP, made, seat_log, sines
from run_records import PITCH, TEETH, Record, on_the_sprocket
from short_runs import driven_log

from fmus.vehicles.tables import BadInput
from fmus.vehicles.vehicle import read_table, vehicle
from orchestrator.execution import course, summary, summary_text
from orchestrator.execution.estimate import estimate
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.results import chain_measures, vehicle_measures
from orchestrator.results.analyses import envelope, fatigue, life, phases, ride, spectrum, wear
from orchestrator.results.analyses.catalogue import analyse
from orchestrator.results.largest_forces import largest
from orchestrator.results.measures import FIGURES
from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.scene.scene import load
from orchestrator.studies import mobility
from orchestrator.studies.least_squares import search
from orchestrator.studies.variations import MAX_CASES, Design

REFUSED = (BadInput, LookupError, LogUnreadable)

# --- commands -------------------------------------------------------------------------------------------------------

SWEEP = "sweep hanging_chain -o found --vary "
FIT = "fit hanging_chain --track rigid --set chain.links=8 --set run.stop=0.05 --set track.start=displaced -o f"
FIT += " --data DATA --map chain.tension.max=a "
COMMANDS = {
    "analyse LOG power --order": "--order is an option of spectrum, not of power",
    "analyse LOG spectrum": "a spectrum needs a signal: Run.signals",
    "analyse LOG power --from 2 --to 1": "the first instant must not be after the last",
    "analyse LOG power --from 90": "from 90 to inf: the run is recorded from 0 to 0.2 s",
    "analyse LOG links --by place --track middle": "has no track 'middle'",
    "analyse LOG links --by place --signal link[*].wheels.force": "group 'wheels' of track.link_outputs",
    "analyse LOG links --by wheel --track right": "has no track 'right'",
    "analyse LOG links --bins 3": "signal and bins are of links by place",
    "analyse LOG contact": "the analysis contact is now 'links --by place --signal pressure'",
    "run rig --for joints": "the analysis joints is now 'links'",
    "analyse LOG fatigue --sn 100e6": "sn = 100e6: must be",
    "analyse LOG fatigue --sn 100e6,-1,3": "cycles = -1: must be greater than 0",
    "analyse LOG fatigue --sn 1e6,1,0": "slope = 0: must be greater than 0",
    "analyse LOG life --by tooth": "by = tooth: must be one of place, phase",
    "analyse LOG deformation --link 65 -o e.png": "link = 65: left_track has the links 1 to 64",
    "analyse LOG deformation --at 0.3 --to 0.25 --from 0.195": "in the window is at 0.2 s",
    "analyse LOG ride --seat gunner": "seat = gunner: there is driver",
    "analyse LOG power -o p.txt": "its name must end in .csv",
    "analyse LOG power -o nowhere/p.csv": "there is no folder",
    "plot LOG -o a.png": "plot needs a signal",
    "plot left_track.speed": "plot needs a log",
    "plot LOG left_track.nothing -o a.png": "has no signal 'left_track.nothing'",
    "plot LOG left_track.speed -o a.bmp": "its name must end in .png, .svg or .pdf",
    "plot LOG left_track.speed --waterfall -o a.png": "is no family of signals",
    "plot LOG left_track.link[*].tension --waterfall --from 0.1 --to 0.1": "a map needs two",
    "plot LOG left_track.link[*].tension --at 0.1": "at: needs place, a map of values",
    "plot LOG chassis.left.suspension[*].force --place -o a.png": "of no link or pin of a track",
    "plot LOG left_track.link[*].tension --place --order -o a.png": "drawn over time",
    "life none.toml -o other": "no course file",
    "sensitivity hanging_chain --of vehicle.track.mas -o s": "hanging_chain.toml has no such number",
    "sensitivity hanging_chain --of start.heading -o s": "is 0 in hanging_chain.toml, and one per cent",
    "run rig --error 150%": "between 0 and 100 %",
    "run rig --error 1e-9": "the best has an error of ",
    "run settle --error 1%": "study error-runtime settle",
    'run settle --set run.allow=["creep"]': "must be a list of penetration, tooth_jump",
    f"{FIT} --free chain.spann": "hanging_chain.toml has no such number ('spann'): did you mean 'span'?",
    f"{FIT} --free chain.span.x": "free chain.span.x: hanging_chain.toml has no such number ('x'): it has no parts",
    f"{FIT} --free track.start": 'free track.start: is "displaced" in hanging_chain.toml, and a real number is needed',
    f"{FIT} --free run.stop": "free run.stop: cannot be changed a little: hanging_chain.toml: run: stop = ",
    f"{FIT} --free chain.span=1": "free chain.span=1: must be KEY or KEY=FROM:TO",
    f"{FIT} --free chain.span=0.5:0.6": "free chain.span=0.5:0.6: the scene has ",
    f"{FIT} --free chain.span=0.9:0.5": "free chain.span=0.9:0.5: FROM must be below TO",
    f"{FIT} --free start.heading": "free start.heading: the scene has 0, so a range KEY=FROM:TO must say",
    "fit hanging_chain -o f --data DATA --data rig=DATA --map chain.tension.max=a --free chain.span": (
        "free chain.span: rig.toml has no such number ('chain')"
    ),
    f"{FIT} --free chain.span --data DATA": "is given twice, which would make errors too small",
    f"{FIT} --free chain.span --noise chain.sag=1": "noise chain.sag: this signal is given no column",
    f"{FIT} --free chain.span --map chain.pull=a": "a run of hanging_chain has no signal 'chain.pull'",
    f"{FIT} --free chain.span --to 0": "'a' has one sample of 6 in the time that is fitted, 0 to 0 s",
    f"{FIT} --free chain.span --shift 9": "'a' has no sample in the time that is fitted, 0 to 0.05 s",
    f"{FIT} --free chain.span --shift find": "shift find: the run of the start differs from ",
    f"{SWEEP}x": "vary x: must be KEY=a:b:n or KEY=x,y,z",
    f"{SWEEP}x=1,,2": "a value is empty",
    f"{SWEEP}x=1,1": "a value is given twice",
    f"{SWEEP}x=1_N,2_kN": "all numbers must have one unit",
    f"{SWEEP}x=1:2:0": f"a whole number from 1 to {MAX_CASES}",
    f"{SWEEP}x=1:2:1e999999999": "a whole number from 1",
    f"{SWEEP}x=2:2:3": "the range is empty",
    f"{SWEEP}x=1:2:3:4": "must be a:b:n",
    f"{SWEEP}x=1:1e999:3": "must have finite ends",
    f"{SWEEP}x=1:2": "a range a:b needs a number of points, a:b:n, or sample = N",
    f"{SWEEP}x=1,2 --vary x=3,4": "vary x: is given twice",
    f"{SWEEP}x=1:2:3 --sample 4": "sample 4: needs a range, vary KEY=a:b",
    f"{SWEEP}x=1:2 --sample 0": "sample 0: must be at least 1",
    f"{SWEEP}x=1:2 --sample 4 --seed -1": "seed -1: must be at least 0",
    f"{SWEEP}x=1:2 --sample 1000000000": f"these are 1000000000 cases, and {MAX_CASES} are allowed",
    f"{SWEEP}x=0:1:200 --vary y=0:1:51": f"these are 10200 cases, and {MAX_CASES} are allowed",
    f"{SWEEP}chain.span=0.7,0.8 --for sga": "for sga: did you mean 'sag'",
    f"{SWEEP}chain.span=0.7,0.8 --for max": "for max: needs a signal, as max:left_track.tension.max",
    f"{SWEEP}chain.span=0.7,0.8 --for ride:chain": "this analysis is given by its name alone",
    f"{SWEEP}chain.span=0.7,0.8 --for links:chain": "by = chain: must be one of component, place, wheel",
    f"{SWEEP}chain.span=0.7,0.8 --for patches": "the analysis patches is now 'links --by wheel'",
    f"{SWEEP}chain.lnks=8,9": "unknown key 'chain.lnks': did you mean 'chain.links'?",
    f"{SWEEP}chain.links=8:9:3": "chain.links = 8.5",
    f"{SWEEP}chain.span=0.7_kg,0.8_kg": "chain.span = '0.7 kg'",
    f"{SWEEP}track.model=rigid,soft": "track.model = 'soft'",
    f"{SWEEP}track=rigid,flexible --track rigid": "track=rigid,flexible: its key is set by another option",
    f"{SWEEP}run.stop=1,2 --set run.stop=3": "run.stop=1,2: its key is set by another option",
    "sweep hanging_chian --vary x=1,2 -o found": "'hanging_chain'?",
}


driven = pytest.fixture(scope="module")(driven_log)


@pytest.fixture(scope="module")
def places(driven, tmp_path_factory):
    """Files by their words: the log of a run, and a record that no chain has."""
    file = tmp_path_factory.mktemp("places") / "data.csv"
    np.savetxt(file, [[0.01 * k, 10.0**k] for k in range(6)], delimiter=",", header="t,a", comments="")
    return {"LOG": driven, "DATA": file}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_refuses_in_one_sentence(cotrack, places, tmp_path, command):
    words = [re.sub("LOG|DATA", lambda found: str(places[found[0]]), word) for word in command.split()]
    status, out, err = cotrack(*(word.replace("_k", " k").replace("_N", " N") for word in words))
    assert (status, out) == (2, "")
    assert COMMANDS[command] in err
    assert err.count("\n") == 1
    assert not [*tmp_path.iterdir()]


# --- calls: what a log lacks, and what is no answer -----------------------------------------------------------------

T = np.arange(0.0, 2.0, STEP)
JOINT = ["sprocket.force.x", "sprocket.torque.x"]


def of_track(path, names, count=20, scene=None, **more):
    """Log of a track with these outputs of its links, all zero."""
    t = STEP * np.arange(count)
    topics = {"/track/links": [(name, "1") for name in names], "/track/out": [("travel", "m")]}
    rows = {"/track/links": (t, np.zeros((count, len(names)))), "/track/out": (t, t[:, None])}
    return made(path, topics, rows, scene, **more)


def called(analysis, path, *given, **options):
    with Log(path) as log:
        return analysis(RunData(log), *given, **options)


def teeth_of(path):
    joint = {"source": "track", "outputs": JOINT, "target": "drive", "inputs": JOINT}
    topics = {"/track/out": [("travel", "m")], "/drive/out": [("speed", "rad/s")]}
    rows = {topic: (T, 1.0 + T[:, None]) for topic in topics}
    return made(path, topics, rows, {"vehicle": {"sprocket": {"teeth": "x"}}}, ("track", "drive"), [joint])


def moving(path, count):
    topics = {"/chassis/out": [(name, "1") for name in phases.MOTION]}
    return made(path, topics, {"/chassis/out": (T[:count], np.zeros((count, 5)))}, None, ("chassis",))


def seated(path, own=sines, t=T, names=SEAT_MOTION + ATTITUDE, **options):
    return called(ride.of, seat_log(path.parent, own(t), t, names), **options)


def morrow(_):
    table, where = read_table("m113")
    return vehicle({**table, "life": {**table["life"], "pin": {"stress": 1e8, "mean_stress": "morrow"}}}, where)


def on_sprocket(measure, revolutions, every=1):
    turned = np.linspace(0.1, 0.1 + 2 * np.pi * revolutions, 400)[::every]
    links = on_the_sprocket(turned)
    speed = links.t, np.full_like(turned, revolutions * TEETH * PITCH)
    return measure(Record(links, {"drive.angle": (links.t, turned), "track.speed": speed}), "", Window(0.0, 1.0))


def without_a_seat(path):
    table = (resources.files("fmus") / "vehicles" / "m113.toml").read_text(encoding="utf-8")
    (path.parent / "seatless.toml").write_text(re.sub(r"\[seat\.driver\].*?\n\n", "", table, flags=re.DOTALL))
    (path.parent / "own.toml").write_text(OWN)
    mobility.cases(True, str(path.parent / "own.toml"))


OWN = (
    'title = "x"\nassembly = "vehicle"\nvehicle = "seatless.toml"\n[track]\nmodel = "rigid"\n'
    '[drive]\nmode = "speed"\n[run]\nstop = "1 s"\nstep = "1 ms"\n[expect]\n'
)
UNEVEN = SimpleNamespace(scene={"ground": {"rough": {"seed": 1}}})
FORCE, OPEN = "joint[1].force.x", ["link[1].tension", *(f"joint[{i}].position.{a}" for i in (1, 2) for a in "xyz")]
CALLS = {
    "no circuit": (lambda p: called(envelope.of, of_track(p, OPEN)), "1 links between 2 pins make no circuit"),
    "no teeth": (lambda p: called(spectrum.of, teeth_of(p), "track.travel", orders=True),
                 "no number above 0 at vehicle.sprocket.teeth"),
    "rigid": (lambda p: called(fatigue.of, of_track(p, [], scene={"track": {"model": "rigid"}})),
              "rigid links have no stress"),
    "text, not track": (lambda p: called(fatigue.of, of_track(p, [FORCE], scene={"track": "x"})), "group 'fibres'"),
    "text, no vehicle": (lambda p: called(wear.of, of_track(p, [], scene={"vehicle": "x"})), "no pin of the vehicle"),
    "no fibres": (lambda p: called(fatigue.of, of_track(p, [FORCE])), "group 'fibres' of track.link_outputs"),
    "unit": (lambda p: fatigue.StressLifeLine.read("90 mm,1e6,5"), "sn = 90 mm,1e6,5: "),
    "short run": (lambda p: called(phases.of, moving(p, 2)), "too few steps"),
    "no hull": (lambda p: called(phases.of, of_track(p, [])),
                "holds no 'chassis.speed': .* without the motion of a hull"),
    "no phases": (lambda p: called(life.of, log_of(p, np.zeros((20, 2))), by="phase"),
                  "no phases without the motion of a hull"),
    "no fracture": (morrow, r'life.pin.fracture: is missing; mean_stress = "morrow" needs it'),
    "no friction": (lambda p: called(wear.of, worn(p, {**BUSHING, "friction": 0.0})),
                    "no pin of the vehicle rubs .vehicle.track.bushing.friction"),
    "no seat": (lambda p: seated(p, names=[(f"other{k}", "m") for k in range(7)]),
                r"holds no motion of a seat: the scene's key seats = \['NAME'\], or"),
    "no records": (lambda p: seated(p, window=Window(5.0, 6.0)), "fewer than 16 records in the window"),
    "seldom": (lambda p: seated(p, t=T[::10]), "is recorded every 10 ms: vibration up to 80 Hz needs 6.25 ms or less"),
    "NaN": (lambda p: seated(p, lambda t: np.where(t[:, None] > 1.0, np.nan, sines(t))), "is not finite"),
    "no tooth force": (lambda p: called(largest, of_track(p, [FORCE]), "tooth_force"),
                       r"holds no 'track.joint\[\*\].tooth.force'; record it with the group"),
    "no wheels": (lambda p: called(largest, of_track(p, [FORCE]), "wheel_force"), "'track' has no wheels"),
    "no recoil": (lambda p: called(FIGURES["recoil_stroke"], of_track(p, [FORCE]), "", EVER), "no recoil"),
    "half a circuit": (lambda p: on_sprocket(chain_measures.pins_passed, 4.228, 199),
                       "more than half a circuit passes between two records of links"),
    "stands": (lambda p: on_sprocket(chain_measures.pins_per_revolution, 0.05), "turns by less than a pin"),
    "no pin": (lambda p: on_sprocket(chain_measures.chain_speed_ratio, 0.05), "less than a pin passes"),
    "uneven": (lambda p: vehicle_measures.settlement(UNEVEN, "", EVER), "settlement is not known on uneven ground"),
    "weather": (lambda p: analyse(of_track(p, []), "weather"), "no analysis 'weather': one of power, spectrum"),
    "no option": (lambda p: analyse(of_track(p, []), "fatigue", slope=3),
                  "fatigue has no option 'slope': there is track: .*; sn: S-N line .*; signal: "),
    "a chain": (lambda p: mobility.cases(True, "hanging_chain"), "assembly = 'chain': must be 'vehicle'"),
    "no place": (without_a_seat, "own.toml: vehicle.seat: m113 has none"),
    "nothing varies": (lambda p: Design.of([]), "a sweep needs a key to vary"),
    "no range": (lambda p: search(formula(*FORMULAS["line"]), 5), "^scan 5: p0 has no range: free p0=FROM:TO has one$"),
}  # fmt: skip


@pytest.mark.parametrize("cause", CALLS)
def test_what_a_log_lacks_and_what_is_refused_is_told(tmp_path, cause):
    call, said = CALLS[cause]
    with pytest.raises(REFUSED) as caught:
        call(tmp_path / "a.mcap")
    assert re.search(said, str(caught.value))


# --- courses --------------------------------------------------------------------------------------------------------

RUN = "[[run]]\nlog = {}\nkm = 1\n"
ONE = RUN.format('"a.mcap"')
COURSES = {
    '[[run]]\nlog = "a.mcap"\nkm = 0': r"course.toml.: run.1..km = 0: must be greater than 0 km",
    "": "course.toml.: key 'run' is missing",
    RUN.format("[]"): "run.1..log = .*must be a list of texts, at least 1",
    f"{ONE}share = 2": "unknown key 'run.1..share'",
    '[[run]]\nlog = "a.mcap"\nkm = "1 kg"': "run.1..km = '1 kg': must be a quantity in km",
    "[[run]": "not a readable TOML file",
    RUN.format('["a.mcap", "a.mcap"]'): r"run.1..log = .*: names a log twice",
    RUN.format('"none.mcap"'): "none.mcap",
    f"{ONE}from = 3\nto = 2": "no links of 'track' were recorded between 3 and 2",
    f"{ONE}to = 0.9": "a.mcap: the chain of track went round 0.90 times",
    RUN.format('"still.mcap"'): "still.mcap: the chain of track went round 0.00 times",
    RUN.format('"back.mcap"'): "back.mcap: the chain of track went round 0.60 times",
    RUN.format('"bare.mcap"'): "bare.mcap: the vehicle has no table life",
    RUN.format('"failed.mcap"'): "failed.mcap was cut off, or its run failed",
    RUN.format('"cut.mcap"'): "cut.mcap was cut off, or its run failed",
    RUN.format('"no.mcap"'): "no.mcap holds no 'track.joint.*force'; record it with the group",
    ONE + RUN.format('"pitch.mcap"'): "pitch.mcap: pitch = 0.11 is not",
    RUN.format('["a.mcap", "links.mcap"]'): "links.mcap: links = 3 is not as in .*a.mcap",
    RUN.format('["a.mcap", "life.mcap"]'): "life.mcap: life.gap = 0.002 is not as in .*a.mcap",
    RUN.format('["a.mcap", "two.mcap"]'): r"two.mcap: tracks = .*right_track.* is not as in",
}


@pytest.fixture(scope="module")
def odd_logs(tmp_path_factory):
    folder, force = tmp_path_factory.mktemp("odd"), waves(*[20e3] * 4)
    t = np.arange(len(force)) * STEP
    log_of(folder / "a.mcap", force)
    log_of(folder / "still.mcap", force, travel=0.0 * t)
    log_of(folder / "back.mcap", force, travel=0.6 * LENGTH * (1.0 - np.abs(t / 2.0 - 1.0)))
    log_of(folder / "bare.mcap", force, table=None)
    log_of(folder / "failed.mcap", force, status="failed")
    log_of(folder / "pitch.mcap", force, pitch=0.11)
    log_of(folder / "links.mcap", force[:, :3])
    log_of(folder / "life.mcap", force, table=TABLE.model_copy(update={"gap": 2e-3}))
    log_of(folder / "two.mcap", force, tracks=("left_track", "right_track"))
    log_of(folder / "no.mcap", force[:, :0])
    content = (folder / "a.mcap").read_bytes()
    (folder / "cut.mcap").write_bytes(content[: len(content) // 2])
    return folder


@pytest.mark.parametrize("text", COURSES)
def test_what_is_no_course_is_refused_in_a_sentence(odd_logs, text):
    (odd_logs / "course.toml").write_text(text, encoding="utf-8")
    with pytest.raises(REFUSED, match=COURSES[text]):
        course.life(odd_logs / "course.toml")


# --- answers with a doubt -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "said"), [
    ("weak", "p0 has an error above 100 %: these signals do not tell it"),
    ("exponential", "the error of p0 is rough: the sum of squares rises by 2 at -2, 0.7"),
    ("flat", "p0 is not known: within its range, or 100 %, the sum of squares hardly rises"),
    ("idle", "no signal depends on p1"), ("bound", "p0 ends at its bound, 1.5"), ("parabola", " are correlated by "),
])  # fmt: skip
def test_a_fit_names_its_doubts(name, said):
    found = solved(name)
    assert any(said in text for text in (*found.problems, *found.notes))


E1049 = 1e7 * np.array([-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0])
COST = "recorded every 1 ms (run.links); with every second record alone the most damaged link would have 98 % less"


def test_a_table_has_its_doubts_as_notes(tmp_path):
    names = [f"link[1].fibre.{side}" for side in ("outer", "inner")]
    topics = {"/track/links": [(name, "Pa") for name in names], "/track/out": [("travel", "m")]}
    t = STEP * np.arange(9)
    rows = {"/track/links": (t, np.stack([E1049, E1049], axis=1)), "/track/out": (t, t[:, None])}
    notes = called(fatigue.of, made(tmp_path / "f.mcap", topics, rows)).table().notes
    assert notes[-1].startswith(COST)
    notes = called(wear.of, worn(tmp_path / "w.mcap", {**BUSHING, "wear": 0.0}), window=Window(0.0, 0.1)).notes()
    assert "needs track.bushing.wear" in notes[-1]
    calm = log_of(tmp_path / "c.mcap", np.zeros((3000, 2)), status="failed", message="it fell over")
    with logged("."):
        notes = analyse(calm, "life", window=Window(0.0, 0.3)).table().notes
    for said in ("no pin of track is damaged", f"{calm}: its run failed: it fell over", "went round"):
        assert any(said in note for note in notes), said


# --- estimates of the error of a run --------------------------------------------------------------------------------

OK = {"status": "ok", "message": "", "energy": None, "simulated_time": 8.0, "log": "no.mcap"}
LEFT_OPEN = {"residual_relative": 0.4, "integration_relative": {}}


@pytest.mark.parametrize(("outcome", "said"), [
    (OK | {"message": "40 % open", "energy": LEFT_OPEN}, "the run at twice the step cannot be right: 40 % open"),
    (OK | {"simulated_time": 4.0}, "the run at twice the step ends at 4 s"),
])  # fmt: skip
def test_a_companion_that_is_none_estimates_nothing(tmp_path, outcome, said):
    scene = load("straight", "flexible", ("run.stop=8 s",))
    costs = {"left_track": {"steps": 8000}, "chassis": {"steps": 0}}
    ended = {"components": costs, "simulated_time": 8.0, "communication_steps": 8000}
    entry = estimate(scene, tmp_path / "no.mcap", ended, lambda *_: outcome)
    assert (entry["total"], entry["message"]) == (None, said)
    with pytest.raises(LogUnreadable, match=r"no\.mcap"):  # the twin: it goes on to the logs
        estimate(scene, tmp_path / "no.mcap", ended, lambda *_: OK)


OLD, BLOWN_UP = {"coupling": 0.01, "integration": 0.03, "no_order": ""}, "the run at four times the step ends at 1 s"


@pytest.mark.parametrize(("own", "pins", "said"), [
    (OLD, {}, "2 % of the pins, less of all other observables (coupling 1 %, integration 3 %)"),
    (OLD | {"integration": None, "without": ["joint_force"]}, {},
     "observables, not known of joint force (coupling 1 %, integration not known"),
    ({}, {"safety": 1.25, "order": 1.234}, "(observed order 1.2)"),
    (OLD, {"safety": 1.25, "order": 1.234}, "(coupling 1 %, integration 3 %; observed order 1.2)"),
    ({}, {"safety": 3.0, "order": 0.1}, "(factor of safety 3: its differences do not converge)"),
    ({}, {"safety": 3.0, "order": 1.0}, "(factor of safety 3: an average)"),
    ({"no_order": BLOWN_UP}, {"safety": 3.0, "order": None}, f"(factor of safety 3: {BLOWN_UP})"),
])  # fmt: skip
def test_a_summary_names_the_error_its_parts_and_what_has_none(own, pins, said):
    known = {"pins": pins | {"total": 0.02, "decisive": True}, "tension": {"total": 0.3, "decisive": False}}
    error = {"coupling": None, "integration": None, "without": [], "no_order": "", "wall_time": 5.0, "message": ""}
    error |= own | {"total": 0.02, "observables": known}
    lines = summary_text.lines(summary.empty("rig", "rigid") | {"error": error}, width=10_000)
    assert any(line.strip().startswith("estimated error    2 %") and said in line for line in lines)
