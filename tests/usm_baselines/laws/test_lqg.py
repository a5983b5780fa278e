"""The regulator is the optimal one, and brings the model to rest against a constant disturbance."""

import numpy as np
import pytest
import usm_baselines
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov
from scipy.optimize import minimize
from usm_baselines.estimation import kalman
from usm_baselines.laws.lqg import LQG, regulate, regulator_gain

from tests.support.signals import made_signals
from usm_gym import Robot
from usm_gym.task.nominal import Nominal

NOMINAL = Nominal(Robot(), 0.02, 0.05, 5e-5)
WEIGHT = 1e-3


def deviations(transition: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (A, B) over (e, v, f, last u), the input being the change of u."""
    e, v, f, u = 0, 1, 3, 4
    A = np.vstack([transition[[e, v, f]][:, [e, v, f, u]], [0.0, 0.0, 0.0, 1.0]])
    return A, np.append(transition[[e, v, f], u], 1.0)[:, None]


@pytest.mark.parametrize("damping", [0.4, 7.96])
def test_no_other_gain_costs_less(damping: float) -> None:
    T = kalman.sampled(damping, 0.05, 0.02)
    A, B = deviations(T)
    Q = np.diag([1.0, 0.0, 0.0, 0.0])

    def cost(gain: np.ndarray) -> float:
        closed = A - B @ gain[None]
        if np.abs(np.linalg.eigvals(closed)).max() >= 1.0:
            return np.inf
        price = Q + WEIGHT**2 * np.outer(gain, gain)
        return float(np.trace(solve_discrete_lyapunov(closed.T, price)))

    gain = regulator_gain(T, WEIGHT)
    assert cost(gain) == pytest.approx(
        float(np.trace(solve_discrete_are(A, B, Q, [[WEIGHT**2]]))), rel=1e-6
    )
    best = minimize(cost, gain, method="Nelder-Mead", options={"maxiter": 400})
    assert best.fun >= cost(gain) * (1.0 - 1e-9)


def test_a_constant_disturbance_is_found_and_held_off() -> None:
    policy = LQG(NOMINAL, disturbance_noise=0.5)
    linear, mass = policy._linear, NOMINAL.robot.total_mass
    x, law, force, u = np.zeros((2, 4)), np.zeros((1, 2, 4)), np.empty((1, 2)), np.zeros(2)
    x[:, 0], x[:, 2] = 0.02, [0.6, -0.3]
    acceleration, velocity = np.array([[0.05, -0.02]]), np.array([[0.1, 0.03]])
    for k in range(800):
        signals = made_signals(
            started=np.array([float(k > 0)]),
            y=x[None, :, 0].copy(),
            u=u[None] * linear.inertia / mass - acceleration,
            velocity=velocity,
            acceleration=acceleration,
        )
        policy.control(signals, law, force)
        u = force[0] / linear.inertia
        w = -acceleration[0] - linear.damping * velocity[0]
        x = np.stack([T @ [*x[i], u[i], w[i]] for i, T in enumerate(linear.transition)])
    np.testing.assert_allclose(law[0], x, atol=1e-6)
    np.testing.assert_allclose(x[:, :2], 0.0, atol=1e-6)
    np.testing.assert_allclose(x[:, 2], [0.6, -0.3])


def test_the_command_moves_from_the_one_applied() -> None:
    # At the steady state nothing changes, whatever the gains.
    gain, steady = np.array([3.0, 2.0, 0.5, 0.4]), 0.7
    assert regulate(gain, steady, steady, np.array([0.0, 0.0, -0.7, 0.7])) == steady
    assert regulate(gain, steady, 0.9, np.array([0.0, 0.0, -0.7, 0.7])) == pytest.approx(
        0.9 - 0.4 * 0.2
    )


@pytest.mark.parametrize("id", ["lqg", "lqg-joints", "mpc"])
@pytest.mark.parametrize("name", ["variation_weight", "acceleration_noise", "disturbance_noise"])
def test_gains_of_nothing_are_refused(id: str, name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} is 0.0; allowed"):
        usm_baselines.make(id, NOMINAL, **{name: 0.0})
