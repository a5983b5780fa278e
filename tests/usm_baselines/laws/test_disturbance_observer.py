"""The observer is the inverse of the nominal model behind Q; what it finds is rejected."""

import numpy as np
import pytest
import usm_baselines
from numpy.typing import NDArray
from usm_baselines.estimation import kalman
from usm_baselines.laws.disturbance_observer import q_gain, rate_gain
from usm_baselines.signals import Signals

from usm_gym import Robot, evaluate
from usm_gym.task.conditions import PRESETS
from usm_gym.task.nominal import Nominal
from usm_gym.task.sampling import sample
from usm_gym.world import world_of

Array = NDArray[np.float64]
H, LAG, DAMPING = 0.02, 0.05, 0.4
NOMINAL = Nominal(Robot(), H, LAG, 5e-5)


def loop(bandwidth: float) -> tuple[Array, Array, Array]:
    """The observer fed by positions of the model: its estimate d from what disturbs the model.

    Linear, in the state of model and observer; returns its matrix, input and output.
    """
    T = kalman.sampled(DAMPING, LAG, H)
    A, B, C = T[:3, :3], T[:3, kalman.KNOWN], np.eye(3)[0]
    L = q_gain(T, bandwidth, H)
    # x' = A x + B d; the observer predicts by A and corrects by the new position.
    whole = np.block([[A, np.zeros((3, 3))], [np.outer(L, C @ A), A - np.outer(L, C @ A)]])
    into = np.concatenate([B, L * (C @ B)])
    return whole, into, np.eye(6)[5]


@pytest.mark.parametrize("bandwidth", [2.0, 10.0, 100.0])
def test_the_observer_of_what_is_not_measured_has_both_poles_at_the_bandwidth(
    bandwidth: float,
) -> None:
    T = kalman.sampled(DAMPING, LAG, H)
    A = T[:3, :3] - np.outer(q_gain(T, bandwidth, H), T[0, :3])
    poles = np.sort(np.linalg.eigvals(A).real)
    pole = np.exp(-bandwidth * H)
    np.testing.assert_allclose(poles, np.sort([0.0, pole, pole]), atol=1e-6)


@pytest.mark.parametrize("bandwidth", [2.0, 10.0])
def test_what_it_makes_of_a_disturbance_is_q(bandwidth: float) -> None:
    # Below the frequencies at which a period matters, Q = omega^2 / (s + omega)^2.
    whole, into, out = loop(bandwidth)
    for ratio in (0.1, 0.5, 1.0, 2.0):
        s = 1j * ratio * bandwidth
        z = np.exp(s * H)
        response = out @ np.linalg.solve(z * np.eye(6) - whole, into.astype(complex))
        # What is held over a period lies half a period behind.
        expected = bandwidth**2 / (s + bandwidth) ** 2 * np.exp(s * H / 2)
        assert abs(response * z - expected) < 0.1 * abs(expected)


def test_from_rates_it_is_a_filter_of_first_order() -> None:
    T, bandwidth = kalman.sampled(DAMPING, LAG, H), 6.0
    gain = rate_gain(T, bandwidth, H)
    d, estimates = 0.7, [0.0]
    for _ in range(20):
        off = T[kalman.RATE, kalman.DISTURBANCE] * (d - estimates[-1])
        estimates.append(estimates[-1] + gain * off)
    times = H * np.arange(21)
    np.testing.assert_allclose(estimates, d * (1.0 - np.exp(-bandwidth * times)), rtol=1e-9)


def signals(y: float, u: float, started: float) -> Signals:
    pair, zero = np.array([[y, y]]), np.zeros((1, 2))
    nothing = np.zeros((1, 3, 5))
    return Signals(
        started=np.array([started]),
        fresh=np.array([True]),
        navigated=False,
        y=pair,
        rate=zero,
        disturbance=zero,
        thrust=zero,
        u=np.array([[u, u]]),
        velocity=zero,
        acceleration=zero,
        allocation=nothing,
        observation=np.zeros((1, 1), np.float32),
    )


def test_a_constant_disturbance_moves_nothing_in_the_end_and_the_loop_has_its_poles() -> None:
    nominal = Nominal(Robot(), H, 0.0, 5e-5)
    policy = usm_baselines.make("dob", nominal, observer_bandwidth=20.0, controller_bandwidth=2.0)
    inertia, drag = world_of(Robot()).straight_body
    T = kalman.sampled(drag[0] / inertia[0], 0.0, H)
    mass, d = policy._model.mass, 0.3
    x, own, force = np.array([0.05, 0.0, d, 0.0]), np.zeros((1, 2, 4)), np.zeros((1, 2))
    errors, commanded = [], 0.0
    for k in range(400):
        policy.control(signals(x[0], commanded / mass, min(k, 1)), own, force)
        commanded = force[0, 0]
        x = T @ [*x, commanded / inertia[0], 0.0]
        errors.append(x[0])
    assert own[0, 0, 2] == pytest.approx(d, rel=1e-6)
    assert abs(errors[-1]) < 1e-6
    # Long after the observer has settled, the error falls as t e^(-omega_c t).
    times = H * np.arange(1, 401)
    late = (times > 3.0) & (times < 5.0)
    slope = np.polyfit(times[late], np.log(np.abs(np.array(errors)[late]) / times[late]), 1)[0]
    assert slope == pytest.approx(-2.0, rel=0.1)


@pytest.mark.parametrize("preset", ["field", "basin"])
def test_it_brings_the_robot_home(preset: str) -> None:
    draws = map(np.random.default_rng, range(2))
    scenarios = [sample("operation", PRESETS[preset], stream) for stream in draws]
    outcome = evaluate(usm_baselines.make("dob", scenarios[0].nominal), scenarios)
    assert not outcome.failed.any()
    for axis in "xy":
        assert outcome.per_episode[f"max_error_{axis}"].max() < 0.2
