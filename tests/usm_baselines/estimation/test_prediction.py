"""With the nominal plant for a plant, the predictor foresees it; in `mpc` that is worth a lot."""

import dataclasses
from typing import Any

import numpy as np
import pytest
import usm_baselines
from usm_baselines.estimation.prediction import Predictor
from usm_baselines.signals import Signals

from tests.support.signals import made_signals
from usm_gym import Robot, Scenario, evaluate
from usm_gym.simulation import Simulation
from usm_gym.task.conditions import PRESETS, SPATIAL_PRESETS
from usm_gym.task.sampling import named
from usm_gym.task.spatial_scenario import Scan, SpatialScenario
from usm_gym.world import world_of

ROBOT = Robot()
# Nothing unknown but the start: nominal water at rest, no noise, thrusters with their lag.
KNOWN = dataclasses.replace(PRESETS["ideal"], thruster_time_constant=0.05, thruster_limit=20.0)


def scenario(**changes: Any) -> Scenario:
    known = named("nominal", "operation", KNOWN)
    motion = dataclasses.replace(known.inspection, times=(1.0, 2.0, 9.0), filter_frequency=9.0)
    return dataclasses.replace(known, inspection=motion, duration=4.0, settle_time=0.5, **changes)


def in_space() -> SpatialScenario:
    known = dataclasses.replace(SPATIAL_PRESETS["ideal"], thruster_time_constant=0.1)
    scan = Scan(times=(1.0, 2.5), pans=(0.5, -0.5), tilts=(0.6, -0.6))
    return SpatialScenario(conditions=known, scan=scan, duration=4.0, settle_time=0.5)


def signals(simulation: Simulation, started: bool) -> Signals:
    """Return what a predictor looks at."""
    nothing, seen = np.zeros((1, 2)), simulation.observation.copy()
    begun = np.array([float(started)])
    return made_signals(begun, nothing, nothing, nothing, nothing, observation=seen)


def test_the_nominal_plant_is_foreseen() -> None:
    """Commands that are held, joints in full motion: where it goes and where it is said to go."""
    nominal = scenario().nominal
    predictor = Predictor(nominal, 1e-2, 0.1)
    state = np.zeros((1, predictor.size))
    simulation = Simulation([scenario()])
    rng = np.random.default_rng(0)
    action = np.zeros((1, 5), np.float32)
    for k in range(86):
        predictor.estimate(signals(simulation, k > 0), state)
        if k < 80:
            action = rng.uniform(-0.3, 0.3, (1, 5)).astype(np.float32)
        if k < 85:
            simulation.step(action)
    start, path = simulation.error.copy(), []
    ahead = predictor.foresee(signals(simulation, True), state, 5)
    for _ in range(5):
        simulation.step(action)
        path.append(simulation.error.copy())
    moved = np.array(path) - start
    # 4 ms steps there, 1 ms steps here.
    np.testing.assert_allclose(ahead[..., 0] - start, moved, atol=0.03 * np.abs(moved).max())
    np.testing.assert_allclose(state[0, [0, 3]], start[0], atol=0.03 * np.abs(moved).max())
    assert np.abs(moved).max() > 1e-4


@pytest.mark.parametrize(
    ("episode", "weight"), [(scenario(), 5e-5), (in_space(), 5e-6)], ids=["plane", "space"]
)
def test_joint_motion_that_is_foreseen_disturbs_little(episode: Any, weight: float) -> None:
    """Noise of the laws' filters as in field, so that their gains are the same."""
    nominal = dataclasses.replace(episode.nominal, position_noise=5e-5)
    worst = {}
    for id in ("lqg", "lqg-joints", "mpc"):
        gains = {"disturbance_noise": 0.1, "variation_weight": weight}
        scores = evaluate(usm_baselines.make(id, nominal, **gains), [episode]).per_episode
        axes = world_of(episode.body).axes
        worst[id] = np.array([scores[f"max_error_{axis}"][0] for axis in axes])
    assert (worst["lqg-joints"] < 0.35 * worst["lqg"]).all()
    assert (worst["mpc"] < 0.35 * worst["lqg"]).all()
