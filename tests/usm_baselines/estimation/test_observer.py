"""The observer solves its equations, is exact where it slides, and gets there in finite time."""

from typing import Any

import numba
import numpy as np
import pytest
from numpy.typing import NDArray
from support import laws
from usm_baselines.estimation import observer

Array = NDArray[np.float64]

EXPONENTS = (0.5, 2 / 3)


@numba.njit
def gains_of(L, exponent):  # type: ignore[no-untyped-def]
    return observer.observer_gains(L, exponent)


@numba.njit
def step(implicit, started, y, u, velocity, h, k, state):  # type: ignore[no-untyped-def]
    return observer.observe(implicit, started, y, u, velocity, h, k, state)


@numba.njit
def watch(implicit, y, u, h, k, states):  # type: ignore[no-untyped-def]
    """Follow a signal from states[0] on."""
    for i in range(1, y.size):
        states[i] = states[i - 1]
        observer.observe(implicit, 1.0, y[i], u[i - 1], 0.0, h, k, states[i])


def observed(y: Array, u: Array, h: float, k: Any, start: Array, implicit: bool = True) -> Array:
    """Return the estimates (p1, p2, p3) at all times."""
    states = np.zeros((y.size, 4))
    states[0, :3] = start
    states[0, 3] = np.cbrt(y[0] - start[0])
    watch(implicit, y, u, h, k, states)
    return states[:, :3]


@pytest.mark.parametrize("exponent", EXPONENTS)
@pytest.mark.parametrize("L", [1.0, 55.0, 700.0])
def test_gains_are_those_of_the_paper(L: float, exponent: float) -> None:
    np.testing.assert_allclose(gains_of(L, exponent), laws.observer_gains(L, exponent), rtol=1e-14)


def test_the_two_exponents_differ_as_documented() -> None:
    assert gains_of(55.0, 0.5)[1] == pytest.approx(81.58, abs=0.01)
    assert gains_of(55.0, 2 / 3)[1] == pytest.approx(159.1, abs=0.1)


def cases(count: int = 2000) -> list[tuple[float, float, float, tuple[float, ...], Array]]:
    """Draw (y, u, h, k, state) of every scale, in and out of the sliding set."""
    rng = np.random.default_rng(0)
    drawn = []
    for _ in range(count):
        h = float(10.0 ** rng.uniform(-4, -1))
        k = gains_of(float(10.0 ** rng.uniform(0, 3)), float(rng.choice(EXPONENTS)))
        state = rng.normal(0.0, [0.1, 1.0, 10.0, 0.0])
        u = float(rng.normal(0.0, 5.0))
        sliding = h**3 * k[2]
        b = sliding * 10.0 ** rng.uniform(-3, 6) * rng.choice([-1.0, 1.0])
        y = float(b + state[0] + h * state[1] + h * h * (state[2] + u))
        drawn.append((y, u, h, k, state))
    return drawn


def test_an_implicit_step_solves_its_equations() -> None:
    inside = outside = 0
    for y, u, h, k, before in cases():
        state = before.copy()
        z1, z2 = step(True, 1.0, y, u, 0.0, h, k, state)
        p1, p2, p3, root = state
        xi = (p3 - before[2]) / (h * k[2])
        rounding = 1e-13 * max(abs(p3), abs(before[2])) / (h * k[2]) + 1e-12
        if root == 0.0:
            inside += 1
            assert abs(xi) <= 1.0 + rounding
            assert p1 == y
        else:
            outside += 1
            assert xi == pytest.approx(np.sign(root), abs=rounding)
        scale = np.abs([y, *before, h * u, *state]).max()
        assert z1 == pytest.approx(k[0] * abs(root) * root, rel=1e-12)
        assert z2 == pytest.approx(k[1] * root, rel=1e-12)
        # (16) at the new time.
        assert p1 == pytest.approx(before[0] + h * (p2 + z1), abs=1e-13 * scale)
        assert p2 == pytest.approx(before[1] + h * (p3 + z2 + u), abs=1e-13 * scale)
        assert y - p1 == pytest.approx(root**3, abs=1e-13 * scale)
    assert min(inside, outside) > 100


def test_an_implicit_step_is_that_of_plain_python() -> None:
    for y, u, h, k, before in cases(500):
        state = before.copy()
        corrections = step(True, 1.0, y, u, 0.0, h, k, state)
        expected = laws.Observer(laws.Gains(*k), h, before[:3].copy())
        scale = np.abs([y, *before, h * u]).max()
        np.testing.assert_allclose(corrections, expected.step(y, u), rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(state[:3], expected.p, rtol=1e-9, atol=1e-9 * scale)


def test_in_the_sliding_set_the_estimates_are_differences() -> None:
    h, k = 0.02, gains_of(55.0, 0.5)
    t = h * np.arange(200)
    y, u = 0.01 * np.sin(3.0 * t), 0.2 * np.cos(2.0 * t)
    states = observed(y, u, h, k, np.array([0.0, 0.03, 0.0]))
    np.testing.assert_array_equal(states[:, 0], y)
    np.testing.assert_allclose(states[1:, 1], np.diff(y) / h, atol=1e-13)
    expected = np.diff(states[:, 1]) / h - u[:-1]
    np.testing.assert_allclose(states[1:, 2], expected, atol=1e-11)


@pytest.mark.parametrize("exponent", EXPONENTS)
@pytest.mark.parametrize("implicit", [True, False])
def test_converges_in_finite_time_under_a_bounded_disturbance_rate(
    implicit: bool, exponent: float
) -> None:
    # x'' = u + F, |F'| < L, from a start that is wrong in everything.
    h, L = 1e-4, 55.0
    t = h * np.arange(30001)
    w = 9.0
    x, rate, F = (
        0.3 + 0.5 * t - 0.9 * L / w**3 * np.cos(w * t),
        0.5 + 0.9 * L / w**2 * np.sin(w * t),
        0.9 * L / w * np.cos(w * t),
    )
    states = observed(
        x, np.zeros_like(t), h, gains_of(L, exponent), np.array([0.0, -1.0, 8.0]), implicit
    )
    errors = np.abs(states - np.stack([x, rate, F], axis=1))
    assert (errors[0] > 0.2).all()
    late = errors[t >= 0.5].max(axis=0)
    if implicit:
        # First and second differences of the true signal lag behind by half a step and by one.
        assert late[0] == 0.0
        assert late[1] <= 1.001 * 0.5 * h * np.abs(F).max()
        assert late[2] <= 1.001 * h * 0.9 * L
    else:
        # The step's powers are those of theory, h^3, h and h; the factors are as they come.
        assert late[0] < 10.0 * h**3 * 6.0 * L
        assert late[1] < 1.1 * 0.5 * h * np.abs(F).max()
        assert late[2] < 5.0 * h * 6.0 * L


def test_is_lost_when_the_disturbance_is_faster_than_its_gain() -> None:
    h, L = 1e-3, 55.0
    t = h * np.arange(4001)
    k = gains_of(L, 0.5)
    for rate, follows in ((0.9 * k[2], True), (1.1 * k[2], False)):
        y = rate * t**3 / 6.0
        states = observed(y, np.zeros_like(t), h, k, np.zeros(3))
        error = abs(states[-1, 2] - rate * t[-1])
        assert (error < 0.01 * rate * t[-1]) == follows


@pytest.mark.parametrize("implicit", [True, False])
def test_starts_at_the_measurement_and_at_rest(implicit: bool) -> None:
    # The error form's rate is then minus the reference's; a stale state is forgotten.
    state = np.array([9.0, 9.0, 9.0, 9.0])
    corrections = step(implicit, 0.0, 0.02, 5.0, 0.3, 0.02, gains_of(55.0, 0.5), state)
    assert corrections == (0.0, 0.0)
    assert state.tolist() == [0.02, -0.3, 0.0, 0.0]


def test_the_explicit_step_is_eulers() -> None:
    rng = np.random.default_rng(0)
    k1, k2, k3 = k = gains_of(55.0, 0.5)
    h = 1e-3
    p1, p2, p3, e = 0.1, 0.2, -3.0, 0.05
    state = np.array([p1, p2, p3, np.cbrt(e)])
    for _ in range(200):
        y, u = rng.normal(0.0, 0.1), rng.normal()
        z1, z2 = k1 * np.cbrt(e) * np.cbrt(abs(e)), k2 * np.cbrt(e)
        p1, p2, p3 = p1 + h * (p2 + z1), p2 + h * (p3 + z2 + u), p3 + h * k3 * np.sign(e)
        e = y - p1
        corrections = step(False, 1.0, y, u, 0.0, h, k, state)
        np.testing.assert_allclose(state, [p1, p2, p3, np.cbrt(e)], rtol=1e-10, atol=1e-12)
        expected = (k1 * np.cbrt(e) * np.cbrt(abs(e)), k2 * np.cbrt(e))
        np.testing.assert_allclose(corrections, expected, rtol=1e-9)
