"""Measures on made-up records with known answers; the largest forces of a run, where and when."""

import csv
from contextlib import nullcontext, suppress

import numpy as np
import pytest
from made_logs import made
from run_records import PITCH, RESTING, TEETH, Record, on_the_sprocket

from fmus.interface.units import read
from fmus.track.link_outputs import GROUPS, STANDARD
from orchestrator.execution import summary
from orchestrator.log.reader import Log, Missing
from orchestrator.results import chain_measures, measures
from orchestrator.results.figures import RunObservable, Shown, declared, figure
from orchestrator.results.largest_forces import FORCES, largest
from orchestrator.results.measures import FIGURES, OBSERVABLES
from orchestrator.results.run_data import EVER, Links, RunData, Window, mean, means
from orchestrator.scene.scene import load, scene_names
from orchestrator.studies.wanted_figures import recording_settings, wanted_figures


@pytest.mark.parametrize("reverse_numbers", [False, True])
@pytest.mark.parametrize("revolutions", [1.0, 3.37, -2.0])
def test_pins_are_counted_with_fractions(revolutions, reverse_numbers):
    turned = np.linspace(0.1, 0.1 + 2 * np.pi * revolutions, 400)
    links, window = on_the_sprocket(turned, reverse_numbers), Window(0.0, 1.0)
    speed = {"track.speed": (links.t, np.full_like(turned, revolutions * TEETH * PITCH))}
    run = Record(links, {"drive.angle": (links.t, turned), **speed})
    mirrored, vehicle = links._replace(forward=-links.forward), {**RESTING, "idler": {"x": 4.0}}
    rear = Record(mirrored, {"drive.angle": (links.t, -turned), **speed}, assembly="vehicle", vehicle=vehicle)
    for one, way in ((run, 1.0), (rear, -1.0)):
        assert chain_measures.pins_passed(one, "", window) == pytest.approx(way * TEETH * revolutions, abs=0.02)
        assert chain_measures.pins_per_revolution(one, "", window) == pytest.approx(TEETH, rel=5e-3)
    slipping = Record(links, {"drive.angle": (links.t, turned * 1.02), **speed})
    assert chain_measures.pins_per_revolution(slipping, "", window) != pytest.approx(TEETH, rel=1e-2)


def test_pins_pass_the_top_of_an_elevated_sprocket():
    """The twin takes the sprocket for one at the end of its track, where no pin of a wrap of 57 degrees is."""
    turned = np.linspace(0.1, 0.1 + 2 * np.pi * 1.7, 400)
    t, forward, up, tension = on_the_sprocket(turned, half=0.5)
    speed = {"track.speed": (t, np.full_like(turned, 1.7 * TEETH * PITCH))}
    for wheels, right in (
        ({"wheel": {"rear": {"x": -2.0}}}, True), ({"road_wheel": {"x": [1.0, -2.0]}}, True),
        ({"wheel": {"rear": {"x": 2.0}}}, False),
    ):  # fmt: skip
        vehicle = {**RESTING, "idler": {"x": 2.0}, **wheels}
        signals = {"drive.angle": (t, turned), **speed}
        run = Record(Links(t, -up, forward, tension), signals, assembly="vehicle", vehicle=vehicle)
        with np.errstate(invalid="ignore"):
            pins = chain_measures.pins_per_revolution(run, "", Window(0.0, 1.0))
        assert (pins == pytest.approx(TEETH, rel=5e-3)) == right
        for measure in ("tension_top", "tension_rear", "tension_front"):
            with pytest.raises(Missing, match="the analysis links by place has the tension in each"):
                FIGURES[measure](run, "", EVER)


@pytest.mark.parametrize("rear", [False, True])
def test_the_tension_of_a_run_is_that_of_its_middle(rear):
    """The tension grows along the vehicle by 1 kN/m, and is 5 kN larger in the upper run."""
    half = np.linspace(-5.0, 1.0, 301) + 4.0 * rear
    forward, up = np.concatenate([half, half[::-1]]), np.repeat([0.3, -0.4], len(half))
    tension = 1e4 + 500.0 * (forward + np.roll(forward, -1)) + 5e3 * (up > 0.0)
    links = Links(np.array([0.0, 1.0]), *(np.tile(each, (2, 1)) for each in (forward, up, tension)))
    wheels = {"x": [3.3, 0.6], "z": [-0.2, -0.2]} if rear else {"x": [-0.7, -3.3], "z": [-0.2, -0.2]}
    idler = 4.0 if rear else -4.0
    run = Record(links, assembly="vehicle", vehicle={**RESTING, "idler": {"x": idler}, "road_wheel": wheels})
    wanted = {"top": 0.5 * idler + 5.0, "front": 3.65 if rear else -0.35, "rear": 0.3 if rear else -3.65}
    for where, more in wanted.items():
        assert FIGURES[f"tension_{where}"](run, "", EVER) == pytest.approx(1e4 + 1e3 * more, abs=15.0)


def test_the_recoil_of_a_further_wheel_counts(tmp_path):
    t = np.linspace(0.0, 1.0, 11)
    names = ["left.recoil.stroke", "right.rear.recoil.stroke"]
    rows = {"/chassis/out": (t, np.stack([0.01 * t, 0.03 * t], axis=1)), "/left_track/out": (t, t[:, None])}
    topics = {"/chassis/out": [(name, "m") for name in names], "/left_track/out": [("travel", "m")]}
    spring = {"stiffness": 1e6, "damping": 1e4, "preload": 0.0}
    wheel = {**load("straight").vehicle.idler.model_dump(), "x": -3.9, "z": 0.35, "radius": 0.2}
    for recoil in (None, {"preload": 1e5, "stiffness": 1e6}):
        settings = {"vehicle.wheel": {"rear": {**wheel, "tensioner": {**spring, "recoil": recoil}}}}
        scene = load("straight", "rigid", settings)
        with Log(made(tmp_path / "r.mcap", topics, rows, scene.resolved(), ("chassis", "left_track"))) as log:
            run = RunData(log)
            for of, most in (("", 0.03), ("right", 0.03), ("left", 0.01)):
                assert FIGURES["recoil_stroke"](run, of, EVER) == pytest.approx(most)
            assert summary.observables(run, scene, 1.0).get("recoil_stroke") == (0.03 if recoil else None)


@pytest.mark.parametrize(("every", "seldom"), [(199, True), (120, False)])
def test_records_that_are_half_a_circuit_apart_do_not_tell_how_many_pins_pass(every, seldom):
    """Of 40 pins 12.7 or 21.1 pass between two records; 21.1 look as 18.9 in the other direction."""
    turned = np.linspace(0.1, 0.1 + 2 * np.pi * 4.228, 400)[::every]
    links = on_the_sprocket(turned)
    run = Record(links, {"track.speed": (links.t, np.full_like(turned, 4.228 * TEETH * PITCH))})
    with pytest.raises(LookupError) if seldom else nullcontext():
        passed = chain_measures.pins_passed(run, "", Window(0.0, 1.0))
        assert passed == pytest.approx(TEETH * (turned[-1] - turned[0]) / (2 * np.pi), abs=0.05)


@pytest.mark.parametrize(("teeth", "stands"), [(0.0, True), (0.95, True), (-0.95, True), (1.05, False), (-1.05, False)])
def test_a_sprocket_that_stands_has_no_ratios(teeth, stands):
    turned = np.linspace(0.1, 0.1 + 2 * np.pi * teeth / TEETH, 400)
    links = on_the_sprocket(turned)
    speed = np.full_like(turned, teeth * PITCH)
    run = Record(links, {"drive.angle": (links.t, turned), "track.speed": (links.t, speed)})
    for measure, value in ((chain_measures.pins_per_revolution, TEETH), (chain_measures.chain_speed_ratio, 1.0)):
        with pytest.raises(Missing) if stands else nullcontext():
            assert measure(run, "", Window(0.0, 1.0)) == pytest.approx(value, rel=0.02)


@pytest.mark.parametrize("ripple", [0.0202, 0.0166])
def test_polygon_ripple_is_the_first_tooth_harmonic_of_the_speed(ripple):
    omega, mean = 0.5, 0.121
    t = np.arange(0.0, 8.0, 0.01)
    w = TEETH * omega
    # integral of mean (1 + ripple cos(w t + 0.3) + 0.3 ripple cos(2 w t))
    x = -3.0 + mean * (t + ripple / w * (np.sin(w * t + 0.3) + 0.15 * np.sin(2 * w * t)))
    pins = np.stack([x, x + PITCH], axis=1)
    links = Links(t, pins, np.array([[0.25, -0.25]] * len(t)), np.zeros((len(t), 1)))
    run = Record(links, {"drive.speed": (t, np.full_like(t, omega))})
    assert chain_measures.polygon_ripple(run, "", Window(0.5, 8.0)) == pytest.approx(ripple, rel=1e-3)
    seldom = Record(Links(*(column[::22] for column in links)), {"drive.speed": (t, np.full_like(t, omega))})
    with pytest.raises(LookupError, match="three harmonics of a tooth need more records"):
        chain_measures.polygon_ripple(seldom, "", Window(0.5, 8.0))


def spans(upper, lower):
    """Two rows of links between axles 4 m apart."""
    x = np.linspace(-3.9, -0.1, 27)
    forward = np.concatenate([x, x[::-1]])[None]
    up = np.concatenate([np.full(27, 0.25), np.full(27, -0.25)])[None]
    tension = np.where(up > 0, upper, lower)
    return Links(np.zeros(1), forward, up, tension)


@pytest.mark.parametrize(
    ("upper", "lower", "speed", "sense"), [(17e3, 15e3, 3.0, 1), (15e3, 17e3, -3.0, 1), (15e3, 17e3, 3.0, -1)]
)
def test_spans(upper, lower, speed, sense):
    torque = (upper - lower) * TEETH * PITCH / (2 * np.pi)
    signals = {"drive.torque": (np.zeros(1), np.array([torque])), "drive.speed": (np.zeros(1), np.array([speed]))}
    run = Record(spans(upper, lower), signals, rig={"axle_distance": 4.0})
    window = Window(0.0, 0.0)
    assert chain_measures.span_tension(run, "upper", window) == upper
    assert chain_measures.span_moment_ratio(run, "", window) == pytest.approx(1.0)
    assert chain_measures.tight_span_enters(run, "", window) == sense


def falling(drop, pitch=PITCH, links=10):
    """A chain whose last pin has dropped by the share ``drop(t)`` of its length; sqrt(2 L/g) = 1 s."""
    length = links * pitch
    t = np.linspace(0.0, 1.0, 1001)
    up = np.zeros((len(t), links + 1))
    up[:, -1] = -length * drop(t)
    vehicle = {"track": {"pitch": pitch}, "gravity": 2.0 * length}  # sqrt(2 L/g) = 1 s
    return Record(Links(t, 0.0 * up, up, np.zeros((len(t), links))), vehicle=vehicle)


def test_falls():
    window = Window(0.0, 1.0)
    ahead = falling(lambda t: 1.4 * t**2 - 0.7 * t**4 / 0.9**2)  # largest at 0.9
    assert chain_measures.fall_time(ahead, "", window) == pytest.approx(0.9, rel=1e-6)
    assert chain_measures.behind_free_fall(ahead, "", window) > 0.0, "it slows down before its largest drop"
    half = np.sqrt((1.4 - np.sqrt(1.4**2 - 4 * 0.7 / 0.81 * 0.5)) / (2 * 0.7 / 0.81))
    assert chain_measures.half_fall_time(ahead, "", window) == pytest.approx(np.sqrt(2) * half, rel=1e-5)
    free, slower = falling(lambda t: 1.0001 * t**2), falling(lambda t: 0.97 * t**2)
    assert chain_measures.behind_free_fall(free, "", window) == 0.0
    assert chain_measures.behind_free_fall(slower, "", window) == pytest.approx(0.03 * 10 * PITCH)
    assert np.isnan(chain_measures.fall_time(free, "", window))
    assert np.isnan(chain_measures.half_fall_time(falling(lambda t: 0.3 * t), "", window))


def test_the_strain_of_a_hoop_and_the_sag_of_a_chain():
    angle = 2 * np.pi * np.arange(12) / 12
    radius = 1.001 * PITCH / (2 * np.sin(np.pi / 12))
    hoop = Links(np.zeros(1), radius * np.cos(angle)[None], radius * np.sin(angle)[None], np.zeros((1, 12)))
    assert chain_measures.hoop_strain(Record(hoop), "", Window(0.0, 0.0)) == pytest.approx(1e-3)
    bent = Links(np.zeros(1), np.array([[0.0, 1.0, 2.0]]), np.array([[0.5, -1.5, 0.5]]), np.zeros((1, 2)))
    assert chain_measures.sag(Record(bent), "", Window(0.0, 0.0)) == 2.0


@pytest.mark.parametrize(
    ("how", "value"),
    [("mean", 2.0), ("min", 1.0), ("max", 4.0), ("last", 1.0), ("drop", 1.0), ("ripple", 1.5), ("rms", np.sqrt(5.5))],
)  # fmt: skip
def test_reductions(how, value):
    assert measures.reduce(np.arange(4.0), np.array([2.0, 1.0, 4.0, 1.0]), how) == pytest.approx(value)


def test_means_are_over_time():
    """Over samples of 1 and of 10 ms they would be wrong; records that are left out leave out their time."""
    t = np.concatenate([np.arange(0.0, 0.1, 1e-3), np.arange(0.1, 1.001, 1e-2)])
    assert measures.reduce(t, t, "mean") == pytest.approx(0.5, rel=0.01)
    assert measures.reduce(t, t, "rms") == pytest.approx(3**-0.5, rel=0.01)
    assert t.mean() < 0.4
    t = np.array([0.0, 0.1, 0.2, 5.0, 5.1, 5.2])
    values = np.array([[1.0], [2.0], [np.nan], [100.0], [4.0], [6.0]]) * [1.0, 2.0]
    kept = np.array([True, True, False, False, True, True])[:, None]
    assert mean(t, values[:, 0], kept[:, 0]) == pytest.approx((0.1 * 1 + 0.1 * 2 + 0.1 * 4 + 0.1 * 6) / 0.4)
    assert mean(t, values, np.broadcast_to(kept, values.shape)) == pytest.approx(1.5 * 3.25)
    np.testing.assert_allclose(means(t, values, kept), [3.25, 6.5])


@pytest.mark.parametrize("measure", [chain_measures.sag, chain_measures.hoop_strain, chain_measures.span_tension])
def test_measures_of_links_are_means_over_time(measure):
    """Measures of links are means over time, also where records become ten times as sparse."""
    t = np.concatenate([np.arange(0.0, 0.5, 1e-3), np.arange(0.5, 1.0005, 1e-2)])
    size = 1.0 + (t > 0.5 - 1e-9)
    forward = -0.5 * PITCH * np.array([0.0, 1.0, 1.0, 0.0]) * size[:, None] - 0.5
    up = PITCH * np.array([0.0, 0.0, 1.0, 1.0]) * size[:, None]
    links = Links(t, forward, up, 1e4 * size[:, None] * np.ones(4))

    def measured(which):
        run = Record(Links(*(column[which] for column in links)), rig={"axle_distance": 2.0})
        return measure(run, "upper", Window(0.0, 1.0))

    short, long = measured(t < 0.499), measured(t > 0.499)
    assert abs(long - short) > 0.1 * abs(long)
    assert measured(slice(None)) == pytest.approx(0.5 * (short + long), rel=0.01)


# declarations


def declaration_faults(one, traits):
    """Everything that the declaration of a figure lacks: unit, meaning, a way to show it that fits."""
    if not one.unit or read(one.unit).factor != 1.0:
        yield "no SI unit"
    texts = (one.meaning, one.none, *one.reasons)
    if len(one.meaning) <= 10 or one.meaning.endswith(".") or any("`" in text or "Missing" in text for text in texts):
        yield "no meaning in words of users"
    if one.unit != "1" and one.unit not in one.meaning.replace(",", " ").replace(";", " "):
        yield "a meaning without its unit"
    for shown in one.shown:
        if one.wrong_part(shown.of):
            yield "shown of a part that it has not"
        if shown.on not in traits:
            yield "shown by no scene"
        if shown.unless not in ("", *OBSERVABLES):
            yield "shown instead of nothing"
        with suppress(ValueError):
            assert RunObservable(one, shown).size > 0.0
            continue
        yield "shown in the unit of something else"


def known_traits():
    """Traits of the scenes of the gallery, all groups of link outputs, and none."""
    return {"", *GROUPS, *(trait for name in scene_names() for trait in summary.traits(load(name)))}


def test_every_figure_has_a_unit_a_meaning_and_scenes_that_show_it():
    traits = known_traits()
    assert not [(one.name, *found) for one in FIGURES.values() if (found := [*declaration_faults(one, traits)])]
    every = [one for module in measures.MODULES for one in declared(module)]
    assert len(FIGURES) == len(every), "two figures of one name"
    assert len(OBSERVABLES) == sum(len(one.shown) for one in every), "two observables of one name"


@pytest.mark.parametrize(("unit", "meaning", "shown", "fault"), [
    ("", "Height of the hull, m", (), "no SI unit"),
    ("kN", "Force of the ground, kN", (), "no SI unit"),
    ("m", None, (), "no meaning in words of users"),
    ("m", "Height of the hull, m; raises Missing without one", (), "no meaning in words of users"),
    ("m", "Height of the hull over the ground", (), "a meaning without its unit"),
    ("m", "Height of the hull, m", [Shown("height", "kN")], "shown in the unit of something else"),
    ("m", "Height of the hull, m", [Shown("height", "mm", of="left")], "shown of a part that it has not"),
    ("m", "Height of the hull, m", [Shown("height", "mm", on="vehicles")], "shown by no scene"),
    ("m", "Height of the hull, m", [Shown("height", "mm", unless="depth")], "shown instead of nothing"),
])  # fmt: skip
def test_a_figure_that_lacks_something_is_found(unit, meaning, shown, fault):
    def height(run, of, window):
        return 0.0

    height.__doc__ = meaning
    assert fault in declaration_faults(figure(unit, *shown)(height), known_traits())


def test_the_first_paragraph_is_the_meaning_and_further_ones_are_the_reasons():
    """As data, without marks of the source; the page of keys and the report read no docstring."""

    @figure("1", Shown("slip", "%", of="left", name="own_slip"), of=("left", "right"))
    def own(run, of, window):
        """Slip of ``own``,
        a share.

        Why ``bounds`` are
        as they are.

        More.
        """
        return {"left": 1.0, "right": 2.0}[of] + window.start

    assert (own.name, own.unit, own.meaning) == ("own", "1", "Slip of own, a share")
    assert own.reasons == ("Why bounds are as they are.", "More.")
    assert own(None, "right", Window(1.0, 2.0)) == 3.0
    assert own.wrong_part("") == "own must be of 'left' or 'right'"
    assert own.wrong_part("left") == ""
    assert RunObservable(own, own.shown[0]).size == 0.01
    assert RunObservable(own, own.shown[0]).value(None, Window(1.0, 2.0)) == 2.0
    assert RunObservable(own, own.shown[0]._replace(whole=True)).value(None, Window(1.0, 2.0)) == 1.0 + EVER.start
    assert RunObservable(FIGURES["yaw_rate"], Shown("yaw rate", "mrad/s")).size == pytest.approx(1e-3)


# largest forces

BEARERS = 3


def log_of(path, values):
    """Log of a track whose pins, links and wheels bear vectors of the sizes ``values`` (m, 3)."""
    t = 0.01 * np.arange(len(values))
    vectors = np.concatenate([0.6 * values, 0.0 * values, -0.8 * values], axis=1)
    names = [one.signal for one in FORCES.values() if one.signal]
    topics = {
        "/left_track/links": [(f"{n.replace('*', f'{i}')}.{a}", "N") for n in names for a in "xyz" for i in (1, 2, 3)],
        "/left_track/out": [
            ("travel", "m"),
            *((f"{wheel}.force.{a}", "N") for a in "xyz" for wheel in ("sprocket", "road_wheel[1]", "idler")),
            *((f"{wheel}.torque.{a}", "N.m") for wheel in ("sprocket", "road_wheel[1]", "idler") for a in "xyz"),
        ],
    }
    outputs = np.concatenate([np.zeros((len(t), 1)), vectors, np.zeros((len(t), 9))], axis=1)
    rows = {"/left_track/links": (t, np.tile(vectors, len(names))), "/left_track/out": (t, outputs)}
    return made(path, topics, rows, instances=("left_track",))


@pytest.mark.parametrize("name", FORCES)
def test_the_largest_force_has_its_bearer_place_and_time(tmp_path, name):
    values = np.zeros((1000, BEARERS))
    values[:, 1] = np.linspace(1.0, 1000.0, 1000)  # the others bear nothing, which counts for no share
    values[300, 2] = 4e3
    with Log(log_of(tmp_path / "a.mcap", values)) as log:
        run = RunData(log)
        found = largest(run, name)
        early = largest(run, name, "left", Window(0.0, 1.0))
        assert FIGURES[name](run, "", EVER) == found.most == pytest.approx(4e3)
        assert FIGURES[f"{name}_high"](run, "", EVER) == found.high
        assert OBSERVABLES[name].shown.place(run) == found.place
    bearer = FORCES[name].place.format("idler" if name == "wheel_force" else "3")
    assert found.place == f"{bearer} of the left track at 3 s"
    assert found.high == pytest.approx(np.quantile(values[values > 0.0], 0.999))
    assert found.high != pytest.approx(np.quantile(values, 0.999), rel=1e-3)
    assert (early.most, early.t) == (pytest.approx(101.0), 1.0)


def test_what_no_wheel_touches_has_no_largest_force(tmp_path):
    with Log(log_of(tmp_path / "a.mcap", np.zeros((10, BEARERS)))) as log:
        found = largest(RunData(log), "horn_force")
        assert (found.most, found.high, found.place) == (0.0, 0.0, "(none)")


def test_a_sweep_records_what_its_figures_need():
    def recorded(*texts, **given):
        return recording_settings(wanted_figures(texts), given)

    assert recorded("pin_force", "wheel_force") == {}
    assert recorded("tooth_force_high,pin_moment") == {"track.link_outputs": [*STANDARD, "teeth", "moment"]}
    assert recorded("life") == {"run.links": 1}
    assert recorded("rim_force", **{"track.link_outputs": "all"}) == {"track.link_outputs": "all"}


@pytest.mark.long
def test_a_sweep_answers_with_the_figures_that_it_is_asked_for(cotrack, tmp_path):
    """Pins, teeth and life over the pull on a chain; the printed table has no other figures, the CSV has all."""
    short = ("--track", "rigid", "--set", "run.stop=0.3 s", "--set", "bench.links=24", "--no-estimate", "--workers", 1)
    pulls = ("--vary", "bench.upper=15,60 kN", "--for", "tooth_force,pin_force", "--for", "life")
    out = cotrack.done("sweep", "sprocket_bench", *short, *pulls, "-o", "found")
    head = out.splitlines()[0].strip("| ").split(" | ")
    assert head[:3] == ["bench.upper, kN", "status", "checks"]
    figures = ["pin_force, N", "pin_force_high, N", "tooth_force, N", "life pin", "life damage, 1/km"]
    assert [one for one in head if one in figures] == figures
    assert not {"speed, m/s", "tension_max, N"} & {*head}
    rows = list(csv.DictReader((tmp_path / "found" / "sweep.csv").open()))
    assert {*figures, "tension_max, N"} <= {*rows[0]}
    light, heavy = ({name: float(row[name]) for name in figures} for row in rows)
    assert 15e3 < light["pin_force, N"] < 16e3
    assert 60e3 < heavy["pin_force, N"] < 62e3
    for row in (light, heavy):
        assert 0.0 < row["tooth_force, N"] < row["pin_force, N"]
    assert heavy["life damage, 1/km"] > 1e3 * light["life damage, 1/km"]
