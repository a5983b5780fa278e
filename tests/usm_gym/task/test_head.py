"""What is asked of the head, where the head is, and how joints move it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import usm_gym
from usm_gym import HeadPath, HeadScenario, Robot, SpatialHeadScenario, Thruster
from usm_gym.simulation import Simulation
from usm_gym.spatial_posture import centre_of_mass, link_poses
from usm_gym.spatial_robot import EELY
from usm_gym.support.seeding import EVALUATION, stream
from usm_gym.task.conditions import PRESETS
from usm_gym.task.head_sampling import MISS, SHARE, nominal_head, posture_of
from usm_gym.task.modes import ALL_HEAD_MODES, AnyHeadMode, presets_of, read_scenario, sample_of

KINDS: dict[AnyHeadMode, Any] = {"head": HeadScenario, "head3d": SpatialHeadScenario}


def sampled(mode: AnyHeadMode, count: int, conditions: str = "field") -> list[Any]:
    preset = presets_of(mode)[conditions]
    return [sample_of(mode, preset, stream(3, EVALUATION, k)) for k in range(count)]


def planar_head(angles: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Head and its direction from the centre of mass, by the robot's own drawing of its links."""
    robot = Robot()
    theta = np.concatenate([[0.0], -np.cumsum(angles)])
    theta -= theta.mean()
    last = robot.link_centres(theta, np.zeros(2))[-1]
    tip = last + robot.half_length * np.array([np.cos(theta[-1]), np.sin(theta[-1])])
    return np.array([*tip, theta[-1]])


def spatial_head(angles: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    rotations, centres = link_poses(EELY, np.zeros(3), (1.0, 0.0, 0.0, 0.0), angles)
    tip = centres[-1] + rotations[-1] @ [EELY.lengths[-1] / 2, 0.0, 0.0]
    return np.asarray(tip - centre_of_mass(EELY, rotations, centres))


HEADS = {"head": planar_head, "head3d": spatial_head}


@pytest.mark.parametrize("mode", ALL_HEAD_MODES)
def test_the_head_starts_at_its_reference(mode: AnyHeadMode) -> None:
    for scenario in [nominal_head(mode), *sampled(mode, 5)]:
        start = HEADS[mode](np.array(scenario.posture))
        np.testing.assert_allclose(scenario.start, start, atol=1e-14)
        np.testing.assert_allclose(scenario.references()[0], start, atol=1e-14)
        simulation = Simulation([scenario])
        np.testing.assert_allclose(simulation.error, 0.0, atol=1e-14)
        np.testing.assert_allclose(simulation.attitude_error, 0.0, atol=1e-14)


@pytest.mark.parametrize("mode", ALL_HEAD_MODES)
def test_the_jacobian_is_the_derivative_of_the_head(mode: AnyHeadMode) -> None:
    for scenario in sampled(mode, 3, "ideal"):
        simulation, angles = Simulation([scenario]), np.array(scenario.posture)
        found = np.empty((1, 3, len(angles)))
        simulation.world.jacobians(simulation.observation, found)  # type: ignore[attr-defined]
        step = 1e-6
        for joint in range(len(angles)):
            moved = step * (np.arange(len(angles)) == joint)
            slope = (HEADS[mode](angles + moved) - HEADS[mode](angles - moved)) / (2.0 * step)
            # The angles are observed as float32.
            np.testing.assert_allclose(found[0, :, joint], slope, atol=2e-6)


@pytest.mark.parametrize("mode", ALL_HEAD_MODES)
def test_velocity_and_acceleration_are_derivatives_of_the_reference(mode: AnyHeadMode) -> None:
    simulation = Simulation(sampled(mode, 1))
    layout, axes = simulation.layout, len(simulation.world.axes)
    still = np.zeros((1, simulation.world.actions), np.float32)
    names = ("head_reference", "head_reference_velocity", "head_reference_acceleration")
    seen = []
    for _ in range(500):  # the approach, and what follows
        simulation.step(still)
        values = simulation.observation[0] * layout.scale
        seen.append([values[layout.slices[name]] for name in names])
    position, velocity, acceleration = np.array(seen).swapaxes(0, 1)
    assert position.shape == (500, axes)
    np.testing.assert_allclose(np.gradient(position, 0.02, axis=0)[1:-1], velocity[1:-1], atol=2e-4)
    slope = np.gradient(velocity, 0.02, axis=0)
    np.testing.assert_allclose(slope[1:-1], acceleration[1:-1], atol=1e-3)


@pytest.mark.parametrize("mode", ALL_HEAD_MODES)
def test_exact_sensors_see_the_true_error(mode: AnyHeadMode) -> None:
    exact = sampled(mode, 9, "ideal")
    simulation, rng = Simulation(exact), np.random.default_rng(0)
    layout = simulation.layout
    for _ in range(50):
        simulation.step(rng.uniform(-1.0, 1.0, (9, simulation.world.actions)).astype(np.float32))
    values = simulation.observation * layout.scale
    assert np.abs(simulation.error).max() > 1e-3
    np.testing.assert_allclose(values[:, layout.slices["head_error"]], simulation.error, atol=3e-7)
    if mode == "head":
        errors = (
            values[:, layout.slices["direction_error"]],
            values[:, layout.slices["heading_error"]],
        )
        np.testing.assert_allclose(np.hstack(errors), simulation.attitude_error, atol=2e-6)


def test_the_head_is_not_measured_better_than_what_it_follows_from() -> None:
    noisy = replace(PRESETS["field"], position_noise=0.01, current_limit=0.0)
    simulation = Simulation([nominal_head("head", noisy)])
    layout = simulation.layout
    off = simulation.observation[0] * layout.scale
    error = off[layout.slices["head_error"]]
    np.testing.assert_allclose(error, off[layout.slices["position_error"]], atol=1e-6)
    assert np.abs(error).max() > 1e-3


@pytest.mark.parametrize("mode", ALL_HEAD_MODES)
def test_what_is_drawn_can_be_followed(mode: AnyHeadMode) -> None:
    for scenario in sampled(mode, 60):
        demand, robot = scenario.demand, scenario.body
        assert demand.error <= MISS
        assert demand.rate <= SHARE * robot.joint_rate_limit
        assert demand.angle <= SHARE * robot.joint_angle_limit
        assert scenario.posture == tuple(posture_of(robot.robot).tolist())


@pytest.mark.parametrize("mode", ALL_HEAD_MODES)
def test_a_path_that_joints_cannot_follow_is_refused(mode: AnyHeadMode) -> None:
    nominal = nominal_head(mode)
    for path, said in (
        (replace(nominal.path, centre=(9.0, 0.0, 0.0)), "leaves the head behind by"),
        (replace(nominal.path, amplitudes=(0.1, 0.1, 0.1), frequencies=(3.5,) * 3), "asks joints"),
    ):
        with pytest.raises(ValueError, match=f"path is 'one that {said}.*can follow"):
            Simulation([replace(nominal, path=path)])
    with pytest.raises(ValueError, match="posture is"):
        Simulation([replace(nominal, posture=(0.1,))])
    with pytest.raises(ValueError, match=r"posture is .* up to 1\.2 rad"):
        Simulation([replace(nominal, posture=tuple(1.3 for _ in nominal.posture))])


@pytest.mark.parametrize("mode", ALL_HEAD_MODES)
@pytest.mark.parametrize("conditions", ["field", "basin"])
def test_scenarios_come_back_from_json(mode: AnyHeadMode, conditions: str) -> None:
    for scenario in sampled(mode, 3, conditions):
        assert read_scenario(scenario.to_dict()) == scenario


def test_the_suites_are_of_the_head() -> None:
    for name in ("head", "head-basin", "head3d", "head3d-basin"):
        episodes = usm_gym.suite(name)
        assert len(episodes) == 50
        assert {episode.mode for episode in episodes} == {name.removesuffix("-basin")}
        for episode in episodes:
            Simulation([episode])


def test_a_path_of_another_number_of_channels_is_refused() -> None:
    with pytest.raises(ValueError, match="centre"):
        HeadPath(centre=(0.0, 0.0))  # type: ignore[arg-type]


def test_a_robot_whose_joints_cannot_follow_is_refused() -> None:
    places = [(1, "axial"), (1, "normal"), (3, "normal")]
    thrusters = tuple(Thruster(link=link, direction=way) for link, way in places)  # type: ignore[arg-type]
    short = Robot(links=3, thrusters=thrusters)  # two joints, for a position and a direction
    with pytest.raises(ValueError, match=r"robot is .*one whose joints can lead its head"):
        sample_of("head", PRESETS["field"], stream(3, EVALUATION, 0), short)
