"""Commands take effect late by whole control periods, and so do measurements."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from usm_gym import Conditions, Scenario, suite
from usm_gym.simulation import Simulation
from usm_gym.task.modes import AnyScenario

STEPS = 40
Start = list[AnyScenario]


@pytest.fixture(params=["operation", "operation3d"])
def start(request: pytest.FixtureRequest) -> Start:
    return [replace(scenario, settle_time=0.0) for scenario in suite(request.param)[:3]]


def delayed(scenario: AnyScenario, **delays: int) -> AnyScenario:
    return replace(scenario, conditions=replace(scenario.conditions, **delays))


def actions(start: Start, steps: int = STEPS, robots: int = 3) -> NDArray[np.float32]:
    shape = steps, robots, len(start[0].body.thrusters)
    return np.random.default_rng(0).uniform(-1.0, 1.0, shape).astype(np.float32)


def positions(simulation: Simulation, given: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the positions after every step, (steps, robots, axes)."""
    path = []
    for action in given:
        simulation.step(action)
        path.append(simulation.read("position"))
    return np.array(path)


def test_a_late_command_does_what_it_would_have_done_then(start: Start) -> None:
    given, waits = actions(start), (0, 1, 4)
    late = Simulation([delayed(s, action_delay=d) for s, d in zip(start, waits, strict=True)])
    shifted = np.zeros_like(given)
    for robot, wait in enumerate(waits):
        shifted[wait:, robot] = given[: STEPS - wait, robot]
    np.testing.assert_array_equal(positions(late, given), positions(Simulation(start), shifted))


def test_the_command_in_effect_is_observed(start: Start) -> None:
    simulation = Simulation([delayed(start[0], action_delay=2)])
    place = simulation.layout.slices["thruster_command"]
    given = actions(start, 5, 1)
    seen = []
    for action in given:
        simulation.step(action)
        seen.append(simulation.observation[0, place].copy())
    np.testing.assert_array_equal(seen[:2], np.zeros_like(given[:2, 0]))
    np.testing.assert_allclose(seen[2:], given[:3, 0], rtol=1e-6)


def test_snapshots_hold_what_is_under_way(start: Start) -> None:
    scenarios = [delayed(s, action_delay=3, position_delay=2) for s in start]
    simulation, given = Simulation(scenarios), actions(start)
    positions(simulation, given[:10])
    taken = simulation.snapshot()
    after = positions(simulation, given[10:]), simulation.observation.copy()
    other = Simulation(start)  # which has kept nothing so far
    for copy in (simulation, other):
        copy.restore(taken)
        again = positions(copy, given[10:]), copy.observation
        np.testing.assert_array_equal(again[0], after[0])
        np.testing.assert_array_equal(again[1], after[1])


def test_a_robot_that_waits_longer_changes_nothing_for_the_others(start: Start) -> None:
    scenarios = [delayed(s, action_delay=2, position_delay=2) for s in start]
    given, alone, joined = actions(start), Simulation(scenarios), Simulation(scenarios)
    for k, action in enumerate(given):
        if k == 7:
            joined.start(1, delayed(start[1], action_delay=5, position_delay=9))
        alone.step(action)
        joined.step(action)
        for robot in (0, 2):
            np.testing.assert_array_equal(joined.observation[robot], alone.observation[robot])


@pytest.mark.parametrize("field", ["action_delay", "position_delay", "velocity_delay"])
@pytest.mark.parametrize("value", [-1, 101, 0.5, 2.0, True, "1", None])
def test_delays_are_whole_periods(field: str, value: object) -> None:
    with pytest.raises(ValueError, match=field):
        Conditions(**{field: value})
    assert getattr(Scenario(conditions=Conditions(**{field: 3})).nominal, field) == 3
