"""The super-twisting law is the paper's, and has the properties that the paper proves of it."""

from typing import Any, NamedTuple

import gymnasium as gym
import numba
import numpy as np
import pytest
import usm_baselines
from numpy.typing import NDArray
from support import laws
from usm_baselines.estimation import observer
from usm_baselines.laws import super_twisting
from usm_baselines.laws.super_twisting import SuperTwistingGains

from usm_gym import Robot

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


@numba.njit
def alone(sigma, h, gains, implicit, state, trace):  # type: ignore[no-untyped-def]
    """sigma' = u_STA, and nothing else."""
    for i in range(trace.shape[0]):
        trace[i, 0], trace[i, 1] = sigma, state[1]
        if implicit:
            sigma += h * implicit_law(sigma, h, gains, state)
        else:
            sigma += h * explicit_law(sigma, h, gains, state)


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
    assert PAPER == (55.0, 0.5, 1.0, 1.0, 1.0, 1.0, 8.0, 0.05, 0.0, 100.0)


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
@pytest.mark.parametrize("conditions", ["field", "rough"])
def test_the_policy_is_that_of_plain_python(conditions: str, gains: dict[str, float]) -> None:
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
    own = state[0, 11:].reshape(2, 6)
    np.testing.assert_allclose(own[:, 2], -u, rtol=1e-5)
    np.testing.assert_allclose(own[:, 1], 0.0, atol=1e-6 * h)


@pytest.mark.parametrize("exponent", [0.4, 0.6, 1.0])
def test_other_exponents_are_refused(exponent: float) -> None:
    nominal = gym.make("USM-Operation-v0").unwrapped.nominal
    with pytest.raises(ValueError, match="k2_exponent"):
        usm_baselines.make("sta", nominal, k2_exponent=exponent)
