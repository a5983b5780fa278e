"""Incremental control reaches its reference dynamics, whatever mass and disturbance there are."""

import numpy as np
import pytest
import usm_baselines
from numpy.typing import NDArray
from usm_baselines.laws import incremental
from usm_baselines.signals import Signals

from usm_gym import Robot, evaluate
from usm_gym.task.conditions import PRESETS
from usm_gym.task.nominal import Nominal
from usm_gym.task.sampling import sample

Array = NDArray[np.float64]
H = 0.005
OMEGA = 2.0


def observed(e: float, v: float, push: float, started: bool, navigated: bool) -> Signals:
    def pair(value: float) -> Array:
        return np.array([[value, value]])

    return Signals(
        started=np.array([float(started)]),
        fresh=np.array([True]),
        navigated=navigated,
        y=pair(e),
        rate=pair(v),
        disturbance=pair(0.0),
        thrust=pair(0.0),
        u=pair(push),
        velocity=pair(0.0),
        acceleration=pair(0.0),
        allocation=np.zeros((1, 3, 5)),
        observation=np.zeros((1, 1), np.float32),
    )


def errors_of(mass: float, damping: float, disturbance: float, navigated: bool) -> Array:
    """Errors of a mass in one axis that is off by 0.1 m; the law takes it to be 10 kg."""
    law = usm_baselines.make(
        "indi",
        Nominal(Robot(), H, 0.0, 0.0),
        filter_bandwidth=100.0,
        controller_bandwidth=OMEGA,
        inertia=10.0,
    )
    own, force = np.zeros((1, 2, len(incremental.STATE))), np.zeros((1, 2))
    e, v, errors = 0.1, 0.0, []
    for k in range(1000):
        push = force[0, 0] / law._model.mass
        law.control(observed(e, v, push, k > 0, navigated), own, force)
        for _ in range(10):
            a = (force[0, 0] + disturbance - damping * v) / mass
            e, v = e + 0.1 * H * v + 0.5 * (0.1 * H) ** 2 * a, v + 0.1 * H * a
        errors.append(e)
    return np.array(errors)


@pytest.mark.parametrize("navigated", [False, True])
@pytest.mark.parametrize("mass", [7.0, 10.0, 15.0])
def test_the_reference_dynamics_are_reached_whatever_the_mass(mass: float, navigated: bool) -> None:
    times = H * np.arange(1, 1001)
    wanted = 0.1 * (1.0 + OMEGA * times) * np.exp(-OMEGA * times)
    reached = errors_of(mass, 0.0, 0.0, navigated)
    assert np.abs(reached - wanted).max() < 0.05 * 0.1
    # Without the increments, a force for 10 kg would give other dynamics.
    plain = OMEGA * np.sqrt(10.0 / mass)
    if mass != 10.0:
        others = 0.1 * (1.0 + plain * times) * np.exp(-plain * times)
        assert np.abs(reached - others).max() > np.abs(reached - wanted).max()


@pytest.mark.parametrize("navigated", [False, True])
def test_drag_and_a_constant_force_are_rejected_without_an_integral(navigated: bool) -> None:
    reached = errors_of(12.0, 20.0, 8.0, navigated)
    assert np.abs(reached[-1]) < 1e-4


def test_acceleration_and_force_are_filtered_alike() -> None:
    # What accelerates a double integrator is seen in both at the same time, and so cancels.
    rng = np.random.default_rng(0)
    track = incremental.track
    state = np.zeros(len(incremental.STATE))
    e, v, gaps = 0.0, 0.0, []
    for _ in range(300):
        u = rng.normal()
        e, v = e + H * v + 0.5 * H * H * u, v + H * u
        track(e, 0.0, False, u, H, 0.3, state)
        gaps.append(state[incremental.ACCELERATION] - state[incremental.THRUST_SHARE])
    assert np.abs(gaps).max() < 1e-9
    assert abs(state[incremental.THRUST_SHARE]) > 1e-3


@pytest.mark.parametrize("preset", ["field", "basin"])
def test_it_brings_the_robot_home(preset: str) -> None:
    draws = map(np.random.default_rng, range(2))
    scenarios = [sample("operation", PRESETS[preset], stream) for stream in draws]
    outcome = evaluate(usm_baselines.make("indi", scenarios[0].nominal), scenarios)
    assert not outcome.failed.any()
    for axis in "xy":
        assert outcome.per_episode[f"max_error_{axis}"].max() < 0.2
