"""Our rainflow count beside two packages: the example of ASTM E1049-85, irregular histories, the force in a pin."""

import fatpack
import numpy as np
import pytest
import rainflow
from analysis_logs import driven_log

from orchestrator.log.reader import Log
from orchestrator.results.analyses import fatigue
from orchestrator.results.analyses.life import pin_forces
from orchestrator.results.run_data import EVER, RunData

driven = pytest.fixture(scope="module")(driven_log)
E1049 = np.array([-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0])
CLASSES = 1 << 20  # fatpack puts a record into classes of this number
RANDOM = {
    "white": np.random.default_rng(1).normal(size=3000),
    "wandering": np.cumsum(np.random.default_rng(2).normal(size=3000)),
    "many equal": np.round(np.random.default_rng(3).normal(size=500), 1),
    "of a circuit": 20.0 + 6.0 * np.sin(0.05 * np.arange(2000)) + np.random.default_rng(4).normal(size=2000),
}


def ours(values):
    """Damage of the repeated record, its residue closed, at a slope of 4."""
    return sum(n * size**4 for size, n in zip(*fatigue.rainflow_cycles(fatigue.closed(values)), strict=True))


def half(values):
    """The same with the residue as half cycles, by the package alone."""
    return sum(n * size**4 for size, _, n, _, _ in rainflow.extract_cycles(values.tolist()))


def without(values):
    """The same without the residue, by the other package."""
    cycles, _ = fatpack.find_rainflow_cycles(fatpack.find_reversals(values, k=CLASSES)[0])
    return float((np.abs(np.diff(cycles.reshape(-1, 2), axis=1)) ** 4).sum())


def test_what_is_done_with_the_residue_is_the_difference():
    """The figures of analyses.md#fatigue: a record of nine points, closed, as half cycles, counted twice, left out."""
    whole = ours(E1049)
    assert whole == 3.0**4 + 4.0**4 + 7.0**4 + 9.0**4, "5.4.5 of the standard"
    shares = [each / whole for each in (half(E1049), half(np.concatenate([E1049[:-1], E1049])), without(E1049))]
    assert [round(each, 2) for each in shares] == [0.91, 1.91, 0.03]
    assert [float(each) for each in sorted(fatpack.find_rainflow_ranges(E1049, k=CLASSES))] == pytest.approx(
        [3.0, 4.0, 7.0, 9.0], rel=1e-4
    )


def by_fatpack(values):
    """Ranges of the repeated record by fatpack, sorted.

    It begins and ends at the least value: between other ends fatpack 0.7.8 leaves out a peak (`findings/`).
    """
    first = int(values.argmin())
    return np.sort(fatpack.find_rainflow_ranges(np.concatenate([values[first:], values[: first + 1]]), k=CLASSES))


@pytest.mark.parametrize("name", RANDOM)
def test_a_repeated_record_is_counted_as_by_another_package(name):
    """Fatpack closes the residue by counting it twice over, we begin at the largest value: the same cycles."""
    values, theirs = RANDOM[name], by_fatpack(RANDOM[name])
    sizes, counts = fatigue.rainflow_cycles(fatigue.closed(values))
    assert counts.sum() == len(theirs)
    twice = np.sort(np.repeat(sizes, np.rint(2.0 * counts).astype(int)))  # the largest comes as two halves
    np.testing.assert_allclose(twice[::2], theirs, atol=3.0 * np.ptp(values) / CLASSES)
    assert not np.allclose(1.02 * twice[::2], theirs, atol=3.0 * np.ptp(values) / CLASSES)
    assert without(values) < half(values) < ours(values)


@pytest.mark.parametrize("name", RANDOM)
def test_the_peak_of_a_cycle_is_its_largest_value(name):
    """The places that cycles are booked at, in the closed record and in the record itself."""
    values = RANDOM[name]
    places = fatigue.closed_places(values)
    ranges, means, _, peaks = fatigue.cycles_with_peaks(values[places])
    np.testing.assert_allclose(values[places[peaks]], means + 0.5 * ranges, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(values[places], fatigue.closed(values))


def test_the_force_in_a_pin_is_counted_as_by_two_packages(driven):
    """A pin of a vehicle that drives off: closed as by fatpack; as half cycles as by rainflow."""
    with Log(driven) as log:
        forces = pin_forces(RunData(log), "left_track", EVER).force
    for force in forces.T[::8]:
        assert ours(force) == pytest.approx(float((by_fatpack(force) ** 4).sum()), rel=1e-4)
        sizes, counts = fatigue.rainflow_cycles(fatigue.turning_points(force))
        assert (counts * sizes**4).sum() == pytest.approx(half(force), rel=1e-12)
        assert half(force) < 0.999 * ours(force)
