"""The extended-state observer has its poles where Gao puts them and finds constant disturbances."""

import numba
import numpy as np
import pytest
import usm_baselines
from usm_baselines.laws import ladrc

from usm_gym import Robot
from usm_gym.task.nominal import Nominal

H = 0.02


@numba.njit
def correction_of(bandwidth, h):  # type: ignore[no-untyped-def]
    return ladrc.observer_correction(bandwidth, h)


@numba.njit
def step(y, u, h, correction, state):  # type: ignore[no-untyped-def]
    ladrc.extended_state(y, u, h, correction, state)


@pytest.mark.parametrize("bandwidth", [2.0, 20.0, 100.0])
def test_all_poles_lie_at_the_bandwidth(bandwidth: float) -> None:
    A = np.array([[1.0, H, H * H / 2.0], [0.0, 1.0, H], [0.0, 0.0, 1.0]])
    L = np.array(correction_of(bandwidth, H))
    poles = np.linalg.eigvals(A - np.outer(L, A[0]))
    np.testing.assert_allclose(poles, np.exp(-bandwidth * H), rtol=1e-3)


def test_a_constant_disturbance_is_estimated_exactly() -> None:
    correction, state = correction_of(20.0, H), np.zeros(3)
    rng = np.random.default_rng(0)
    x, v, d = 0.1, -0.3, 0.8
    for _ in range(200):
        u = rng.normal()
        x, v = x + H * v + 0.5 * H * H * (u + d), v + H * (u + d)
        step(x, u, H, correction, state)
    np.testing.assert_allclose(state, [x, v, d], rtol=1e-9)


@pytest.mark.parametrize("name", ["observer_bandwidth", "inertia"])
def test_gains_of_nothing_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} is 0.0; allowed"):
        usm_baselines.make("ladrc", Nominal(Robot(), H, 0.05, 5e-5), **{name: 0.0})
