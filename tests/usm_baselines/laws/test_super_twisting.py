"""The super-twisting law is the paper's, step by step."""

import gymnasium as gym
import numba
import numpy as np
import pytest
import usm_baselines
from numpy.typing import NDArray
from support import laws
from support.episodes import HARDER
from usm_baselines.laws import super_twisting
from usm_baselines.laws.super_twisting import SuperTwistingGains

from usm_gym import Conditions, Robot
from usm_gym.task.conditions import FIELD

Array = NDArray[np.float64]

PAPER = SuperTwistingGains()
MASS = 10.0  # kg, of a double integrator


@numba.njit
def implicit_law(sigma, h, gains, state):  # type: ignore[no-untyped-def]
    u, state[0], state[1] = super_twisting.implicit_super_twisting(
        sigma, h, gains, state[0], state[1]
    )
    return u


@numba.njit
def explicit_law(sigma, h, gains, state):  # type: ignore[no-untyped-def]
    u, state[0], state[1] = super_twisting.explicit_super_twisting(
        sigma, h, gains, state[0], state[1]
    )
    return u


@numba.njit
def force(z1, z2, acceleration, h, mass, gains, implicit, state):  # type: ignore[no-untyped-def]
    return super_twisting.super_twisting_force(
        z1, z2, acceleration, h, mass, gains, implicit, state
    )


def gains_drawn(rng: np.random.Generator) -> SuperTwistingGains:
    """Draw gains, each for itself, so that none can stand in for another."""
    values = rng.uniform(0.3, 3.0, 5)
    return SuperTwistingGains(
        surface=values[0],
        epsilon=values[1],
        beta_offset=values[2],
        gamma=values[3],
        omega=4.0 * values[4],
        dead_zone=rng.uniform(0.01, 0.1),
    )


def test_gains_of_the_paper() -> None:
    assert PAPER == (55.0, 0.5, 1.0, 1.0, 1.0, 1.0, 8.0, 0.05, 0.0, 0.0, 100.0)


def test_the_implicit_step_solves_its_equation() -> None:
    # sigma+ = sigma + h u, u = -alpha |sigma+|^(1/2) sgn sigma+ + v+, v+ = v - h beta sgn sigma+.
    rng = np.random.default_rng(0)
    inside = outside = 0
    for _ in range(2000):
        gains = gains_drawn(rng)
        h = float(10.0 ** rng.uniform(-5, -1))
        alpha = float(rng.uniform(0.0, 20.0))
        beta = 2.0 * gains.epsilon * alpha + gains.beta_offset + 4.0 * gains.epsilon**2
        v = float(rng.normal())
        b = h * h * beta * 10.0 ** rng.uniform(-3, 6) * rng.choice([-1.0, 1.0])
        sigma = b - h * v
        state = np.array([v, alpha])
        u = implicit_law(sigma, h, gains, state)
        after = sigma + h * u
        xi = (v - state[0]) / (h * beta)
        rounding = 1e-14 * (abs(sigma) + abs(h * v) + abs(b))
        if abs(b) <= h * h * beta:
            inside += 1
            assert abs(after) <= rounding
            assert abs(xi) <= 1.0 + 1e-13 * abs(v) / (h * beta) + 1e-12
        else:
            outside += 1
            assert np.sign(after) == np.sign(b)
            assert xi == pytest.approx(np.sign(b), abs=1e-12 + 1e-13 * abs(v) / (h * beta))
            expected = -alpha * np.sqrt(abs(after)) * np.sign(b) + state[0]
            tolerance = 1e-12 * abs(u) + alpha * np.sqrt(rounding)
            assert u == pytest.approx(expected, rel=1e-9, abs=tolerance)
    assert min(inside, outside) > 200


def test_both_steps_are_those_of_plain_python() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        gains = gains_drawn(rng)
        h = float(10.0 ** rng.uniform(-4, -1))
        alpha, v = float(rng.uniform(0.0, 10.0)), float(rng.normal())
        law = laws.Twisting(
            h,
            gains.epsilon,
            gains.beta_offset,
            gains.gamma,
            gains.omega,
            gains.dead_zone,
            alpha,
            v,
        )
        implicit, explicit = np.array([v, alpha]), np.array([v, alpha])
        for sigma in rng.normal(0.0, 0.1, 20):
            before = explicit.copy()
            assert implicit_law(sigma, h, gains, implicit) == pytest.approx(
                law.step(sigma), rel=1e-6, abs=1e-9
            )
            np.testing.assert_allclose(implicit, [law.v, law.alpha], rtol=1e-9, atol=1e-12)
            sign = np.sign(sigma)
            assert explicit_law(sigma, h, gains, explicit) == pytest.approx(
                -before[1] * np.sqrt(abs(sigma)) * sign + before[0], rel=1e-12
            )
            beta = 2.0 * gains.epsilon * before[1] + gains.beta_offset + 4.0 * gains.epsilon**2
            assert explicit[0] == pytest.approx(before[0] - h * beta * sign, rel=1e-12)
            assert explicit[1] == pytest.approx(law.alpha, rel=1e-12)


@pytest.mark.parametrize("implicit", [True, False])
def test_the_force_is_equation_19(implicit: bool) -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        gains = gains_drawn(rng)
        state = np.concatenate([rng.normal(size=5), rng.uniform(0.0, 5.0, 1)])
        z1, z2, acceleration = rng.normal(size=3).tolist()
        p1, p2, p3 = state[:3]
        law = explicit_law if not implicit else implicit_law
        u_sta = law(gains.surface * p1 + p2, 0.02, gains, state[4:].copy())
        expected = MASS * (-gains.surface * (p2 + z1) - p3 - z2 + acceleration + u_sta)
        actual = force(z1, z2, acceleration, 0.02, MASS, gains, implicit, state)
        assert actual == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("gains", "surface", "beta"),
    [
        (SuperTwistingGains(surface=3.0), 3.0, 5.0),
        (SuperTwistingGains(beta_offset=3.0), 1.0, 7.0),
        (SuperTwistingGains(surface=2.0, beta_offset=0.5, epsilon=0.5), 2.0, 1.5),
    ],
)
def test_the_two_lambdas_are_separate(
    gains: SuperTwistingGains, surface: float, beta: float
) -> None:
    h = 1e-3
    # beta shows in how fast v turns, lambda of (10) in where sigma changes sign.
    state = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    state[0] = 1.0
    force(0.0, 0.0, 0.0, h, MASS, gains, False, state)
    assert state[4] == pytest.approx(-h * beta)
    turned = []
    for p2 in (-1.001 * surface, -0.999 * surface):
        state = np.array([1.0, p2, 0.0, 0.0, 0.0, 0.0])
        force(0.0, 0.0, 0.0, h, MASS, gains, False, state)
        turned.append(state[4])
    assert turned == [pytest.approx(h * beta), pytest.approx(-h * beta)]


@pytest.mark.parametrize("implicit", [True, False])
def test_alpha_grows_outside_the_dead_zone_only(implicit: bool) -> None:
    law = implicit_law if implicit else explicit_law
    rng = np.random.default_rng(0)
    for _ in range(200):
        gains = gains_drawn(rng)
        growth = 0.02 * gains.omega * np.sqrt(gains.gamma / 2.0)
        for share, grows in ((0.0, 0.0), (0.999, 0.0), (-0.999, 0.0), (1.001, 1.0), (-50.0, 1.0)):
            state = np.array([0.3, 2.0])
            law(share * gains.dead_zone, 0.02, gains, state)
            assert state[1] == pytest.approx(2.0 + grows * growth, rel=1e-14)


@pytest.mark.parametrize("implicit", [True, False])
def test_alpha_falls_inside_the_dead_zone_as_fast_as_it_grows_in_the_law_of_shtessel(
    implicit: bool,
) -> None:
    law = implicit_law if implicit else explicit_law
    rng = np.random.default_rng(1)
    for _ in range(200):
        gains = gains_drawn(rng)._replace(fall=1.0, alpha_start=0.3)
        change = 0.02 * gains.omega * np.sqrt(gains.gamma / 2.0)
        for alpha in (0.3, 0.3 + 0.5 * change, 0.3 + 2.0 * change):
            for share, sign in ((0.999, -1.0), (1.001, 1.0)):
                state = np.array([0.3, alpha])
                law(share * gains.dead_zone, 0.02, gains, state)
                assert state[1] == pytest.approx(max(alpha + sign * change, 0.3), rel=1e-12)


@pytest.mark.parametrize(
    "gains",
    [
        {},
        {
            "surface": 2.0,
            "beta_offset": 0.5,
            "k2_exponent": 2 / 3,
            "alpha_start": 1.0,
            "omega": 3.0,
        },
    ],
)
@pytest.mark.parametrize("conditions", [FIELD, HARDER], ids=["field", "harder"])
def test_the_policy_is_that_of_plain_python(
    conditions: Conditions, gains: dict[str, float]
) -> None:
    env = gym.make("USM-Operation-v0", conditions=conditions)
    robot = Robot()
    policy = usm_baselines.make("sta", env, **gains)
    observation, _ = env.reset(seed=3)
    paper = {**PAPER._asdict(), **gains}
    k = laws.observer_gains(paper["observer_gain"], paper["k2_exponent"])
    observers = [laws.Observer(k, 0.02) for _ in range(2)]
    twistings = [
        laws.Twisting(
            0.02, offset=paper["beta_offset"], omega=paper["omega"], alpha=paper["alpha_start"]
        )
        for _ in range(2)
    ]
    mass, state, before = robot.total_mass, None, None
    for _ in range(600):
        action, state = policy.predict(observation, state)
        seen = laws.look(robot, observation)
        wanted = np.empty(2)
        for axis, (watcher, twisting) in enumerate(zip(observers, twistings, strict=True)):
            if before is None:
                watcher.p = np.array([seen.y[axis], -seen.velocity[axis], 0.0])
                z1, z2 = 0.0, 0.0
            else:
                # The force that was applied: that of the angles at the time of the command.
                applied = before.T[axis] @ seen.command
                z1, z2 = watcher.step(seen.y[axis], applied / mass - seen.acceleration[axis])
            p1, p2, p3 = watcher.p
            u_sta = twisting.step(paper["surface"] * p1 + p2)
            wanted[axis] = mass * (
                -paper["surface"] * (p2 + z1) - p3 - z2 + seen.acceleration[axis] + u_sta
            )
        np.testing.assert_allclose(
            action, laws.share_out(seen, wanted, paper["heading_gain"]), rtol=1e-5, atol=1e-5
        )
        before = seen
        observation, *_ = env.step(action)
    assert np.abs(observation[env.unwrapped.layout.slices["joint_angles"]]).max() > 0.3


def test_the_input_is_the_force_less_the_reference_acceleration() -> None:
    # The last test would not notice a slip that it shares: here, the same by hand.
    env = gym.make("USM-Torpedo-v0", conditions={"position_noise": 0.0, "current_limit": 0.0})
    policy = usm_baselines.make("sta", env)
    observation, _ = env.reset(seed=1)
    layout = env.unwrapped.layout
    observation[layout.slices["position_error"]] = 0.0
    observation[layout.slices["reference_velocity"]] = 0.0
    observation[layout.slices["reference_acceleration"]] = np.array([0.3, -0.2]) / 0.1
    _, state = policy.predict(observation)
    still = observation.copy()  # straight and at rest: only x can be pushed without a turn
    still[layout.slices["thruster_command"]] = [0.5, 0.0, 0.0, 0.0, 0.0]
    _, state = policy.predict(still, state)
    limit, h = 20.0, 0.02
    u = np.array([0.5 * limit / Robot().total_mass - 0.3, 0.2])
    # Nothing moved though something pushed: the disturbance is the opposite of the push.
    own = np.stack(list(policy.state_of(state).values()), axis=-1)[0]
    np.testing.assert_allclose(own[:, 2], -u, rtol=1e-5)
    np.testing.assert_allclose(own[:, 1], 0.0, atol=1e-6 * h)


@pytest.mark.parametrize("exponent", [0.4, 0.6, 1.0])
def test_other_exponents_are_refused(exponent: float) -> None:
    nominal = gym.make("USM-Operation-v0").unwrapped.nominal
    with pytest.raises(ValueError, match="k2_exponent"):
        usm_baselines.make("sta", nominal, k2_exponent=exponent)
