"""The generalised law solves its equation, holds the plain one, and meets what grows."""

import numba
import numpy as np
import pytest
import usm_baselines
from usm_baselines.laws import generalised_super_twisting as generalised
from usm_baselines.laws import super_twisting
from usm_baselines.laws.super_twisting import SuperTwistingGains

from usm_gym import Robot
from usm_gym.task.nominal import Nominal

NOMINAL = Nominal(Robot(), 0.02, 0.05, 5e-5)


@numba.njit
def law(sigma, h, k_1, k_2, linear, state):  # type: ignore[no-untyped-def]
    return generalised.implicit_generalised(sigma, h, k_1, k_2, linear, state)


@numba.njit
def plain(sigma, h, gains, state):  # type: ignore[no-untyped-def]
    u, state[0], state[1] = super_twisting.implicit_super_twisting(
        sigma, h, gains, state[0], state[1]
    )
    return u


def test_the_implicit_step_solves_its_equation() -> None:
    rng = np.random.default_rng(0)
    inside = outside = 0
    for _ in range(1000):
        h, k_1, k_2, linear = 10.0 ** rng.uniform([-4, -1, -1, -1], [-1, 1, 1, 1])
        v, sigma = rng.normal(), rng.normal() * 10.0 ** rng.uniform(-4, 0)
        if rng.random() < 0.2:
            v = -sigma / h + h * k_2 * rng.uniform(-0.45, 0.45)
        state = np.array([v])
        u = law(sigma, h, k_1, k_2, linear, state)
        after = sigma + h * u
        scale = abs(sigma) + h * abs(v)
        if abs(sigma + h * v) <= 0.5 * h * h * k_2:
            inside += 1
            assert after == pytest.approx(0.0, abs=1e-13 * scale)
            continue
        outside += 1
        sign, r = np.sign(after), np.sqrt(abs(after))
        phi_1 = sign * r + linear * after
        phi_2 = (0.5 / r + linear) * phi_1
        assert state[0] == pytest.approx(v - h * k_2 * phi_2, rel=1e-6, abs=1e-9)
        assert u == pytest.approx(state[0] - k_1 * phi_1, rel=1e-6, abs=1e-9)
    assert min(inside, outside) > 100


def test_without_the_linear_term_it_is_the_plain_law() -> None:
    # phi_2 is sgn / 2 then, so that beta = k_2 / 2; alpha keeps still in its dead zone.
    gains = SuperTwistingGains(epsilon=0.0, beta_offset=0.4, dead_zone=1e9)
    one, other = np.array([0.1]), np.array([0.1, 1.5])
    for sigma in np.random.default_rng(0).normal(0.0, 0.05, 50):
        expected = plain(sigma, 0.02, gains, other)
        assert law(sigma, 0.02, 1.5, 0.8, 0.0, one) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("h", [1e-3, 0.02])
def test_meets_a_disturbance_that_grows_with_the_state(h: float) -> None:
    # sigma' = u + 4 sigma + 2: once sigma is large, no square root outgrows 4 sigma.
    ends = []
    for linear in (0.0, 4.0):
        sigma, state = 2.0, np.zeros(1)
        for _ in range(round(2.0 / h)):
            sigma += h * (law(sigma, h, 3.0, 5.0, linear, state) + 4.0 * sigma + 2.0)
            sigma = min(sigma, 1e6)
        ends.append(abs(sigma))
    assert ends[0] > 100.0
    # In the sliding set u undoes the last disturbance, and one step of it is left.
    assert ends[1] == pytest.approx(2.0 * h / (1.0 - 4.0 * h), rel=1e-6)


def test_constant_gains_are_adaptive_ones_that_keep_still() -> None:
    constant = usm_baselines.make("gsta", NOMINAL, k_1=0.7, k_2=0.2, linear=3.0)
    adaptive = usm_baselines.make(
        "agsta", NOMINAL, linear=3.0, epsilon=0.0, beta_offset=0.2, omega=0.0, alpha_start=0.7
    )
    observation = np.zeros((1, 94), np.float32)
    observation[:, 89] = 1.0  # the thruster limit
    one = other = None
    for y in np.random.default_rng(0).normal(0.0, 0.1, 20):
        observation[:, :2] = y
        action, one = constant.predict(observation, one)
        expected, other = adaptive.predict(observation, other)
        np.testing.assert_array_equal(action, expected)
    growing = usm_baselines.make("agsta", NOMINAL, dead_zone=0.0)
    state = None
    for _ in range(5):
        _, state = growing.predict(observation, state)
    alpha = growing.state_of(state)["alpha"]
    grown = growing.gains.alpha_start + 5 * 0.02 * growing.gains.omega / np.sqrt(2.0)
    np.testing.assert_allclose(alpha, grown)
