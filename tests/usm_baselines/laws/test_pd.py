"""The PD controller (21) in its three readings: what each is, and how far they lie apart."""

from typing import Any

import gymnasium as gym
import numba
import numpy as np
import pytest
import usm_baselines
from numpy.typing import NDArray
from support import laws
from support.episodes import HARDER
from usm_baselines.laws import pd
from usm_baselines.laws.pd import FORCE, MASS, OBSERVER, PDGains

import usm_gym
from usm_gym import Robot
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import named

Array = NDArray[np.float64]

READINGS = {"pd": FORCE, "pd-mass": MASS, "pd-observer": OBSERVER}


@numba.njit
def force(z1, z2, acceleration, mass, gains, reading, state):  # type: ignore[no-untyped-def]
    return pd.pd_force(z1, z2, acceleration, mass, gains, reading, state)


def expected_force(
    reading: int,
    mass: float,
    gains: PDGains,
    estimates: Array,
    corrections: tuple[float, float],
    acceleration: float,
) -> float:
    """Return the force of a reading; estimates are of the error, its rate and the disturbance."""
    p1, p2, p3 = estimates
    z1, z2 = corrections
    u_pd = gains.k_d * -p2 + gains.k_p * -p1
    if reading == FORCE:
        return float(u_pd)
    if reading == MASS:
        return float(mass * (acceleration + u_pd))
    return float(mass * (gains.surface * -(p2 + z1) - p3 - z2 + acceleration + u_pd))


def test_gains_of_the_paper() -> None:
    assert (PDGains().k_p, PDGains().k_d, PDGains().observer_gain) == (200.0, 6.0, 55.0)
    assert (PDGains().k2_exponent, PDGains().surface, PDGains().heading_gain) == (0.5, 1.0, 100.0)


@pytest.mark.parametrize("reading", [FORCE, MASS, OBSERVER])
def test_the_force_is_that_of_the_reading(reading: int) -> None:
    rng = np.random.default_rng(reading)
    for _ in range(100):
        values = rng.uniform(0.5, 3.0, 3)
        gains = PDGains(k_p=values[0], k_d=values[1], surface=values[2])
        z1, z2, acceleration = rng.normal(size=3).tolist()
        state = rng.normal(size=4)
        actual = force(z1, z2, acceleration, 10.0, gains, reading, state)
        expected = expected_force(reading, 10.0, gains, state[:3], (z1, z2), acceleration)
        assert actual == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("gains", [{}, {"k_p": 90.0, "k_d": 20.0, "surface": 2.0}])
@pytest.mark.parametrize("id", READINGS)
def test_the_policy_is_that_of_plain_python(id: str, gains: dict[str, float]) -> None:
    env = gym.make("USM-Torpedo-v0", conditions=HARDER)
    robot = Robot()
    policy = usm_baselines.make(id, env, **gains)
    observation, _ = env.reset(seed=5)
    all_gains = PDGains(**gains)
    observers = [laws.Observer(laws.observer_gains(55.0, 0.5), 0.02) for _ in range(2)]
    state, before = None, None
    for _ in range(200):
        action, state = policy.predict(observation, state)
        seen = laws.look(robot, observation)
        wanted = np.empty(2)
        for axis, watcher in enumerate(observers):
            corrections = (0.0, 0.0)
            if before is None:
                watcher.p = np.array([seen.y[axis], -seen.velocity[axis], 0.0])
            else:
                applied = before.T[axis] @ seen.command
                u = applied / robot.total_mass - seen.acceleration[axis]
                corrections = watcher.step(seen.y[axis], u)
            wanted[axis] = expected_force(
                READINGS[id],
                robot.total_mass,
                all_gains,
                watcher.p,
                corrections,
                seen.acceleration[axis],
            )
        np.testing.assert_allclose(
            action, laws.share_out(seen, wanted, 100.0), rtol=1e-5, atol=1e-5
        )
        before = seen
        observation, *_ = env.step(action)


def worst(id: str, conditions: str = "ideal", **gains: Any) -> Array:
    """Return the largest errors in the nominal operation, m, (2,)."""
    env = gym.make("USM-Operation-v0", conditions=conditions)
    scenario = named("nominal", "operation", PRESETS[conditions])
    scores = usm_gym.evaluate(usm_baselines.make(id, env, **gains), [scenario]).per_episode
    return np.array([scores["max_error_x"][0], scores["max_error_y"][0]])


def test_the_readings_lie_as_far_apart_as_documented() -> None:
    plain, mass, literal, sta = (worst(id) for id in (*READINGS, "sta"))
    assert (plain > 5.0 * mass).all()
    assert (mass > 5.0 * literal).all()
    assert (plain < 0.04).all()
    # The literal reading would beat the controller that the paper proposes.
    assert literal[0] < 0.5 * sta[0]


def test_a_stiffer_pd_is_better_and_one_without_gains_does_nothing() -> None:
    assert (worst("pd", k_p=800.0, k_d=60.0) < 0.5 * worst("pd")).all()
    nominal = gym.make("USM-Operation-v0").unwrapped.nominal
    idle = usm_baselines.make("pd", nominal, k_p=0.0, k_d=0.0, heading_gain=0.0)
    observation = np.random.default_rng(0).normal(size=94).astype(np.float32)
    observation[89] = 1.0  # the thruster limit
    np.testing.assert_array_equal(idle.predict(observation)[0], 0.0)


def test_an_unknown_reading_is_refused() -> None:
    nominal = gym.make("USM-Operation-v0").unwrapped.nominal
    with pytest.raises(ValueError, match="force, mass, observer"):
        pd.PD(nominal, "torque")  # type: ignore[arg-type]


@pytest.mark.parametrize("exponent", [0.4, 0.6, 1.0])
def test_other_exponents_are_refused(exponent: float) -> None:
    nominal = gym.make("USM-Operation-v0").unwrapped.nominal
    with pytest.raises(ValueError, match="k2_exponent"):
        pd.PD(nominal, k2_exponent=exponent)
