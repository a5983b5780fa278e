"""In closed loop, the super-twisting law has the properties that the paper proves of it."""

from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from numpy.typing import NDArray
from usm_baselines.estimation import observer
from usm_baselines.laws import super_twisting
from usm_baselines.laws.super_twisting import SuperTwistingGains

Array = NDArray[np.float64]

PAPER = SuperTwistingGains()
MASS = 10.0  # kg, of a double integrator


@numba.njit
def alone(sigma, h, gains, implicit, state, trace):  # type: ignore[no-untyped-def]
    """sigma' = u_STA, and nothing else."""
    for i in range(trace.shape[0]):
        trace[i, 0], trace[i, 1] = sigma, state[1]
        if implicit:
            u, state[0], state[1] = super_twisting.implicit_super_twisting(
                sigma, h, gains, state[0], state[1]
            )
        else:
            u, state[0], state[1] = super_twisting.explicit_super_twisting(
                sigma, h, gains, state[0], state[1]
            )
        sigma += h * u


@numba.njit
def loop(F, kick, x, v, velocity, h, gains, implicit, trace):  # type: ignore[no-untyped-def]
    """x'' = F_CM / m + F, displaced by kick, under observer and law; x is the error."""
    state = np.zeros(6)
    state[5] = gains.alpha_start
    k = observer.observer_gains(gains.observer_gain, gains.k2_exponent)
    u = 0.0
    for i in range(F.size):
        x += kick[i]
        started = 0.0 if i == 0 else 1.0
        z1, z2 = observer.observe(implicit, started, x, u, velocity, h, k, state)
        trace[i, 0] = x
        trace[i, 1] = gains.surface * state[0] + state[1]
        trace[i, 2] = state[5]
        u = super_twisting.super_twisting_force(z1, z2, 0.0, h, MASS, gains, implicit, state) / MASS
        # u_STA is what (19) adds to the rest.
        trace[i, 3] = u + gains.surface * (state[1] + z1) + state[2] + z2
        a = u + F[i]
        x += h * v + 0.5 * h * h * a
        v += h * a


class Trace(NamedTuple):
    """What happens in `loop`, (steps,) each."""

    time: Array
    error: Array
    sigma: Array
    alpha: Array
    u_sta: Array


def closed_loop(
    h: float,
    implicit: bool,
    gains: SuperTwistingGains = PAPER,
    *,
    duration: float = 3.0,
    disturbance: tuple[float, float] = (2.0, 2.0),
    kick: float = 0.0,
    start: tuple[float, float] = (0.0, 0.0),
    velocity: float = 0.0,
) -> Trace:
    """Run the double integrator under disturbance[0] sin(disturbance[1] t) m/s^2.

    A kick displaces it within 20 ms from half of the duration on, as the joints do the robot.
    """
    time = h * np.arange(round(duration / h))
    F = disturbance[0] * np.sin(disturbance[1] * time)
    since = time - duration / 2.0
    kicked = (since > -h / 2.0) & (since < 0.02 - h / 2.0)
    trace = np.empty((time.size, 4))
    loop(F, kicked * kick / kicked.sum(), *start, velocity, h, gains, implicit, trace)
    return Trace(time, *trace.T)


@pytest.mark.parametrize(("implicit", "h"), [(True, 1e-3), (False, 1e-4)])
def test_alpha_never_falls_in_closed_loop(implicit: bool, h: float) -> None:
    trace = closed_loop(h, implicit, kick=5e-3, velocity=-1.0)
    steps = np.diff(trace.alpha)
    grows = np.abs(trace.sigma[:-1]) > PAPER.dead_zone
    assert 0.1 < grows.sum() * h < 1.0
    np.testing.assert_allclose(steps, grows * h * 8.0 * np.sqrt(0.5), atol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("implicit", "h"), [(True, 1e-3), (True, 1e-5), (False, 1e-5)])
def test_sigma_is_driven_to_zero_in_finite_time(implicit: bool, h: float, sign: float) -> None:
    trace = np.empty((round(3.0 / h), 2))
    alone(sign, h, PAPER, implicit, np.zeros(2), trace)
    time, sigma = h * np.arange(len(trace)), np.abs(trace[:, 0])
    assert sigma[time < 0.3].min() > 0.05  # not at once either
    if implicit:
        assert sigma[time > 1.0].max() < 1e-12
    else:
        assert sigma[time > 1.0].max() < 10.0 * h * h * 12.0  # a few times h^2 beta
    assert trace[-1, 1] == trace[round(1.0 / h), 1] > 1.0


def test_without_alpha_a_small_start_is_left_to_oscillate() -> None:
    # v' = -beta sgn sigma alone: parabolas of period 4 sqrt(2 sigma(0) / beta), undamped.
    trace = np.empty((200000, 2))
    alone(0.04, 1e-5, PAPER, False, np.zeros(2), trace)
    sigma = trace[:, 0]
    assert not trace[:, 1].any()
    assert np.abs(sigma[150000:]).max() == pytest.approx(0.04, rel=0.05)
    crossings = 1e-5 * np.nonzero(np.diff(np.sign(sigma)) != 0.0)[0]
    period = 4.0 * np.sqrt(2.0 * 0.04 / 5.0)
    np.testing.assert_allclose(np.diff(crossings[:6]), period / 2.0, rtol=0.02)
    alone(0.04, 1e-5, PAPER._replace(alpha_start=2.0), False, np.array([0.0, 2.0]), trace)
    assert np.abs(trace[150000:, 0]).max() < 1e-7


@pytest.mark.parametrize("gains", [PAPER, PAPER._replace(surface=2.5, beta_offset=0.3)])
def test_the_sliding_variable_knows_nothing_of_the_disturbance(gains: SuperTwistingGains) -> None:
    # (19)-(20): sigma' = u_STA to rounding, whatever pushes; so sigma is always the same.
    h = 1e-4
    runs = [
        closed_loop(h, False, gains, disturbance=push, kick=kick, velocity=-1.0, start=(0.1, v))
        for push, kick, v in (((0.0, 1.0), 0.0, 0.0), ((10.0, 4.0), 0.0, 2.0), ((1.0, 9.0), 0.1, 0))
    ]
    for trace in runs:
        np.testing.assert_allclose(np.diff(trace.sigma) / h, trace.u_sta[:-1], atol=1e-8)
        np.testing.assert_allclose(trace.sigma, runs[0].sigma, atol=1e-11)
        assert np.abs(trace.sigma).max() > 0.5
    assert not np.allclose(runs[0].error, runs[2].error, atol=1e-3)


def test_the_implicit_sliding_variable_forgets_the_disturbance_with_the_step() -> None:
    differences = []
    for h in (1e-3, 1e-4, 1e-5):
        still, pushed = (
            closed_loop(h, True, disturbance=(push, 4.0), velocity=-1.0) for push in (0.0, 10.0)
        )
        differences.append(np.abs(still.sigma - pushed.sigma).max())
    assert differences[0] < 0.02
    assert differences[2] < 0.2 * differences[1] < 0.04 * differences[0]


@pytest.mark.parametrize("exponent", [0.5, 2 / 3])
@pytest.mark.parametrize("velocity", [0.0, -1.0])
@pytest.mark.parametrize(("h", "agreement"), [(1e-5, 0.005), (5e-4, 0.1)])
def test_implicit_and_explicit_laws_agree_at_small_steps(
    h: float, agreement: float, velocity: float, exponent: float
) -> None:
    gains = PAPER._replace(k2_exponent=exponent)
    options: Any = {"start": (0.0, 0.1), "velocity": velocity, "kick": 0.02}
    explicit = closed_loop(1e-5, False, gains, **options)
    implicit = closed_loop(h, True, gains, **options)
    for late, share in ((False, 1.0), (True, 0.2)):  # the start is harder than the kick
        peaks = [
            np.abs(trace.error[(trace.time >= 1.5) == late]).max() for trace in (explicit, implicit)
        ]
        assert peaks[1] == pytest.approx(peaks[0], rel=share * agreement)
        assert peaks[0] > 5e-4
    same = np.linspace(0.0, 3.0, 600, endpoint=False)
    at = [np.interp(same, trace.time, trace.error) for trace in (explicit, implicit)]
    assert np.sqrt(np.mean((at[1] - at[0]) ** 2)) < 2.0 * agreement * np.sqrt(np.mean(at[0] ** 2))


def test_the_error_is_driven_to_zero() -> None:
    # x' = -lambda x on the sliding set, once the observer has found the disturbance.
    trace = closed_loop(1e-3, True, disturbance=(10.0, 4.0), start=(0.5, 0.0), duration=12.0)
    assert np.abs(trace.error[trace.time > 11.0]).max() < 1e-4
    passing = np.interp([4.0, 6.0], trace.time, trace.error)
    assert np.log(passing[0] / passing[1]) == pytest.approx(2.0 * PAPER.surface, rel=0.05)
