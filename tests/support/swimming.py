"""Robots, random states and accurate free runs that the plant tests share."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import usm_gym
from usm_gym import Robot, Thruster

Array = NDArray[np.float64]


class State(NamedTuple):
    """Everything the accelerations depend on, in the order of `usm_gym.accelerations`."""

    theta: Array  # (n,) rad
    theta_dot: Array  # (n,) rad/s
    p_dot: Array  # (2,) m/s
    joint_torques: Array  # (n - 1,) N m
    thruster_forces: Array  # (thrusters,) N
    current: Array  # (2,) m/s

    def coasting(self) -> "State":
        """Return this state without joint torque and thrust."""
        return self._replace(
            joint_torques=0.0 * self.joint_torques, thruster_forces=0.0 * self.thruster_forces
        )


class Motion(NamedTuple):
    """A run sampled in time, p starting at the origin."""

    time: Array  # (T,) s
    theta: Array  # (T, n) rad
    p: Array  # (T, 2) m
    theta_dot: Array  # (T, n) rad/s
    p_dot: Array  # (T, 2) m/s


def swimmer(links: int) -> Robot:
    """Return the paper's robot, or one of another length with just enough thrusters."""
    if links == 16:
        return Robot()
    middle = (links + 1) // 2
    return Robot(
        links=links,
        thrusters=(Thruster(middle, "axial"), Thruster(1, "normal"), Thruster(links, "normal")),
    )


def without_drag(robot: Robot) -> Robot:
    """Return the robot in a fluid that has inertia only."""
    return replace(robot, drag_coefficient=0.0, friction_coefficient=0.0)


def random_state(robot: Robot, rng: np.random.Generator) -> State:
    """Draw a state of any shape and heading, with every input and a current."""
    n = robot.links
    return State(
        theta=rng.uniform(-10.0, 10.0, n),
        theta_dot=rng.normal(0.0, 2.0, n),
        p_dot=rng.normal(0.0, 1.0, 2),
        joint_torques=rng.normal(0.0, 5.0, n - 1),
        thruster_forces=rng.normal(0.0, 10.0, len(robot.thrusters)),
        current=rng.normal(0.0, 0.5, 2),
    )


def relative_difference(actual: tuple[Array, Array], expected: tuple[Array, Array]) -> float:
    """Return the larger of max|a - b| / max|b| over theta_ddot and the same over p_ddot."""
    # Separately, because angular accelerations are so large that they would hide p_ddot.
    return max(
        float(np.max(np.abs(a - b)) / np.max(np.abs(b)))
        for a, b in zip(actual, expected, strict=True)
    )


def swim(robot: Robot, state: State, duration: float, **forms: str) -> Motion:
    """Integrate the plant under constant inputs, so closely that only its own errors show."""
    n = robot.links

    def derivative(_: float, y: Array) -> Array:
        theta, theta_dot, p_dot = y[:n], y[n + 2 : -2], y[-2:]
        theta_ddot, p_ddot = usm_gym.accelerations(
            robot, theta, theta_dot, p_dot, *state[3:], **forms
        )
        return np.concatenate([theta_dot, p_dot, theta_ddot, p_ddot])

    def headroom(_: float, y: Array) -> float:
        return 1e3 - float(np.max(np.abs(y[n + 2 :])))

    headroom.terminal = True  # type: ignore[attr-defined]  # a faulty plant shall fail, not hang
    start = np.concatenate([state.theta, np.zeros(2), state.theta_dot, state.p_dot])
    time = np.linspace(0.0, duration, 101)
    solution = solve_ivp(
        derivative,
        (0.0, duration),
        start,
        method="DOP853",
        t_eval=time,
        events=headroom,
        rtol=1e-12,
        atol=1e-12,
    )
    assert solution.status == 0, solution.message
    y = solution.y.T
    return Motion(time, y[:, :n], y[:, n : n + 2], y[:, n + 2 : -2], y[:, -2:])
