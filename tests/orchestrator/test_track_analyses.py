"""Analyses of a track against its records: power, links and joints, deformation, ground, wheels, circuit, events."""

import json
from itertools import pairwise

import numpy as np
import pytest
from made_logs import STEP, made
from mcap.reader import make_reader
from scipy.spatial import ConvexHull
from short_runs import driven_log

from orchestrator.log.message_records import WARNINGS
from orchestrator.log.reader import Log
from orchestrator.results import energy
from orchestrator.results.analyses import (
    circuit,
    deformation,
    envelope,
    events,
    life,
    links,
    patches,
    power,
    record_blocks,
    slip,
    wheel_loads,
)
from orchestrator.results.run_data import RunData, Window, mean
from orchestrator.results.views.bodies import EVERY, Bodies
from orchestrator.studies.wanted_figures import figures_of_log, wanted_figures

driven = pytest.fixture(scope="module")(driven_log)


# power


@pytest.mark.long
def test_power_through_ports_is_the_work_of_the_ledger_and_what_the_chassis_received(driven):
    with Log(driven) as log:
        run = RunData(log)
        port_power, works = power.of(run), energy.port_works(run)
        received, motor, spun = (
            float(np.diff(run.ends(name))[0])
            for name in ("chassis.port.work", "left_drive.energy.work", "left_drive.energy.kinetic")
        )
    through = dict(zip(port_power.ports, port_power.energy + port_power.energy_carried, strict=True))
    scale = max(abs(given) for given, _ in works.values())
    assert scale > 1e3
    for port, (given, _) in works.items():
        assert through[f"{port.giver}.{port.giver_connector}"] == pytest.approx(given, abs=1e-3 * scale)
    of_hull = [k for k, name in enumerate(port_power.ports) if name != "left_track.sprocket"]
    assert 2 * (port_power.energy + port_power.energy_carried)[of_hull].sum() == pytest.approx(received, rel=2e-3)
    sprocket, mount = (port_power.ports.index(name) for name in ("left_track.sprocket", "left_drive.mount"))
    # a mount does not move relative to the hull; a sprocket passes on the motor's torque less its own spin
    assert abs(port_power.energy[mount]) < 1e-6 * abs(port_power.energy_carried[mount])
    assert port_power.energy_drive[0] == pytest.approx(motor, rel=1e-4)
    assert -port_power.energy[sprocket] == pytest.approx(motor - spun, rel=0.02)
    assert abs(port_power.energy_carried[sprocket]) > 0.03 * abs(port_power.energy[sprocket]), "raw power is similar"


def test_power_sees_a_wrench_that_is_off_by_three_per_cent(driven, scaled):
    with Log(driven) as log:
        right = power.of(RunData(log)).energy
    with Log(driven) as log:
        scaled(log, "/left_track/out", "sprocket.torque.y", 1.03)
        wrong = power.of(RunData(log)).energy
        largest = max(abs(given) for given, _ in energy.port_works(RunData(log)).values())
    # heading 0.6 rad: cos^2 of the torque about the axle is about y
    assert wrong[0] / right[0] == pytest.approx(1.0 + 0.03 * np.cos(0.6) ** 2, rel=1e-4)
    assert abs(wrong[0] - right[0]) > 5e-3 * largest, "the energy balance does not see the fault"
    np.testing.assert_array_equal(wrong[1:], right[1:])


def test_a_window_of_power_is_a_part_of_it_and_energies_alone_are_those_of_the_powers(driven, monkeypatch):
    monkeypatch.setattr(power, "BLOCK", 30)
    with Log(driven) as log:
        run = RunData(log)
        whole, *parts = (power.of(run, Window(*each)) for each in ((0.0, 0.2), (0.0, 0.1), (0.1, 0.2)))
        summed = power.summary(run)
    np.testing.assert_allclose(parts[0].energy + parts[1].energy, whole.energy, rtol=1e-9, atol=1e-9)
    assert len(whole.t) == len(parts[0].t) + len(parts[1].t)
    np.testing.assert_allclose(summed.relative, whole.energy, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(summed.carried, whole.energy_carried, rtol=1e-9)
    np.testing.assert_allclose(whole.table().rows[0][1:], summed.table().rows[0][1:], rtol=1e-9)
    assert whole.table().title == summed.table().title == "Power into wheels relative to the hull, 0 to 0.2 s"


# links


def test_forces_of_links_are_those_of_the_track(driven):
    with Log(driven) as log:
        run = RunData(log)
        (forces,) = links.of(run).forces
        t, whole = run.vectors("left_track", "out", "ground.force")
        tension = log.select(log.choose(["left_track.link[*].tension"]))["/left_track/links"].values
        world = log.select(log.choose(["left_track.joint[*].force.*"]))["/left_track/links"].values
    at = np.searchsorted(t, forces.t - 1e-9)
    between = [whole[i + 1 : j + 1].mean(axis=0) for i, j in pairwise(at)]
    summed = np.einsum("mnij,mnj->mi", forces.axes, forces.ground)
    np.testing.assert_allclose(summed, [whole[0], *between], atol=1e-9 * np.abs(whole).max())
    assert np.abs(whole[-1, 2]) > 4e4
    # from strain alone; a link's tension also has damping and rotation
    np.testing.assert_allclose(forces.axial, tension, atol=1e-3 * tension.max())
    np.testing.assert_allclose(
        np.linalg.norm(forces.joint, axis=2), np.linalg.norm(world.reshape(*forces.t.shape, -1, 3), axis=2), rtol=1e-12
    )
    # the first pin of a taut link pulls it backwards, and the ground pushes inwards
    assert np.median(-forces.joint[-1, :, 0] / tension[-1]) == pytest.approx(1.0, abs=0.05)
    assert forces.ground[-1, :, 2].sum() == pytest.approx(-between[-1][2], rel=0.02)
    assert np.abs(forces.joint[..., 1]).max() < 1e-6 * np.abs(forces.joint).max(), "a straight run has lateral forces"


def test_a_force_of_the_ground_that_is_off_by_three_per_cent_is_seen(driven, scaled):
    with Log(driven) as log:
        run = RunData(log)
        right = links.of(run).forces[0].ground
        link = int(np.abs(right[-1]).max(axis=1).argmax())
        scaled(log, "/left_track/links", f"link[{link + 1}].ground.force.z", 1.03)
    with Log(driven) as log:
        run = RunData(log)
        wrong, force = links.of(run).forces[0].ground, links.of(run, by="place", signal="pressure").force
    lost = np.einsum("mnk,mnk->m", wrong - right, wrong - right) ** 0.5
    assert lost[-1] > 1e-3 * np.abs(right).max()
    assert force != pytest.approx(-right[..., 2].sum(axis=1).mean(), rel=1e-4)


def test_the_moment_of_a_link_is_that_of_its_fibres(driven):
    """The moment of a link is that of its fibre stresses: M = (inner - outer) / 2 x I / fibre distance."""
    with Log(driven) as log:
        run = RunData(log)
        moment = links.of(run).forces[0].moment
        pair = [run.signal(f"left_track.link[5].fibre.{side}")[1] for side in ("outer", "inner")]
    np.testing.assert_allclose(moment[:, 4], 0.5 * (pair[1] - pair[0]) * 2.03e-6 / 0.02, rtol=1e-12)


def test_rows_of_links_are_the_extremes_of_their_forces(driven, monkeypatch):
    monkeypatch.setattr(record_blocks, "SIZE", 7)
    with Log(driven) as log:
        found, summed = links.of(RunData(log)), links.summary(RunData(log))
    (forces,) = found.forces
    rows = {row["component"]: row for row in summed.table().records()}
    assert (summed.rows, len(rows)) == (found.rows, 10)
    outwards = forces.ground[..., 2] / 1e3
    for name, values in (("joint force along", forces.joint[..., 0] / 1e3), ("bending moment", forces.moment)):
        for end, place in (("least", values.argmin()), ("largest", values.argmax())):
            record, link = np.unravel_index(place, values.shape)
            known = values[record, link], link + 1, forces.t[record]
            assert [rows[name][f"{end}{of}"] for of in ("", " in link", " at")] == pytest.approx(known, rel=1e-9)
    assert rows["ground force outwards"]["mean"] == pytest.approx(
        np.average(outwards.mean(axis=1), weights=forces.since)
    )


def test_the_largest_force_of_a_pin_has_its_part_of_the_circuit(driven):
    """Parts of the largest forces, by where the pin is: near the sprocket's axle, at the rear end, above or below."""
    with Log(driven) as log:
        run = RunData(log)
        rows, pins = links.summary(run).table().records(), run.links("left_track")
    seen = set()
    for each in (each for each in rows if each["component"].startswith("joint")):
        row, part = int(np.abs(pins.t - each["largest at"]).argmin()), each["largest on"]
        x, z = pins.forward[row], pins.up[row]
        k = each["largest in link"] - 1
        run_part = "upper run" if z[k] > 0.5 * (z.min() + z.max()) else "lower run"
        wheel = "sprocket" if np.hypot(x[k], z[k]) < 0.45 else "idler" if x[k] < x.min() + 0.6 else run_part
        assert part in (wheel, run_part)
        seen.add(part if wheel == run_part else "")
    assert seen - {""}, "no pin is far from both wheels"


# deformation

ROD, GRADIENT = 0.2, (1.0 + 1e-5, 0.0, 2e-5)  # m; at the first pin of a made-up element


def bent(path, turned=0.0, gradient=GRADIENT):
    """Log of one link with r = x + 1e-5 x + (2e-5 x, 0, 2e-5 x - 3e-4 x^2 + 1e-3 x^3), rotated about y."""
    x = np.array([0.0, ROD])
    slope = np.stack([np.ones(2), np.zeros(2), -6e-4 * x + 3e-3 * x**2], axis=1) + np.array(gradient) - [1.0, 0.0, 0.0]
    along, outwards = x * gradient[0], gradient[2] * x - 3e-4 * x**2 + 1e-3 * x**3
    place = np.stack([5.0 + along, np.ones(2), 2.0 + outwards], axis=1)
    c, s = np.cos(turned), np.sin(turned)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    row = np.concatenate([(place @ turn.T).ravel(), (slope @ turn.T).ravel()])
    names = [(f"joint[{i}].position.{axis}", "m") for i in (1, 2) for axis in "xyz"]
    names += [(f"link[1].slope.{end}.{axis}", "1") for end in ("first", "last") for axis in "xyz"]
    topics = {"/track/out": [("travel", "m")], "/track/links": names}
    scene = {"vehicle": {"track": {"pitch": ROD}}, "start": {"heading": 0.0}}
    t = np.array([0.0, 1.0])
    return made(path, topics, {"/track/out": (t, [[0.0], [0.0]]), "/track/links": (t, [row, row])}, scene)


@pytest.mark.parametrize("turned", [0.0, 0.7, 3.0])
def test_deformation_of_a_known_cubic_in_its_tangent_frame(tmp_path, turned):
    """Deformation of a known cubic in its tangent frame is the bending.

    Along the chord it is half of the angle's square. The tangent takes 2e-5 x off.
    """
    with Log(bent(tmp_path / "bent.mcap", turned)) as log:
        field = deformation.of(RunData(log), at=[0.3])
    x = field.x
    assert field.t.tolist() == [0.0]
    np.testing.assert_allclose(field.displacement[0, 0, :, 0], 1e-5 * x, atol=1e-3 * 2e-6)
    outwards = -3e-4 * x**2 + 1e-3 * x**3  # along z: the pin's axis is y, so x cross y
    np.testing.assert_allclose(field.displacement[0, 0, :, 1], outwards, atol=1e-4 * abs(outwards).max())
    assert abs(field.displacement[..., 2]).max() < 1e-14
    assert field.series().rows[-1][3] == pytest.approx(1e-5 * ROD, rel=1e-3)
    with Log(bent(tmp_path / "other.mcap", turned, (1.0 + 1.03e-5, 0.0, 2e-5))) as log:
        other = deformation.of(RunData(log)).displacement
    assert abs(other[0, 0, -1, 0] / field.displacement[0, 0, -1, 0] - 1.0) > 0.02


def test_links_in_tension_lengthen_by_their_strain(driven):
    """Links in tension lengthen by stress l / E less the shortening by bending; nothing is lateral."""
    with Log(driven) as log:
        run = RunData(log)
        field = deformation.of(run, at=[0.1, 0.2])
        t, outer = run.signal("left_track.link[5].fibre.outer")
        _, inner = run.signal("left_track.link[5].fibre.inner")
    at = np.searchsorted(t, field.t - 1e-9)
    stretched = 0.5 * (outer + inner)[at] * 0.1524 / 2e11
    bend = np.gradient(field.displacement[:, 4, :, 1], field.x, axis=1)
    shortened = 0.5 * np.trapezoid(bend**2, field.x, axis=1)
    np.testing.assert_allclose(field.displacement[:, 4, -1, 0] + shortened, stretched, rtol=1e-3)
    assert np.abs(field.displacement[..., 2]).max() < 1e-12
    assert 1e-8 < np.abs(field.displacement[..., 1]).max() < 1e-4


def test_deformation_as_a_picture_and_as_numbers(cotrack, driven, tmp_path):
    cotrack.done("analyse", driven, "deformation", "--at", "0.1", "--at", "0.2", "--link", "7", "-o", "d.png")
    assert (tmp_path / "d.png").read_bytes()[:4] == b"\x89PNG"
    cotrack.done("analyse", driven, "deformation", "-o", "d.csv")
    assert len((tmp_path / "d.csv").read_text().splitlines()) == 1 + 64 * deformation.POINTS


# wheels and ground


def test_pressure_is_the_force_on_the_ground_over_the_pads(driven):
    with Log(driven) as log:
        run = RunData(log)
        pressure, (every,) = links.of(run, by="place", signal="pressure"), links.of(run).forces
        pushes, since = -every.ground[..., 2].sum(axis=1), np.diff(every.t, prepend=every.t[0] - every.t[1])
        assert pressure.force == pytest.approx(np.average(pushes, weights=since), rel=1e-9)
        assert pressure.area == pytest.approx(0.1524 * 0.378)
        assert pressure.peak.value == pytest.approx(-1e-3 * every.ground[..., 2].min() / pressure.area, rel=1e-9)
    assert pressure.unit == "kPa"
    assert np.nansum(pressure.mean) * 1e3 * pressure.area == pytest.approx(pressure.force, rel=0.15)
    touching = pressure.forward[pressure.most > 0.01 * pressure.peak.value]
    assert touching.max() < -0.3
    assert touching.min() > -3.8


def test_slip_and_thrust_are_along_the_heading(driven):
    with Log(driven) as log:
        run = RunData(log)
        track_slip = slip.of(run)
        _, force = run.vectors("left_track", "out", "ground.force")
    ahead = np.array([np.cos(0.6), np.sin(0.6), 0.0])
    np.testing.assert_allclose(track_slip.thrust[:, 0], force @ ahead, atol=1e-6 * np.abs(force).max())
    assert np.abs(track_slip.lateral).max() < 1e-6 * np.abs(force).max()
    assert np.abs(track_slip.thrust[-50:]).mean() > 100.0
    np.testing.assert_array_equal(track_slip.load[:, 0], force[:, 2])


@pytest.mark.parametrize("even", [True, False])
def test_slips_are_ratios_of_means_over_time(even):
    """Of ways, with records of any length, in both directions; a mean over records, or of ratios, is another one."""
    t = np.linspace(0.0, 4.0, 401)
    t = t if even else t + 0.4 * np.sin(t)
    speed = (2.0 + t) * np.where(t > 2.5, -1.0, 1.0)
    share = 0.02 + 0.3 * np.exp(-t)
    steps = np.diff(t, prepend=2.0 * t[0] - t[1])
    wanted = (share * np.abs(speed) * steps).sum() / (np.abs(speed) * steps).sum()
    assert slip.ratio(t, speed, share * speed) == pytest.approx(wanted, rel=1e-12)
    assert slip.mean_lag(t, speed, share * speed) == pytest.approx(mean(t, share * np.abs(speed)), rel=1e-12)
    np.testing.assert_allclose(slip.ratios(speed, share * speed), share, rtol=1e-12)
    assert abs(mean(t, share) / wanted - 1.0) > 0.05, "the twin"
    assert even or abs((share * np.abs(speed)).sum() / np.abs(speed).sum() / wanted - 1.0) > 0.01, "the twin"


def test_means_of_links_are_over_time_where_records_are_uneven(tmp_path):
    """Means of forces and patches by place are means over time, with records of 1 and of 10 ms."""
    t = np.concatenate([np.arange(0.0, 0.5, 1e-3), np.arange(0.5, 1.0005, 1e-2)])
    tension = 1e4 * (1.0 + (t > 0.5 - 1e-9))
    angle = -2.0 * np.pi * (np.arange(12) + 0.5) / 12
    pins = np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
    names = [f"joint[{i}].{what}.{a}" for what in ("position", "force") for i in range(1, 13) for a in "xyz"]
    names += [f"link[{i}].tension" for i in range(1, 13)]
    force = np.einsum("m,nk->mnk", tension, np.roll(pins, -1, axis=0) - pins).reshape(len(t), 36)
    values = np.hstack([np.tile(pins.ravel(), (len(t), 1)), force, np.tile(tension[:, None], (1, 12))])
    topics = {"/track/out": [("travel", "m")], "/track/links": [(name, "1") for name in names]}
    path = made(tmp_path / "u.mcap", topics, {"/track/out": (t, t[:, None]), "/track/links": (t, values)})
    wanted = mean(t, tension)
    assert tension.mean() < 0.8 * wanted, "the twin, a mean over records, must differ"
    with Log(path) as log:
        run = RunData(log)
        np.testing.assert_allclose(envelope.of(run, bins=5).mean, wanted, rtol=1e-9)
        along, *_ = links.summary(run).table().records()
        side = float(np.linalg.norm(pins[1] - pins[0]))
    assert along["component"] == "joint force along"
    assert along["mean"] == pytest.approx(1e-3 * wanted * side, rel=1e-9)
    long = patches.Patches(("wheel",), t, *np.repeat(tension[None, :, None], 3, axis=0))
    assert long.table().records()[0]["length"] == pytest.approx(1e3 * wanted, rel=1e-9)


def test_loads_of_wheels_are_counted_by_time(tmp_path):
    t = np.arange(1000) * STEP
    load = np.stack([1e4 + 3e3 * np.sin(2 * np.pi * 5 * t), np.where(t < 0.25 - 1e-9, 0.0, 8e3)])
    names = [f"road_wheel[{i}].force.{axis}" for i in (1, 2) for axis in "xyz"]
    topics = {"/track/out": [("travel", "m"), *((name, "N") for name in names)]}
    values = np.stack([t, 0.0 * t, 0.0 * t, load[0], 0.0 * t, 0.0 * t, load[1]], axis=1)
    with Log(made(tmp_path / "w.mcap", topics, {"/track/out": (t, values)})) as log:
        loads = wheel_loads.of(RunData(log))
    np.testing.assert_allclose(loads.mean, [1e4, 6e3], rtol=1e-9)
    np.testing.assert_allclose(loads.rms, [3e3 / np.sqrt(2), 8e3 * np.sqrt(0.25 * 0.75)], rtol=1e-9)
    np.testing.assert_allclose(loads.lifted, [0.0, 0.25], atol=1e-12)
    np.testing.assert_allclose([loads.least, loads.most], [[7e3, 0.0], [13e3, 8e3]], rtol=1e-9)
    rows = [row[1:] for row in loads.table().rows]
    np.testing.assert_allclose(rows[1], [6.0, 0.0, 8.0, 8.0 * np.sqrt(0.25 * 0.75), 25.0], atol=1e-9)


def test_a_wheel_on_a_flat_face_has_the_patch_of_a_circle():
    """A wheel on a flat face has the patch of a circle: a chord of the rim, or its part on the link."""
    radius, face, sunk, pitch = 0.3, 0.03, 0.004, 0.15
    pins = np.array([[0.0, 0.0, 0.0], [pitch, 0.0, 0.0], [2 * pitch, 0.0, 0.0]])
    normals = np.tile([0.0, 0.0, -1.0], (1, 2, 1))  # outwards: the wheel stands on the other side
    height, half = radius - sunk, np.sqrt(radius**2 - (radius - sunk) ** 2)

    def depths(low, high):
        """Mean of the exact depth from ``low`` to ``high``, m."""
        s = np.linspace(low, high, 20001)
        return radius - np.trapezoid(np.hypot(height, s), s) / (high - low)

    def patch_at(place, high=0.0):
        centre = np.array([[place, 0.0, height + face + high]])
        return (each[0] for each in patches.patch(pins[None], normals, centre, radius, face))

    length, depth = patch_at(0.075)
    np.testing.assert_allclose(length, [2 * half, 0.0], rtol=1e-12)
    np.testing.assert_allclose(depth, [depths(-half, half), 0.0], rtol=2e-3)
    length, depth = patch_at(pitch + 0.01)
    np.testing.assert_allclose(length, [half - 0.01, half + 0.01], rtol=1e-12)
    np.testing.assert_allclose(depth, [depths(-half, -0.01), depths(-0.01, half)], rtol=2e-3)
    assert not any(each.any() for each in patch_at(0.075, sunk + 1e-9))


@pytest.mark.parametrize(("face", "fits"), [(0.029, True), (0.030, False)])
def test_patches_at_rest_carry_what_wheels_are_loaded_by(driven, face, fits):
    """Patches at rest carry the loads of wheels: stiffness times depth, along the normals of the links.

    They carry some per mille more, because the normals of the rim fan out.
    """
    with Log(driven) as log:
        run, start = RunData(log), Window(-1.0, 1e-6)
        bodies, vehicle = Bodies(run, EVERY, window=start), run.scene["vehicle"]
        poses, contacts = next(bodies.blocks()), patches.of(run, window=start)
        links, pairs = poses.links["left_track"], []
        for wheel in bodies.wheels:
            if wheel.kind == "road_wheel":
                at = poses.wheels[wheel.name].position
                length, depth = patches.patch(links.pins, links.axes[..., 2], at, wheel.radius, face)
                share = length[0] * depth[0] * vehicle["contact"]["wheel"]["stiffness"] / vehicle["track"]["pitch"]
                force = run.vectors("left_track", "out", f"{wheel.name.partition('/')[2]}.force", window=start)[1][0]
                pairs.append((-(share @ links.axes[0, :, 2, 2]), force[2]))
                if fits:
                    assert contacts.length[0, contacts.wheels.index(wheel.name.replace("/", "."))] == length.sum()
    carried, load = np.transpose(pairs)
    assert len(load) == 5
    assert bool(np.all(np.abs(carried - load) <= 0.015 * np.abs(load))) == fits, pairs


def test_columns_of_a_sweep_may_be_of_links_by_wheel(driven):
    found, _ = figures_of_log(str(driven), wanted_figures(["links:wheel", "links"]))
    with Log(driven) as log:
        wheel, moment = (links.of(RunData(log), by=way).table().records()[-1] for way in ("wheel", "component"))
    assert found["links:wheel left_track.idler length, mm"] == wheel["length"]
    assert found["links left_track bending moment mean, N.m"] == moment["mean"]


# places on the circuit


def test_places_are_arc_lengths_from_the_crossing():
    """Places are arc lengths from the crossing: the pins of a square go round the same places."""
    corner = np.array([[1, 0], [1, -1], [0, -1], [-1, -1], [-1, 0], [-1, 1], [0, 1], [1, 1]], float)
    after = np.roll(corner, -1, axis=0)
    moved = np.array([corner + share * (after - corner) for share in (0.0, 0.25, 0.75)])
    middles, pins, length = circuit.places(moved, np.array([1.0, 0.0]))
    np.testing.assert_allclose(length, np.linalg.norm(np.roll(moved, -1, axis=1) - moved, axis=2).sum(axis=1))
    np.testing.assert_allclose(pins[0], np.arange(8.0))
    np.testing.assert_allclose(middles[0], np.arange(8.0) + 0.5)
    assert pins[1, 0] == pytest.approx(0.25)
    with pytest.raises(ValueError):  # noqa: PT011
        circuit.places(moved + 5.0, np.array([1.0, 0.0]))


def test_places_have_the_names_of_parts_of_the_circuit():
    """A stadium between a sprocket at the origin and an idler 3 m behind it, both of half a metre."""
    along = np.linspace(0.0, 6.0 + np.pi, 200, endpoint=False) + 0.02
    lower, upper = ((along > at) & (along < at + 3) for at in (np.pi / 4, 3 * np.pi / 4 + 3))
    angle = np.where(along < np.pi, along, along - 6.0) * 2.0  # of the rims, from straight ahead downwards
    rear = (along >= np.pi / 4 + 3) & (along <= 3 * np.pi / 4 + 3)
    angle = np.where(rear, (along - 3.0) * 2.0, angle)
    middle = np.stack([0.5 * np.cos(angle) - 3.0 * rear, -0.5 * np.sin(angle)], axis=1)
    middle[lower] = np.stack([np.pi / 4 - along[lower], np.full(lower.sum(), -0.5)], axis=1)
    middle[upper] = np.stack([along[upper] - 3 * np.pi / 4 - 6.0, np.full(upper.sum(), 0.5)], axis=1)
    vehicle = {"track": {"pitch": 2 * 0.5 * np.sin(np.pi / 10), "face": 0.0}, "sprocket": {"teeth": 10}}
    parts = circuit.stretches({"vehicle": {**vehicle, "idler": {"radius": 0.5}}}, along, middle)
    assert [one.name for one in parts] == ["sprocket", "lower run", "idler", "upper run", "sprocket"]
    near = np.sqrt((0.5 + circuit.NEAR) ** 2 - 0.25)  # of the straight part, still beside the rim
    ends = [np.pi / 4 + near, np.pi / 4 + 3 - near, 3 * np.pi / 4 + 3 + near, 3 * np.pi / 4 + 6 - near]
    np.testing.assert_allclose([one.end for one in parts[:-1]], ends, atol=1.5 * (along[1] - along[0]))
    assert circuit.part(2.0, parts) == "lower run"
    assert circuit.part(-1.0, parts) == ""
    assert circuit.stretches({}, along, middle) == []
    rear_drive = {"assembly": "vehicle", "vehicle": {**vehicle, "idler": {"radius": 0.5, "x": 3.0}}}
    assert circuit.stretches(rear_drive, along, middle * [-1.0, 1.0]) == parts


TRIANGLE = {  # a sprocket above two idlers, one of them raised, and two road wheels on the ground
    "sprocket": {"teeth": 10}, "track": {"pitch": 0.6 * np.sin(np.pi / 10), "face": 0.0},
    "idler": {"x": 1.5, "z": -1.0, "radius": 0.3}, "wheel": {"rear": {"x": -1.2, "z": -0.9, "radius": 0.3}},
    "road_wheel": {"x": [0.6, -0.4], "z": -1.2, "radius": 0.1},
}  # fmt: skip


def round_the_triangle():
    """Places (n,) m and middles (n, 2) m, from the top of the sprocket on, of a belt round TRIANGLE."""
    centres = np.array([[0.0, 0.0], [1.5, -1.0], [0.6, -1.2], [-0.4, -1.2], [-1.2, -0.9]])
    radii = np.array([0.3, 0.3, 0.1, 0.1, 0.3])
    angle = np.linspace(0.0, 2 * np.pi, 20000)
    points = (centres[:, None] + radii[:, None, None] * np.stack([np.sin(angle), np.cos(angle)], axis=1)).reshape(-1, 2)
    corners = points[ConvexHull(points).vertices[::-1]]
    corners = np.roll(corners, -np.hypot(corners[:, 0], corners[:, 1] - 0.3).argmin(), axis=0)
    sides = np.append(0.0, np.linalg.norm(np.diff(corners, axis=0), axis=1).cumsum())
    place = np.linspace(0.0, sides[-1], 2000)
    return place, np.stack([np.interp(place, sides, each) for each in corners.T], axis=1)


def test_parts_between_further_wheels_have_the_names_of_both():
    """A straight part is as long as the way of its ends' centres, of equal wheels, less what is near either rim."""
    place, middle = round_the_triangle()
    parts = circuit.stretches({"assembly": "vehicle", "vehicle": TRIANGLE}, place, middle)
    assert [one.name for one in parts] == [
        "sprocket", "sprocket to idler", "idler", "ground run", "road_wheel[2] to rear", "rear", "rear to sprocket",
        "sprocket",
    ]  # fmt: skip
    near = np.sqrt((0.3 + min(circuit.NEAR, circuit.NEAR_SHORT * TRIANGLE["track"]["pitch"])) ** 2 - 0.3**2)
    length = {one.name: one.end - one.start for one in parts}
    for name, ends in (("sprocket to idler", (1.5, 1.0)), ("rear to sprocket", (1.2, 0.9))):
        assert length[name] == pytest.approx(np.hypot(*ends) - 2.0 * near, abs=2.0 * place[1])
    assert length["ground run"] == pytest.approx(1.9 - near, abs=2.0 * place[1])
    moved = {**TRIANGLE, "right": {"wheel": {"rear": {"x": -1.1}}}}  # the twins: another place; a side of its own
    for track, same in (("left_track", True), ("right_track", False)):
        others = circuit.stretches({"assembly": "vehicle", "vehicle": moved}, place, middle, track)
        assert (others == parts) == same
    above = {**TRIANGLE, "wheel": {}}  # its last road wheel ends the track
    names = [one.name for one in circuit.stretches({"assembly": "vehicle", "vehicle": above}, place, middle)]
    assert names[3:5] == ["ground run", "road_wheel[2] to sprocket"]
    short = next(one for one in parts if one.name == "road_wheel[2] to rear")  # on it is a single one of these links:
    links = slice(np.abs(place - short.middle).argmin() % 90, None, 90)
    coarse = circuit.stretches({"assembly": "vehicle", "vehicle": TRIANGLE}, place[links], middle[links])
    assert all(circuit.part(one, coarse) for one in place[links])
    assert circuit.part(short.middle, coarse) == short.name


def test_loads_are_of_all_wheels_on_the_ground_and_raised_ones_are_not_lifted(tmp_path):
    """An idler on the ground has its load, and is lifted for 0.3 s; a raised wheel without load at rest never is."""
    t = np.arange(1000) * STEP
    loads = {
        "road_wheel[1]": np.where((t < 0.2) | (t > 0.6), 0.0, 4e3), "road_wheel[2]": np.full_like(t, 8e3),
        "idler": np.where((t > 0.4995) & (t < 0.7995), 0.0, 6e3), "rear": np.full_like(t, 1e3),
    }  # fmt: skip
    names = [f"{wheel}.force.{axis}" for wheel in loads for axis in "xyz"]
    values = np.stack([t, *(load * (axis == "z") for load in loads.values() for axis in "xyz")], axis=1)
    topics = {"/left_track/out": [("travel", "m"), *((name, "N") for name in names)]}
    road = {"x": [0.6, -0.4], "z": [-1.1, -1.2], "radius": 0.1}
    idler = {**TRIANGLE["idler"], "x": -1.5, "z": -0.998}  # 2 mm over the last road wheel
    found = []
    for raised in (road, {**road, "z": -1.2}):  # the twin: the first wheel is on the ground
        scene = {"assembly": "vehicle", "vehicle": {**TRIANGLE, "road_wheel": raised, "idler": idler}}
        rows = {"/left_track/out": (t, values)}
        with Log(made(tmp_path / "w.mcap", topics, rows, scene, ("left_track",))) as log:
            run = RunData(log)
            found.append((wheel_loads.of(run), [event.component for event in events.of(run).of("lifted")]))
    for (result, lifted), share, first in zip(found, (np.nan, 0.6), ((), ("left_track.road_wheel[1]",)), strict=True):
        assert result.wheels == tuple(f"left_track.{name}" for name in ("road_wheel[1]", "road_wheel[2]", "idler"))
        np.testing.assert_allclose(result.mean, [1.6e3, 8e3, 4.2e3], rtol=3e-3)
        np.testing.assert_allclose(result.lifted, [share, 0.0, 0.3], atol=2e-3)
        assert lifted == ["left_track.idler", *first]
        assert result.table().title == "Load of wheels, up in the hull"


def test_an_envelope_shows_what_links_feel_where_they_are(tmp_path):
    """An envelope shows tension by place: on a polygon that turns, every place has one value."""
    n, t = 40, np.arange(50) * STEP
    angle = -2 * np.pi * (np.arange(n)[None] / n + 3.1 * t[:, None])  # in the numbering of the links
    pins = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=2)
    middle = np.angle(np.exp(1j * (angle - np.pi / n))) % (2 * np.pi)
    names = [f"link[{i + 1}].tension" for i in range(n)]
    names += [f"joint[{i + 1}].position.{axis}" for i in range(n) for axis in "xyz"]
    values = np.hstack([1e4 + 1e3 * np.cos(middle), pins.reshape(50, -1)])
    topics = {"/track/links": [(name, "N") for name in names], "/track/out": [("travel", "m")]}
    scene = {"start": {"position": [0.0, 0.0, 0.0], "heading": 0.0}}
    rows = {"/track/links": (t, values), "/track/out": (t, t[:, None])}
    with Log(made(tmp_path / "e.mcap", topics, rows, scene)) as log:
        tension_envelope = envelope.of(RunData(log), bins=20)
    expected = 1e4 + 1e3 * np.cos(2 * np.pi * (np.arange(20) + 0.5) / 20)
    half = 1e3 * np.pi / 20  # half a bin's width
    for each in (tension_envelope.least, tension_envelope.most):
        assert np.abs(each - expected).max() < 1.05 * half
    np.testing.assert_allclose(tension_envelope.mean, expected, atol=0.3 * half)
    np.testing.assert_allclose(np.hypot(tension_envelope.forward, tension_envelope.up), 1.0, atol=0.03)
    assert np.argmax(tension_envelope.mean) in (0, 19)


def test_the_shares_of_damage_of_a_vehicle_sum_to_all(driven):
    """Shares by part of a short run of a vehicle, in all the parts of its circuit."""
    with Log(driven) as log:
        rows = life.of(RunData(log), by="place").table().records()
    assert {row["part"] for row in rows} == {"sprocket", "front run", "ground run", "rear run", "idler", "upper run"}
    assert [sum(row[name] for row in rows) for name in life.DETAILS] == pytest.approx([100.0] * 3, rel=1e-12)


# events


def test_events_come_in_order_with_what_they_are_of(tmp_path):
    t = np.arange(1000) * STEP
    load = np.full((1000, 2), 1e4)
    load[300:400, 1] = 0.0
    load[340, 1] = 300.0  # neither lifted nor down
    speed = np.where(t < 0.6, 2 * np.pi, np.where(t < 0.8, 0.05, 3.0))
    angle = np.cumsum(speed) * STEP
    brake = np.cumsum((t > 0.55) * (t < 0.7)) * 1.0
    force = np.zeros((1000, 2, 3))
    force[..., 2] = load
    topics = {
        "/track/out": [("travel", "m"), *((f"road_wheel[{i}].force.{axis}", "N") for i in (1, 2) for axis in "xyz")],
        "/drive/out": [("speed", "rad/s"), ("angle", "rad"), ("energy.dissipated", "J")],
        "/stats/track": [("solver.rejected", "1")],
    }
    rows = {
        "/track/out": (t, np.hstack([t[:, None], force.reshape(1000, 6)])),
        "/drive/out": (t, np.stack([speed, angle, brake], axis=1)),
        "/stats/track": (t[::100], np.array([0, 0, 0, 0, 0, 0, 0, 0, 0, 2.0])[:, None]),
    }
    joint = ["sprocket.force.x", "sprocket.torque.x"]
    connection = {"source": "track", "outputs": joint, "target": "drive", "inputs": joint}
    warning = {"component": "track", "text": "it slips", "time": 0.5, "count": 3}
    scene = {"vehicle": {"sprocket": {"teeth": 10}}}
    path = made(tmp_path / "e.mcap", topics, rows, scene, ("track", "drive"), [connection], warnings=[warning])
    with Log(path) as log:
        record = events.of(RunData(log))
        every = events.of(RunData(log), teeth=True)
        late = events.of(RunData(log), Window(0.65, 1.0))
    assert [(event.kind, event.component, round(event.t, 6)) for event in record.events] == [
        ("lifted", "track.road_wheel[2]", 0.3), ("touches", "track.road_wheel[2]", 0.4), ("warning", "track", 0.5),
        ("locked", "drive", 0.6), ("released", "drive", 0.8), ("step", "track", 0.9),
    ]  # fmt: skip
    assert record.events[2].text == "it slips, 3 times"
    assert "2 times" in record.events[-1].text
    teeth = [event.t for event in every.of("tooth")]
    assert len(teeth) == record.teeth["drive"] == int(angle[-1] * 10 / (2 * np.pi))
    np.testing.assert_allclose(np.diff(teeth[:5]), 0.1, rtol=1e-6)
    assert {event.text for event in every.of("tooth")} == {"a tooth ahead"}
    of_window = [("locked", 0.65), ("released", 0.8), ("step", 0.9)]  # it was at rest already
    assert [(event.kind, round(event.t, 6)) for event in late.events] == of_window


def test_a_log_ends_with_its_events_in_messages_of_foxglove(driven):
    with driven.open("rb") as file:
        messages = [
            (schema.name, message.log_time, json.loads(message.data))
            for schema, _, message in make_reader(file).iter_messages(topics=["/events"])
        ]
    with Log(driven) as log:
        run = RunData(log)
        happened, angle = events.of(run, teeth=True).events, run.signal("left_drive.angle")[1]
        teeth = run.scene["vehicle"]["sprocket"]["teeth"]
        assert log.others == {"/events": "foxglove.Log, json"}
    assert {name for name, _, _ in messages} == {"foxglove.Log"}
    shown = [(said["name"], said["kind"], said["message"], said["level"] == 3) for _, _, said in messages]
    assert shown == [(e.component, e.kind, e.text, e.kind in WARNINGS) for e in happened]
    for (_, time, said), event in zip(messages, happened, strict=True):
        assert time == 1_000_000_000 * said["timestamp"]["sec"] + said["timestamp"]["nsec"] == round(1e9 * event.t)
    passed = np.floor(angle * teeth / (2.0 * np.pi))
    assert sum(said["kind"] == "tooth" for _, _, said in messages) == np.abs(np.diff(passed)).sum()
