"""The sampled model is the continuous one, and the filter's covariance is what happens."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import spatial_oracle
from support.spatial_swimming import UNEVEN_EELY, at_rest, random_chain
from usm_baselines.estimation import kalman
from usm_baselines.estimation.kalman import sampled

import usm_gym
from usm_gym import Robot
from usm_gym.spatial_robot import EELY, EELY_NEUTRAL, SpatialRobot
from usm_gym.task.nominal import Nominal
from usm_gym.world import world_of

H = 0.02
NOMINAL = Nominal(Robot(), H, 0.05, 5e-5)
IN_SPACE = Nominal(EELY, H, 0.1, 5e-5)


def test_the_straight_body_is_that_of_the_model_page() -> None:
    inertia, drag = world_of(Robot()).straight_body
    np.testing.assert_allclose(inertia, [10.555, 16.889], rtol=1e-4)
    np.testing.assert_allclose(drag, [4.22, 134.4], rtol=1e-3)


@pytest.mark.parametrize("robot", [EELY, UNEVEN_EELY, random_chain(4)])
def test_the_straight_body_in_space_has_the_impulse_and_the_drag_of_its_links(
    robot: SpatialRobot,
) -> None:
    level, still, speed = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(len(robot.links) - 1), 1e-7
    inertia, drag = world_of(robot).straight_body
    for axis, velocity in enumerate(speed * np.eye(3)):
        moving = spatial_oracle.impulse(
            robot, level, np.zeros(3), velocity, still, still, np.zeros(3)
        )
        assert moving[axis] == pytest.approx(inertia[axis] * speed, rel=1e-12)
        links = np.tile(np.append(velocity, np.zeros(3)), (len(robot.links), 1))
        against = spatial_oracle.drag(robot, links, 5)[:, axis].sum()
        assert -against == pytest.approx(drag[axis] * speed, rel=1e-5)


@pytest.mark.parametrize("axis", range(3))
def test_the_plant_slows_down_as_the_straight_body_does(axis: int) -> None:
    # Without a keel, and as even as this one, it stays straight and level.
    inertia, drag = world_of(EELY_NEUTRAL).straight_body
    state = at_rest(EELY_NEUTRAL)._replace(linear_velocity=1e-7 * np.eye(3)[axis])
    slowing, turning, bending = usm_gym.spatial_accelerations(EELY_NEUTRAL, *state)
    expected = -1e-7 * np.eye(3)[axis] * drag[axis] / inertia[axis]
    np.testing.assert_allclose(slowing, expected, rtol=1e-5, atol=1e-15)
    assert np.abs(np.append(turning, bending)).max() < 1e-5 * np.abs(expected).max()


@pytest.mark.parametrize("nominal", [NOMINAL, IN_SPACE])
def test_the_gain_of_every_axis_is_where_the_filter_settles(nominal: Nominal) -> None:
    acceleration, disturbance = 0.01, 0.5
    linear = kalman.linear_model(nominal, acceleration, disturbance)
    assert len(linear.correction) == len(world_of(nominal.robot).axes)
    for damping, T, gain in zip(linear.damping, linear.transition, linear.correction, strict=True):
        A, P = T[:3, :3], np.zeros((3, 3))
        Q = kalman.process_noise(damping, H, acceleration, disturbance)
        for _ in range(3000):
            P = A @ P @ A.T + Q
            K = P[:, :1] / (P[0, 0] + nominal.position_noise**2)
            P = P - K @ P[:1]
        np.testing.assert_allclose(gain, K[:, 0], rtol=1e-6)


@pytest.mark.parametrize(("damping", "lag"), [(0.0, 0.05), (7.96, 0.05), (0.4, 0.01)])
def test_a_sampled_step_is_an_integration(damping: float, lag: float) -> None:
    start, u, w = np.array([0.01, -0.2, 0.5, 0.3]), 0.7, -0.4

    def slope(_: float, x: np.ndarray) -> list[float]:
        return [x[1], -damping * x[1] + x[2] + x[3] + w, 0.0, (u - x[3]) / lag]

    end = solve_ivp(slope, (0.0, H), start, rtol=1e-11, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(sampled(damping, lag, H) @ [*start, u, w], end, rtol=1e-8)


def test_without_a_lag_the_thrust_is_the_command() -> None:
    T = sampled(0.0, 0.0, H)
    e, v, d, f = T @ [0.0, 0.0, 0.0, 5.0, 1.0, 0.0]
    assert (d, f) == pytest.approx((0.0, 1.0))
    assert v == pytest.approx(H, rel=5e-3)
    assert e == pytest.approx(H**2 / 2.0, rel=1e-2)


def test_the_covariance_is_that_of_a_simulation() -> None:
    acceleration, disturbance, sigma = 0.01, 0.5, 5e-5
    T = sampled(7.96, 0.05, H)
    A, Q = T[:3, :3], kalman.process_noise(7.96, H, acceleration, disturbance)
    # Van Loan's formula against the sum that it stands for.
    parts = [sampled(7.96, 0.05, s)[:3, 1:3] for s in (np.arange(2000) + 0.5) * H / 2000]
    W = np.diag([acceleration**2, disturbance**2])
    np.testing.assert_allclose(Q, sum(G @ W @ G.T for G in parts) * H / 2000, rtol=1e-4)

    L = kalman.filter_gain(T, Q, sigma)
    rng = np.random.default_rng(0)
    x, guess = np.zeros((3, 4000)), np.zeros((3, 4000))
    root = np.linalg.cholesky(Q)
    for _ in range(300):
        x = A @ x + root @ rng.standard_normal(x.shape)
        guess = A @ guess
        innovation = x[0] + sigma * rng.standard_normal(4000) - guess[0]
        guess += np.outer(L, innovation)
    # P of the theory from its own fixed point: P = (I - L C)(A P A' + Q).
    P = Q.copy()
    for _ in range(2000):
        P = (np.eye(3) - np.outer(L, [1.0, 0.0, 0.0])) @ (A @ P @ A.T + Q)
    np.testing.assert_allclose(np.diag(np.cov(guess - x)), np.diag(P), rtol=0.1)
    # And no other gain does better.
    worse = sigma**2 * L[0]
    assert P[0, 0] == pytest.approx(worse, rel=1e-6)


@pytest.mark.parametrize("name", ["acceleration_noise", "disturbance_noise"])
def test_a_noise_of_nothing_is_refused(name: str) -> None:
    noises = {"acceleration_noise": 0.1, "disturbance_noise": 0.1, name: 0.0}
    with pytest.raises(ValueError, match=name):
        kalman.linear_model(NOMINAL, **noises)
