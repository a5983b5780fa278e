"""The navigator: late, rare and missing fixes, against a filter that has them in time."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2
from usm_baselines.estimation import kalman
from usm_baselines.estimation.navigator import Navigator, is_needed
from usm_baselines.signals import model_of, sense, shared_size, signals_of

from usm_gym.robot import Robot
from usm_gym.spatial_robot import EELY
from usm_gym.task.nominal import Nominal
from usm_gym.world import world_of

DENSITIES = 2e-2, 0.05
RARE = Nominal(Robot(), 0.02, 0.1, 1e-3, position_period=5)
LATE = replace(RARE, position_delay=3)
IN_SPACE = replace(LATE, robot=EELY)
DVL = {"velocity_period": 4, "velocity_noise": 5e-3}


class Drifter:
    """Robots that noise pushes about on the linear model, and what is measured of them."""

    def __init__(self, nominal, robots, periods, seed):
        self.nominal, self.robots, self.periods = nominal, robots, periods
        rng = np.random.default_rng(seed)
        linear = kalman.linear_model(nominal, *DENSITIES)
        noise = [
            kalman.process_noise(damping, nominal.control_period, *DENSITIES)
            for damping in linear.damping
        ]
        axes = len(linear.damping)
        self.state = np.zeros((periods, robots, axes, 3))
        first = np.diag([nominal.position_noise**2, 0.0, 10.0 * DENSITIES[1] ** 2])
        for axis in range(axes):
            A, Q = linear.transition[axis][:3, :3], noise[axis]
            x = rng.multivariate_normal(np.zeros(3), first, robots)
            for k in range(periods):
                self.state[k, :, axis] = x
                x = x @ A.T + rng.multivariate_normal(np.zeros(3), Q, robots)
        self.fixes = self.state[..., 0] + nominal.position_noise * rng.standard_normal(
            (periods, robots, axes)
        )
        # At the start the position is known, and what is estimated begins there.
        self.fixes[0] = 0.0
        speed = rng.standard_normal((periods, robots, axes))
        self.speeds = self.state[..., 1] + nominal.velocity_noise * speed
        self.arrives = rng.random(periods) > 0.2
        self.arrives[0] = True

    def taken(self, k, period, delay, arrives):
        """When the measurement that is known at k was taken."""
        return max(
            j for j in range(k + 1) if j == 0 or (j % period == 0 and arrives[j] and j + delay <= k)
        )

    def observations(self, nominal):
        """What is observed at each instant, by the delays of some nominal knowledge."""
        layout, h = world_of(nominal.robot).layout, nominal.control_period
        for k in range(self.periods):
            seen = np.zeros((self.robots, layout.size))
            at = self.taken(k, nominal.position_period, nominal.position_delay, self.arrives)
            seen[:, layout.slices["position_error"]] = self.fixes[at]
            seen[:, layout.slices["position_age"]] = (k - at) * h
            seen[:, layout.slices["velocity_age"]] = -1.0
            if nominal.velocity_period is not None:
                always = np.ones(self.periods, bool)
                at = self.taken(k, nominal.velocity_period, nominal.velocity_delay, always)
                seen[:, layout.slices["velocity"]] = self.speeds[at]
                seen[:, layout.slices["velocity_age"]] = (k - at) * h
            seen[:, layout.slices["thruster_limit"]] = 20.0
            yield (seen / layout.scale).astype(np.float32)


def navigated(drifter, nominal):
    """Estimates, covariances, innovations and their variances at each instant."""
    navigator = Navigator(nominal, *DENSITIES)
    world, model = world_of(nominal.robot), model_of(nominal)
    memory = np.zeros((drifter.robots, navigator.size))
    shared = np.zeros((drifter.robots, shared_size(model)))
    found = []
    for seen in drifter.observations(nominal):
        signals = signals_of(seen, model, world, navigated=True)
        sense(shared, model, signals)
        navigator.estimate(signals, model.mass, memory)
        shared[:, 0] = 1.0
        estimate = np.stack([signals.y, signals.rate, signals.disturbance], axis=2)
        covariance = navigator.covariance(memory)
        found.append((estimate, covariance, *navigator.innovation(memory)))
    return [np.stack(part) for part in zip(*found, strict=True)]


def test_a_navigator_is_needed_where_positions_are_late_or_rare_or_a_velocity_is_measured():
    assert not is_needed(Nominal(Robot(), 0.02, 0.1, 1e-3))
    for nominal in (RARE, LATE, replace(RARE, position_period=1, velocity_period=3)):
        assert is_needed(nominal)


@pytest.mark.parametrize("more", [{}, DVL], ids=["fixes", "fixes and velocities"])
def test_late_measurements_give_the_estimate_of_those_in_time_run_on(more):
    early = replace(RARE, **more)
    drifter = Drifter(early, robots=3, periods=200, seed=1)
    in_time, P_in_time, *_ = navigated(drifter, early)
    late = replace(early, position_delay=3, **{"velocity_delay": 3} if more else {})
    estimate, P, *_ = navigated(drifter, late)
    linear = kalman.linear_model(RARE, *DENSITIES)
    for k in range(3, drifter.periods):
        run_on, P_run_on = in_time[k - 3].copy(), P_in_time[k - 3].copy()
        for _ in range(3):
            for axis, damping in enumerate(linear.damping):
                A, part = linear.transition[axis][:3, :3], slice(3 * axis, 3 * axis + 3)
                run_on[:, axis] = run_on[:, axis] @ A.T
                Q = kalman.process_noise(damping, RARE.control_period, *DENSITIES)
                P_run_on[:, part, part] = A @ P_run_on[:, part, part] @ A.T + Q
        np.testing.assert_allclose(estimate[k], run_on, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(P[k], P_run_on, rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize(
    "nominal",
    [LATE, replace(LATE, **DVL, velocity_delay=2), replace(IN_SPACE, **DVL, velocity_delay=2)],
)
def test_innovations_and_errors_are_as_large_as_the_navigator_says(nominal):
    robots, axes = 100, len(world_of(nominal.robot).axes)
    drifter = Drifter(nominal, robots, periods=400, seed=2)
    estimate, P, innovation, variance = navigated(drifter, nominal)
    arrived = variance[:, 0, 0] > 0.0
    assert 20 < arrived.sum() < 400 / nominal.position_period
    squares = (innovation[arrived] ** 2 / variance[arrived]).sum(axis=(1, 2))
    low, high = chi2.ppf([0.025, 0.975], axes * robots)
    inside = np.mean((squares > low) & (squares < high))
    assert inside > 0.85
    low, high = chi2.ppf([0.001, 0.999], axes * robots * arrived.sum())
    assert low < squares.sum() < high
    # The same of the estimates, at instants far apart.
    for k in (50, 199, 399):
        off = (estimate[k] - drifter.state[k]).reshape(robots, 3 * axes)
        square = np.einsum("bi,bij,bj->", off, np.linalg.inv(P[k]), off)
        low, high = chi2.ppf([0.001, 0.999], 3 * axes * robots)
        assert low < square < high


def test_uncertainty_grows_until_a_fix_arrives():
    drifter = Drifter(LATE, robots=1, periods=60, seed=3)
    drifter.arrives[15:45] = False
    _, P, _, variance = navigated(drifter, LATE)
    spread = P[:, 0, 0, 0]
    silent = np.arange(19, 47)
    assert not variance[silent].any()
    assert (np.diff(spread[silent]) > 0.0).all()
    arrival = 48
    assert variance[arrival].all()
    assert spread[arrival] < 0.2 * spread[arrival - 1]
