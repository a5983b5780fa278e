"""What Theorem 1 claims, and up to where."""

import numpy as np
import pytest
from usm_baselines.laws.super_twisting import SuperTwistingGains
from usm_baselines.paper.convergence import (
    STEP,
    Start,
    cascade,
    disturbance_rate,
    growth,
    size,
)
from usm_baselines.paper.paper_rate import Law, simulate
from usm_baselines.paper.reproduction import at_step

from usm_gym.support.seeding import TUNING, stream
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import named, sample

PAPER = SuperTwistingGains()
L = PAPER.observer_gain
# The switch that does most harm to the printed gains.
WORST = (-0.92, 0.39)


def largest_rate(exponent: float) -> float:
    """The |F'| over L up to which the observer error shrinks under all of `switches`."""
    L = SuperTwistingGains().observer_gain
    low, high = 0.0, 10.0
    while high - low > 0.02:
        middle = 0.5 * (low + high)
        if growth(middle * L, exponent) < 1.0:
            low = middle
        else:
            high = middle
    return low


def test_the_observer_converges_well_beyond_its_gain():
    assert 5.0 < largest_rate(0.5) < 5.3
    assert 5.9 < largest_rate(2 / 3) <= 6.0  # k3 = 6 L, beyond which nothing can hold e3
    for exponent in (0.5, 2 / 3):
        assert growth(L, exponent) < 0.02
        assert growth(6.2 * L, exponent) > 1.5


def test_a_disturbance_that_switches_undoes_the_printed_exponent_before_a_constant_one_does():
    for exponent, grows in ((0.5, True), (2 / 3, False)):
        gains = PAPER._replace(k2_exponent=exponent)
        sizes = [
            size(cascade(gains, Start(e2=1.0), 5.0, 5.5 * L, switch).observer_error, L)[-1000:]
            for switch in (WORST, (0.0, 0.0))
        ]
        assert (float(sizes[0].max()) > 0.3) is grows
        assert sizes[1].max() < 0.01


@pytest.mark.parametrize("rate", [0.0, 4.0 * L])
def test_the_observer_converges_in_finite_time(rate):
    """In the time that homogeneity says: an error of four times the rate takes twice as long."""
    times = []
    for e2 in (0.25, 1.0, 4.0):
        trace = cascade(PAPER, Start(e2=e2), 6.0, rate, WORST)
        away = size(trace.observer_error, L) > 0.01
        times.append(trace.time[away][-1])
        assert not away[-1]
    assert times[0] < 0.5
    np.testing.assert_allclose(np.divide(times[1:], times[:-1]), 2.0, rtol=0.15)


@pytest.mark.parametrize("rate", [0.0, 4.0 * L])
def test_sigma_reaches_zero_in_finite_time_and_stays_whatever_the_disturbance(rate):
    trace = cascade(PAPER, Start(sigma=1.0, e2=0.1), 3.0, rate, WORST)
    late = np.abs(trace.sigma[trace.time > 1.0])
    beta = 2.0 * trace.alpha[-1] + 5.0
    assert late.max() < 10.0 * STEP**2 * beta
    assert np.abs(trace.sigma[trace.time < 0.2]).min() > 0.1


def test_sigma_does_not_from_inside_the_dead_zone_with_alpha_zero():
    """(14) is not (12): the theorem has no dead zone, the paper's simulation has."""
    start = Start(sigma=0.04)
    late = [
        np.abs(cascade(gains, start, 5.0).sigma[-10000:]).max()
        for gains in (PAPER, PAPER._replace(dead_zone=0.0), PAPER._replace(alpha_start=2.0))
    ]
    assert late[0] > 0.04
    assert max(late[1:]) < 1e-5


@pytest.mark.parametrize("surface", [1.0, 2.0])
def test_the_error_then_decays_exponentially(surface):
    gains = PAPER._replace(surface=surface)
    trace = cascade(gains, Start(error=0.1, sigma=0.5, e2=1.0), 5.0, L, WORST)
    after = (trace.time > 2.0) & (trace.error > 1e-3)
    rates = np.diff(np.log(trace.error[after])[::1000]) / (1000 * STEP)
    assert len(rates) >= 4
    np.testing.assert_allclose(rates, -surface, rtol=0.02)


def run_of(scenario):
    return simulate(at_step(scenario, 5e-4), Law(implicit=True, super_twisting=PAPER), every=2)


def test_joints_behind_a_filter_are_no_match_for_the_observer():
    sampled = [sample("operation", PRESETS["ideal"], stream(0, TUNING, i)) for i in range(10)]
    for scenario in (named("nominal", "operation", PRESETS["ideal"]), *sampled):
        record = run_of(scenario)
        assert 1.0 < disturbance_rate(record)[record.time[1:] > 1.0].max() < L
        settled = record.time > 5.0
        assert np.abs(record.observer_error[settled]).max() < 1e-6
        assert np.abs(record.error[settled]).max() < 1e-6


def test_stepped_joints_break_the_premise_and_the_loop_stays_bounded():
    record = run_of(named("table1", "operation"))
    rate = disturbance_rate(record)
    assert rate[record.time[1:] > 5.0].max() > 50.0 * L
    assert 2e-3 < np.abs(record.error[record.time > 5.0]).max() < 2e-2
    shift = record.time > 20.0
    assert np.abs(record.observer_error[shift & (record.time < 20.1)]).max() > 1e-4
    calm = shift & (record.time > 22.0) & (record.time < 29.9)
    assert np.abs(record.observer_error[calm]).max() < 1e-6
