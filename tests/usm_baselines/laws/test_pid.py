"""The PID law term by term, and what back-calculation is for."""

import numba
import numpy as np
import pytest
from usm_baselines.laws import pid
from usm_baselines.laws.pid import PIDGains

H = 0.02
GAINS = PIDGains(k_p=100.0, k_i=40.0, k_d=30.0, derivative_time=0.05)


@numba.njit
def law(started, y, applied, velocity, h, gains, state):  # type: ignore[no-untyped-def]
    return pid.pid_force(started, y, applied, velocity, h, gains, state)


def test_the_terms_are_those_of_the_textbook() -> None:
    state = np.zeros(4)
    asked = law(0.0, 0.1, 0.0, 0.0, H, GAINS, state)
    assert asked == pytest.approx(-10.0)
    asked = law(1.0, 0.12, asked, 0.0, H, GAINS, state)
    derivative = -30.0 * 0.02 / (0.05 + H)
    assert asked == pytest.approx(-12.0 + derivative - 40.0 * H * 0.12)


def loop(limit: float, back_calculation: bool) -> np.ndarray:
    """Return the error of a mass of 10 kg that is pushed hard for 2 s, then not at all."""
    state, x, v, applied, errors = np.zeros(4), 0.0, 0.0, 0.0, []
    for k in range(1500):
        reported = applied if back_calculation else state[pid.ASKED]
        asked = law(float(k > 0), x, reported, 0.0, H, GAINS, state)
        applied = float(np.clip(asked, -limit, limit))
        v += H * (applied + (15.0 if k < 100 else 2.0)) / 10.0
        x += H * v
        errors.append(x)
    return np.array(errors)


def test_saturation_winds_nothing_up() -> None:
    free, wound, kept = loop(1e9, True), loop(12.0, False), loop(12.0, True)
    assert abs(free[-1]) < 1e-3  # the integral takes the constant part of the push
    assert abs(kept[-1]) < 1e-3
    assert kept.min() > 0.7 * wound.min()  # less of an overshoot afterwards
    assert wound.min() < -0.1


def test_starts_from_rest_without_a_kick() -> None:
    # The reference starts to move: the rate of the error is minus its velocity from the first.
    state = np.zeros(4)
    law(0.0, 0.0, 0.0, 0.1, H, GAINS, state)
    held = state[pid.DERIVATIVE]
    law(1.0, -0.1 * H, 0.0, 0.1, H, GAINS, state)
    assert held == pytest.approx(3.0)
    assert state[pid.DERIVATIVE] == pytest.approx(3.0)
