"""When sensors measure and how wrong they are, against a plain account of what arrives when."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support.episodes import seen_by
from support.space import mass_motion, state_of

from usm_gym import Conditions, Robot, Scenario
from usm_gym.simulation import Simulation
from usm_gym.support.seeding import EVALUATION, stream
from usm_gym.task.conditions import PRESETS
from usm_gym.task.modes import sample_of
from usm_gym.task.sampling import named, sample
from usm_gym.task.sensing import ANGLES, MISSING, POSITION, VELOCITY, Sensing, known
from usm_gym.task.water import WATER

Array = NDArray[np.float64]

FIELD, BASIN, SEA = (PRESETS[name] for name in ("field", "basin", "sea"))
LATE = Conditions(position_period=4, position_delay=6, velocity_period=3, velocity_delay=1)


def drawn(conditions: Conditions, seed: int = 0, mode: Any = "operation") -> Any:
    return sample_of(mode, conditions, stream(seed, EVALUATION, 0))


def velocity_of(simulation: Simulation) -> Array:
    """Return the velocities of the centres of mass, m/s, (robots, axes)."""
    if len(simulation.world.axes) == 2:
        return simulation.read("velocity")
    bodies = [scenario.body for scenario in simulation.scenarios]
    moving = [mass_motion(body, state_of(simulation, k))[1] for k, body in enumerate(bodies)]
    return np.array(moving)


def arrivals(period: int, delay: int, missing: list[bool]) -> list[int]:
    """When what is known was measured, by waiting for one message after the other."""
    under_way, newest, account = [], 0, []
    for now, lost in enumerate(missing):
        if now % period == 0 and not lost:
            under_way.append(now)
        while under_way and under_way[0] + delay <= now:
            newest = under_way.pop(0)
        account.append(newest)
    return account


@pytest.mark.parametrize("period", [1, 2, 5, 50])
@pytest.mark.parametrize("delay", [0, 1, 3, 15, 100])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.99])
def test_what_is_known_is_the_newest_that_has_arrived(
    period: int, delay: int, share: float
) -> None:
    missing = np.random.default_rng(period + delay).random(400) < share
    assert known(period, delay, missing).tolist() == arrivals(period, delay, missing.tolist())


@pytest.mark.parametrize(
    ("mode", "robots"), [("operation", 1), ("operation", 3), ("operation3d", 3)]
)
@pytest.mark.parametrize("conditions", [FIELD, LATE, BASIN, SEA], ids=["field", "late", "b", "s"])
def test_what_is_observed_was_true_when_it_was_measured(
    mode: str, conditions: Conditions, robots: int
) -> None:
    scenarios = [drawn(conditions, k, mode) for k in range(robots)]
    simulation = Simulation(scenarios)
    rng = np.random.default_rng(0)
    errors, velocities = [simulation.error.copy()], [velocity_of(simulation)]
    axes, given = len(simulation.world.axes), (robots, simulation.world.thrusters)
    measured = [scenario.sensing() for scenario in scenarios]
    ages: set[float] = set()
    for k in range(1, 250):
        simulation.step(rng.uniform(-0.3, 0.3, given).astype(np.float32))
        errors.append(simulation.error.copy())
        if conditions.velocity_period is not None:
            velocities.append(velocity_of(simulation))
        for robot, each in enumerate(measured):
            seen = seen_by(simulation, robot)
            at, velocity_at = each.taken[k].tolist()
            expected = np.clip(errors[at][robot] + each.position[at], -0.5, 0.5)  # its bound
            np.testing.assert_allclose(seen["position_error"], expected, rtol=1e-6, atol=1e-9)
            assert seen["position_age"] == pytest.approx((k - at) * 0.02, rel=1e-6)
            ages.add(k - at)
            if conditions.velocity_period is None:
                assert seen["velocity"].tolist() == [0.0] * axes
                assert seen["velocity_age"] == -1.0
            else:
                expected = velocities[velocity_at][robot] + each.others[velocity_at, :axes]
                np.testing.assert_allclose(seen["velocity"], expected, rtol=1e-6, atol=1e-8)
                assert seen["velocity_age"] == pytest.approx((k - velocity_at) * 0.02, rel=1e-6)
    assert len(ages) >= conditions.position_period


def test_a_measurement_is_held_until_the_next_one_arrives() -> None:
    simulation = Simulation([named("nominal", "operation", replace(BASIN, position_missing=0.0))])
    seen = [seen_by(simulation)]
    for _ in range(100):
        simulation.step(np.full((1, 5), 0.1, np.float32))
        seen.append(seen_by(simulation))
    positions = np.array([each["position_error"] for each in seen])
    changes = np.flatnonzero(np.diff(positions, axis=0).any(axis=1)) + 1
    assert changes.tolist() == list(range(8, 101, 5))  # taken at 5, 10, ... and 3 periods late
    age = np.array([each["position_age"][0] for each in seen]) / 0.02
    np.testing.assert_allclose(age[8:], 3 + (np.arange(8, 101) - 8) % 5, rtol=1e-6)


@pytest.mark.parametrize("links", [16, 4])
def test_angles_and_rates_have_the_errors_that_were_drawn(links: int) -> None:
    thrusters = [
        {"link": 1, "direction": "axial"},
        {"link": 1, "direction": "normal"},
        {"link": 3, "direction": "normal"},
    ]
    robot = Robot() if links == 16 else Robot(links=4, thrusters=thrusters)  # type: ignore[arg-type]
    scenario = sample("operation", SEA, stream(3, EVALUATION, 0), robot)
    simulation, noise = Simulation([scenario]), scenario.sensing().others[:, 2:].astype(float)
    for k in range(1, 60):
        simulation.step(np.full((1, len(robot.thrusters)), 0.1, np.float32))
        seen, theta = seen_by(simulation), simulation.read("theta")[0]
        omega, joints = simulation.read("theta_dot")[0], links - 1
        close: dict[str, Any] = {"rtol": 1e-6, "atol": 1e-8}
        np.testing.assert_allclose(seen["tail_angle"][0], theta[0] + noise[k, 0], **close)
        angles = -np.diff(theta) + noise[k, 1 : 1 + joints]
        np.testing.assert_allclose(seen["joint_angles"], angles, **close)
        np.testing.assert_allclose(seen["tail_rate"][0], omega[0] + noise[k, links], **close)
        rates = -np.diff(omega) + noise[k, links + 1 :]
        np.testing.assert_allclose(seen["joint_rates"], rates, **close)
        # The heading is what the measured angles make of it; what counts is the true one.
        heading = (seen["tail_angle"][0] - np.r_[0.0, seen["joint_angles"]].cumsum()).mean()
        np.testing.assert_allclose(seen["heading_error"][0], heading, rtol=1e-5, atol=1e-7)
        np.testing.assert_allclose(simulation.attitude_error[0, 0], theta.mean(), **close)


def test_errors_have_the_size_of_the_conditions_and_no_memory() -> None:
    sensing = drawn(SEA).sensing()
    assert sensing.position.shape == (3001, 2)  # the start is measured too
    assert sensing.others.shape == (3001, 2 + 2 * 16)
    sizes = [0.03] * 2 + [5e-3] * 2 + [2e-3] + [1e-3] * 15 + [2e-3] * 16
    unit = np.hstack([sensing.position, sensing.others]) / sizes
    np.testing.assert_allclose(unit.std(axis=0), 1.0, rtol=0.06)
    np.testing.assert_allclose(unit.mean(axis=0), 0.0, atol=0.08)
    np.testing.assert_allclose(np.corrcoef(unit.T), np.eye(36), atol=0.09)
    for lag in (1, 2):
        assert abs(np.corrcoef(unit[:-lag].ravel(), unit[lag:].ravel())[0, 1]) < 0.02
    tail = np.abs(unit) > 1.96
    assert tail.mean() == pytest.approx(0.05, abs=0.005)


def test_as_many_fixes_are_missing_as_the_conditions_say() -> None:
    for share in (0.0, 0.05, 0.5):
        conditions = replace(FIELD, position_missing=share)
        taken = np.concatenate([drawn(conditions, k).sensing().taken[1:, 0] for k in range(5)])
        fresh = taken == np.tile(np.arange(1, 2001), 5)
        assert 1.0 - fresh.mean() == pytest.approx(share, abs=0.015)


def units(sensing: Sensing, conditions: Conditions) -> Array:
    angles = [conditions.tail_angle_noise, *[conditions.joint_angle_noise] * 15]
    sizes = [conditions.velocity_noise] * 2 + angles + [conditions.rate_noise] * 16
    return np.hstack([sensing.position / conditions.position_noise, sensing.others / sizes])


def test_other_conditions_stretch_the_same_measurements() -> None:
    sea = drawn(SEA)
    other = replace(
        SEA,
        position_noise=1e-3,
        position_period=1,
        position_missing=0.2,
        velocity_period=4,
        velocity_noise=0.1,
        tail_angle_noise=0.05,
        joint_angle_noise=0.02,
        rate_noise=0.3,
    )
    ours, theirs = sea.sensing(), sea.under(other).sensing()
    np.testing.assert_allclose(units(ours, SEA), units(theirs, other), rtol=1e-5)
    # In field, the noise of the position is that of before there were other sensors.
    field = sea.under(FIELD).sensing()
    assert field.others.size == 0
    seed = np.random.SeedSequence(sea.noise_seed, spawn_key=(0,))
    unit = np.random.default_rng(seed).standard_normal((3001, 2))
    np.testing.assert_array_equal(field.position, 5e-5 * unit)
    np.testing.assert_allclose(ours.position / 0.03, unit)
    # A shorter episode is the beginning of a longer one.
    for whole, part in zip(ours, replace(sea, duration=10.0).sensing(), strict=True):
        np.testing.assert_array_equal(whole[:501], part)


def test_what_is_missing_stays_missing_when_more_is() -> None:
    def missed(share: float, **fields: int) -> set[int]:
        conditions = replace(FIELD, position_missing=share, **fields)  # type: ignore[arg-type]
        taken = drawn(FIELD).under(conditions).sensing().taken[:, 0]
        return set(range(taken.size)) - set(taken.tolist())

    few, many = missed(0.02), missed(0.2)
    assert few < many
    # Other noise and a delay change none of it; of rarer fixes, those are missing that were.
    assert missed(0.02, position_delay=0, velocity_period=1) == few
    every_fifth = set(range(0, 2001, 5))
    assert missed(0.2, position_period=5) & every_fifth == many & every_fifth


def test_every_sensor_has_a_stream_of_its_own() -> None:
    keys = (POSITION, WATER, VELOCITY, ANGLES, MISSING)
    seeds = [np.random.SeedSequence(7, spawn_key=(key,)) for key in keys]
    firsts = {np.random.default_rng(seed).random() for seed in seeds}
    assert len(firsts) == len(keys) == len(set(keys))


def test_after_its_end_an_episode_leaves_nothing_of_another_one() -> None:
    # A robot that waits for the others goes on with what it last knew, whatever ran there before.
    short = replace(drawn(SEA), duration=1.0)
    long, other = drawn(SEA, 1), drawn(BASIN, 2)
    fresh, used = Simulation([short, long]), Simulation([other, long])
    rng = np.random.default_rng(0)
    for _ in range(80):
        used.step(rng.uniform(-0.2, 0.2, (2, 5)).astype(np.float32))
    used.start(0, short)
    used.start(1, long)
    ages = []
    for _ in range(90):
        action = rng.uniform(-0.2, 0.2, (2, 5)).astype(np.float32)
        fresh.step(action)
        used.step(action)
        np.testing.assert_array_equal(fresh.observation, used.observation)
        ages.append(seen_by(fresh)["velocity_age"][0])
    assert max(ages) < 15.5 * 0.02  # never older than a period of 10 and a delay of 5


@pytest.mark.parametrize("conditions", [BASIN, SEA], ids=["basin", "sea"])
def test_restored_a_simulation_goes_on_with_the_same_bits(conditions: Conditions) -> None:
    scenarios = [drawn(conditions, k) for k in range(3)]
    given = np.random.default_rng(0).uniform(-0.3, 0.3, (150, 3, 5)).astype(np.float32)
    simulation = Simulation(scenarios)
    for action in given[:70]:
        simulation.step(action)
    snapshot = simulation.snapshot()

    def rest(of: Simulation) -> Array:
        seen = []
        for action in given[70:]:
            of.step(action)
            seen.append(of.observation.copy())
        return np.array(seen)

    after = rest(simulation)
    stranger = Simulation([Scenario()] * 3)  # has other conditions and has kept nothing so far
    for copy in (simulation, stranger):
        copy.restore(snapshot)
        np.testing.assert_array_equal(rest(copy), after)
