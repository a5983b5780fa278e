"""What is foreseen of a robot is what the simulation of the same robot does, in either world."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from usm_baselines.estimation.foresight import CURRENT, Foresight, foresight_of

from tests.support.ball import BallScenario
from usm_gym import Scenario
from usm_gym.simulation import Simulation
from usm_gym.spatial_robot import EELY
from usm_gym.task.conditions import PRESETS, SPATIAL_PRESETS
from usm_gym.task.sampling import named
from usm_gym.task.spatial_scenario import Scan, SpatialScenario

Array = NDArray[np.float64]
PERIODS = 10
# Nothing unknown, every velocity measured, and the physics steps of a prediction.
KNOWN: dict[str, Any] = {"thruster_time_constant": 0.1, "velocity_period": 1, "physics_step": 4e-3}


def planar() -> Scenario:
    conditions = dataclasses.replace(PRESETS["ideal"], thruster_limit=20.0, **KNOWN)
    known = named("nominal", "operation", conditions)
    motion = dataclasses.replace(known.inspection, times=(1.0, 2.0, 9.0), filter_frequency=9.0)
    return dataclasses.replace(known, inspection=motion, duration=6.0)


def spatial() -> SpatialScenario:
    conditions = dataclasses.replace(SPATIAL_PRESETS["ideal"], thruster_limit=40.0, **KNOWN)
    scan = Scan(times=(1.0, 2.5), pans=(0.8, -0.8), tilts=(0.4, -0.3))
    # What the path jerks is not foreseen: it begins slowly.
    return SpatialScenario(conditions=conditions, scan=scan, duration=6.0)


WORLDS = {"plane": planar(), "space": spatial()}


def state_of(simulation: Simulation) -> Array:
    """The state of a predictor that knows all."""
    layout, seen = simulation.world.layout, simulation.observation
    value = {name: seen[:, at] * layout.scale[at] for name, at in layout.slices.items()}
    rate = value["velocity"] - value["reference_velocity"]
    estimates = np.stack([simulation.error, rate, 0.0 * rate], axis=2)
    return np.hstack([estimates.reshape(len(seen), -1), simulation.read("force")])


def believed(foresight: Foresight) -> Array:
    """The belief that a robot is the nominal one, in water at rest."""
    first = CURRENT + foresight.axes
    beliefs = np.ones((1, 1, first + foresight.thrusters + foresight.links))
    beliefs[..., CURRENT:first] = 0.0
    return beliefs


def foreseen(foresight: Foresight, simulation: Simulation, beliefs: Array) -> Array:
    """(error, rate) over the next periods, (periods, axes, 2)."""
    seen = simulation.observation.copy()
    blocks = foresight.placed(seen, state_of(simulation), seen, beliefs)
    ahead = np.empty((PERIODS, 1, 1, foresight.axes, 2))
    foresight.run(seen, blocks, ahead)
    return ahead[:, 0, 0]


@pytest.mark.parametrize("world", WORLDS)
def test_the_nominal_robot_is_foreseen(world: str) -> None:
    scenario: Any = WORLDS[world]
    simulation, rng = Simulation([scenario]), np.random.default_rng(0)
    foresight = foresight_of(scenario.body, scenario.nominal)
    thrusters = foresight.thrusters
    action = np.zeros((1, thrusters), np.float32)
    worst, moved = 0.0, 0.0
    for period in range(200):
        if period % 10 == 0:
            action = rng.uniform(-0.2, 0.2, (1, thrusters)).astype(np.float32)
            ahead, start = None, simulation.error[0].copy()
            if period > 100:
                # The commands in effect are those that are held.
                simulation.step(action)
                start = simulation.error[0].copy()
                ahead, path = foreseen(foresight, simulation, believed(foresight)), []
                for _ in range(PERIODS):
                    simulation.step(action)
                    path.append(simulation.error[0].copy())
                worst = max(worst, np.abs(ahead[..., 0] - path).max())
                moved = max(moved, np.abs(path - start).max())
        simulation.step(action)
    assert moved > 1e-3
    assert worst < 1e-6


def test_what_cannot_be_foreseen_is_refused() -> None:
    nominal = BallScenario().nominal
    with pytest.raises(ValueError, match=r"robot is Ball\(.*\); allowed: one whose motion"):
        foresight_of(nominal.robot, nominal)
    assert foresight_of(EELY, spatial().nominal).axes == 3
