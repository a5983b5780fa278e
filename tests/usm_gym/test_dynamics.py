"""Accelerations of many states at once are those of each alone; bad arguments are refused."""

import numpy as np
import pytest

import usm_gym
from usm_gym import Robot, dynamics

ROBOT = Robot()
SIZES = {"theta": 16, "theta_dot": 16, "p_dot": 2, "joint_torques": 15, "thruster_forces": 5}


def drawn(*batch):
    """Arguments with leading axes; the current, which has a default, among them."""
    rng = np.random.default_rng(0)
    return {name: rng.normal(0.0, 3.0, (*batch, n)) for name, n in {**SIZES, "current": 2}.items()}


@pytest.mark.parametrize("hydrodynamics", dynamics.HYDRODYNAMICS)
def test_each_state_of_a_batch_has_the_bits_that_it_has_alone(hydrodynamics):
    many = dynamics.CHUNK
    states = drawn(2, many)
    theta_ddot, p_ddot = usm_gym.accelerations(ROBOT, **states, hydrodynamics=hydrodynamics)
    assert theta_ddot.shape == (2, many, 16)
    assert p_ddot.shape == (2, many, 2)
    for index in ((0, 0), (0, 1), (0, many - 1), (1, 0), (1, many - 1)):
        state = {name: array[index] for name, array in states.items()}
        alone = usm_gym.accelerations(ROBOT, **state, hydrodynamics=hydrodynamics)
        assert theta_ddot[index].tobytes() == alone[0].tobytes()
        assert p_ddot[index].tobytes() == alone[1].tobytes()


def test_leading_axes_broadcast():
    states = drawn()
    theta = drawn(4, 1)["theta"]
    forces = drawn(3)["thruster_forces"]
    several = {**states, "theta": theta, "thruster_forces": forces}
    theta_ddot, p_ddot = usm_gym.accelerations(ROBOT, **several)
    assert theta_ddot.shape == (4, 3, 16)
    assert p_ddot.shape == (4, 3, 2)
    one = {**states, "theta": theta[2, 0], "thruster_forces": forces[1]}
    assert (usm_gym.accelerations(ROBOT, **one)[0] == theta_ddot[2, 1]).all()
    nothing = usm_gym.accelerations(ROBOT, **{**states, "theta": np.zeros((0, 16))})
    assert [array.shape for array in nothing] == [(0, 16), (0, 2)]


def test_thrusters_of_one_link_add_up():
    robot = Robot(thrusters=(*ROBOT.thrusters, ROBOT.thrusters[1]))
    states = drawn(3)
    forces = states["thruster_forces"]
    twice = {**states, "thruster_forces": np.insert(forces, 5, 0.5 * forces[:, 1], axis=1)}
    states["thruster_forces"] = forces * [1.0, 1.5, 1.0, 1.0, 1.0]
    for shared, single in zip(
        usm_gym.accelerations(robot, **twice), usm_gym.accelerations(ROBOT, **states), strict=True
    ):
        np.testing.assert_allclose(shared, single, rtol=1e-9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"theta": np.zeros(15)},
            r"^theta is .*; allowed: an array of shape \(16,\) or \(..., 16\)$",
        ),
        ({"theta": np.zeros((16, 1))}, "^theta is"),
        ({"p_dot": 0.0}, "^p_dot is 0.0; allowed"),
        ({"theta_dot": np.full(16, np.nan)}, "theta_dot.*finite"),
        ({"joint_torques": np.zeros((2, 15)) + 1j}, "joint_torques.*real"),
        ({"current": ["fast", "slow"]}, "current.*real"),
        (
            {"theta": np.zeros((4, 16)), "p_dot": np.zeros((3, 2))},
            r"^the leading axes are {'p_dot': \(3,\), 'theta': \(4,\)}; allowed",
        ),
        ({"hydrodynamics": "none"}, "^hydrodynamics is 'none'"),
        ({"drag": "none"}, "^drag is 'none'"),
    ],
)
def test_bad_arguments_are_refused_in_one_line(changes, message):
    with pytest.raises(ValueError, match=message) as caught:
        usm_gym.accelerations(ROBOT, **{**drawn(), **changes})
    assert "\n" not in str(caught.value)
