"""Short episodes, for tests of what does not depend on their length."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usm_gym.evaluation import metric_names
from usm_gym.planar_world import PlanarWorld
from usm_gym.robot import Robot
from usm_gym.simulation import Simulation
from usm_gym.support.seeding import EVALUATION, stream
from usm_gym.task.conditions import FIELD, Conditions
from usm_gym.task.sampling import sample
from usm_gym.task.scenario import Scenario

METRICS = metric_names(PlanarWorld(Robot()))
# Harder than field in everything, with sensors that are as quick, so that no law loses the robot.
HARDER = Conditions(
    thruster_time_constant=0.1,
    thruster_limit=15.0,
    position_noise=2e-4,
    current_limit=0.1,
    current_variation=0.05,
    coefficient_range=(0.6, 1.5),
    deflection_range=(0.9, 2.1),
    filter_range=(8.0, 14.0),
)
# Every sensor errs, measures rarely or late, and yet `sta` loses no robot; fields of conditions.
NOISY = {
    "position_noise": 2e-4,
    "position_missing": 0.02,
    "velocity_period": 3,
    "velocity_delay": 2,
    "velocity_noise": 5e-3,
    "tail_angle_noise": 1e-3,
    "joint_angle_noise": 1e-3,
    "rate_noise": 1e-3,
    "thruster_dead_band": 0.1,
    "thruster_gain_range": [0.95, 1.05],
    "current_variation": 0.02,
    "wave_limit": 0.02,
    "coefficient_spread": 0.1,
}


def short(count: int, duration: float = 1.0, seed: int = 0) -> list[Scenario]:
    """Return drawn operation scenarios that are soon over; in the second half the joints move."""
    scenarios = [sample("operation", FIELD, stream(seed, EVALUATION, i)) for i in range(count)]
    return [
        replace(
            each,
            inspection=replace(each.inspection, times=(duration / 2,), deflections=(0.8,)),
            duration=duration,
            settle_time=0.2 * duration,
        )
        for each in scenarios
    ]


def seen_by(simulation: Simulation, robot: int = 0) -> dict[str, NDArray[Any]]:
    """Return what a robot observes, in SI units, by the names of the entries."""
    values = simulation.observation[robot] * simulation.layout.scale
    return {name: values[part] for name, part in simulation.layout.slices.items()}


def assert_fills(values: Any, low: float, high: float) -> None:
    """Assert that values lie between two bounds, evenly and up to both."""
    values = np.asarray(values, float)
    width = high - low
    assert low <= values.min() <= low + 0.02 * width
    assert high - 0.02 * width <= values.max() <= high
    quarters = np.histogram(values, 4, (low, high))[0] / values.size
    np.testing.assert_allclose(quarters, 0.25, atol=0.05)
