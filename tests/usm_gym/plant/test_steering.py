"""Joints that a policy moves: their references, and the limits that these keep within."""

from typing import Any

import numpy as np
import pytest

from usm_gym import HeadPath, HeadScenario, SpatialHeadScenario
from usm_gym.simulation import Simulation
from usm_gym.task.head_sampling import nominal_head
from usm_gym.task.modes import AnyHeadMode

KINDS: dict[AnyHeadMode, Any] = {"head": HeadScenario, "head3d": SpatialHeadScenario}
LIMIT, FURTHEST, LAG = 0.5, 1.2, 0.1


def straight(mode: AnyHeadMode, robots: int = 1) -> Simulation:
    """Robots that are straight and at rest, whose heads have to stay where they are."""
    at = KINDS[mode](path=HeadPath(centre=(0.0, 0.0, 0.0))).start
    episode = KINDS[mode](path=HeadPath(centre=tuple(at.tolist())), duration=20.0)
    return Simulation([episode] * robots)


@pytest.mark.parametrize("mode", KINDS)
def test_a_reference_is_the_commanded_angle_behind_a_lag(mode: AnyHeadMode) -> None:
    simulation = straight(mode)
    action = np.zeros((1, simulation.world.actions), np.float32)
    action[0, simulation.world.thrusters] = 0.4  # the joint nearest to the tail
    for _ in range(100):
        simulation.step(action)
    rate, time = 0.4 * LIMIT, 2.0
    decay = np.exp(-time / LAG)
    references, rates = (
        simulation.read(name)[0] for name in ("joint_references", "joint_reference_rates")
    )
    assert references[0] == pytest.approx(rate * (time - LAG * (1.0 - decay)), rel=1e-7)
    assert rates[0] == pytest.approx(rate * (1.0 - decay), rel=1e-7)
    assert not references[1:].any()


@pytest.mark.parametrize("mode", KINDS)
def test_rates_and_angles_keep_within_their_limits(mode: AnyHeadMode) -> None:
    simulation, rng = straight(mode, robots=9), np.random.default_rng(0)
    action = rng.uniform(-3.0, 3.0, (9, simulation.world.actions)).astype(np.float32)
    action[:, : simulation.world.thrusters] = 0.0
    action[0] = np.inf
    largest = 0.0
    for k in range(300):
        if k % 150 == 149:
            action = -action
        simulation.step(action)
        angles = simulation.read("joint_references")
        largest = max(largest, float(np.abs(angles).max()))
        assert np.abs(simulation.read("joint_reference_rates")).max() <= LIMIT + 1e-12
        assert np.abs(angles).max() <= FURTHEST + 1e-12
    assert largest > 0.99 * FURTHEST


@pytest.mark.parametrize("mode", KINDS)
def test_a_robot_whose_joints_are_held_is_the_one_of_the_station(mode: AnyHeadMode) -> None:
    head = straight(mode)
    body = Simulation([head.scenarios[0].station])
    rng, thrusters = np.random.default_rng(1), head.world.thrusters
    for _ in range(100):
        action = np.zeros((1, head.world.actions), np.float32)
        action[0, :thrusters] = rng.uniform(-1.0, 1.0, thrusters)
        head.step(action)
        body.step(action[:, :thrusters])
    for name in ("position", "velocity", "acceleration"):
        assert (head.read(name) == body.read(name)).all()
    seen = body.observation.shape[1]
    assert (head.observation[:, :seen] == body.observation).all()


@pytest.mark.parametrize("mode", KINDS)
def test_one_robot_has_the_bits_of_many(mode: AnyHeadMode) -> None:
    episodes = [nominal_head(mode)] * 9
    many, one = Simulation(episodes), Simulation(episodes[:1])
    rng = np.random.default_rng(2)
    for _ in range(60):
        action = rng.uniform(-1.0, 1.0, (9, many.world.actions)).astype(np.float32)
        many.step(action)
        one.step(action[:1])
    assert (many.observation[:1] == one.observation).all()
    assert (many.error[:1] == one.error).all()
