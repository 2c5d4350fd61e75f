"""Mean, least and most of outputs over steps of unequal length, and of outputs that are means already."""

import numpy as np

from fmus.track.link_outputs import GROUPS
from orchestrator.cosim.observers import MEANS, IntervalStatistics

FORCE, TENSION = "joint[1].force.x", "link[1].tension"  # a mean since the last record; a value at the end of a step
STEPS = np.array([1.0, 3.0, 2.0]) * 1e-3  # s


def statistics(forces, tensions):
    """Statistics of three steps with these mean forces and these tensions at the end, one after the other."""
    means = np.cumsum(STEPS * forces) / np.cumsum(STEPS)  # an FMU gives the mean since the last record
    accumulator = IntervalStatistics([FORCE, TENSION])
    for mean, tension, h in zip(means, tensions, STEPS, strict=True):
        accumulator.add(np.array([mean, tension]), h)
    return accumulator


def test_mean_least_and_most_of_unequal_steps():
    forces, tensions = np.array([4.0, -2.0, 7.0]), np.array([1.0, 5.0, 3.0])
    expected = [STEPS @ forces / STEPS.sum(), STEPS @ tensions / STEPS.sum(), -2.0, 1.0, 7.0, 5.0]
    accumulator = statistics(forces, tensions)
    np.testing.assert_allclose(accumulator.pop(), expected, rtol=1e-12)
    accumulator.add(np.array([-9.0, 0.5]), 2e-3)
    np.testing.assert_allclose(accumulator.pop(), [-9.0, 0.5] * 3, err_msg="pop begins anew", rtol=1e-12)


def test_outputs_that_are_means_are_known_by_their_names():
    for group in GROUPS.values():
        name = f"{group.owner}[12].{group.signal}{'.' * bool(group.parts[0])}{group.parts[0]}"
        assert bool(MEANS.fullmatch(name)) == ("mean over the interval" in group.text), name
