"""The compiled step is the step of docs/model.md, and the same for one robot and for many."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from support import dense_step
from support.dense_step import Moment
from support.swimming import swimmer

import usm_gym
from usm_gym import Conditions, Inspection, Robot, Scenario, Water, Wave
from usm_gym.simulation import Simulation
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import named, sample

Array = NDArray[np.float64]

IDEAL, BASIN, SEA = PRESETS["ideal"], PRESETS["basin"], PRESETS["sea"]
# What pushes and bends the robot in the sea; drawing the noise of sensors takes a while.
STIRRED = replace(
    SEA, velocity_period=None, tail_angle_noise=0.0, joint_angle_noise=0.0, rate_noise=0.0
)


def relative_error(actual: Moment, expected: Moment, before: Moment) -> float:
    """Return the largest error over all parts, each relative to how far that part moved."""
    errors = [
        np.max(np.abs(np.subtract(a, e))) / np.max(np.abs(np.subtract(e, b)))
        for a, e, b in zip(actual, expected, before, strict=True)
    ]
    return float(max(errors))


@pytest.mark.parametrize("hydrodynamics", ["consistent", "kelasidi2014"])
@pytest.mark.parametrize("integrator", ["midpoint", "explicit"])
@pytest.mark.parametrize("drag", ["linear and quadratic", "quadratic"])
@pytest.mark.parametrize("links", [2, 3, 8, 9, 10, 16, 17])
def test_one_step_agrees_with_the_dense_oracle(
    links: int, drag: str, integrator: str, hydrodynamics: str
) -> None:
    # Lag, saturation, dead-band, gains, waves, a coefficient of its own for every effect and link.
    robot = swimmer(links)
    rng = np.random.default_rng(links)
    conditions = replace(
        STIRRED,
        control_period=STIRRED.physics_step,
        integrator=integrator,
        hydrodynamics=hydrodynamics,
        drag=drag,
    )
    for _ in range(10):
        scenario = sample("operation", conditions, rng, robot)
        before = dense_step.random_moment(robot, rng, scenario.steps)
        action = rng.uniform(-1.5, 1.5, len(robot.thrusters)).astype(np.float32)
        action[0] *= 0.02  # now above, now below the smallest force
        simulation = Simulation([scenario])
        dense_step.place(simulation, before)
        simulation.step(action[np.newaxis])
        command = STIRRED.thruster_limit * np.clip(action.astype(float), -1.0, 1.0)
        expected = dense_step.advance(robot, scenario, before, command)
        assert relative_error(dense_step.read(simulation), expected, before) < 1e-12


@pytest.mark.parametrize("frequency", [8.0, None])
@pytest.mark.parametrize(("integrator", "step"), [("midpoint", 1e-3), ("explicit", 5e-5)])
def test_a_control_period_is_many_steps_under_one_command(
    integrator: str, step: float, frequency: float | None
) -> None:
    # The second change of the joint references falls inside a step.
    robot = Robot()
    conditions = replace(
        STIRRED, control_period=40 * step, physics_step=step, integrator=integrator
    )
    scenario = replace(
        sample("operation", conditions, np.random.default_rng(0)),
        inspection=Inspection(
            times=(60 * step, 150.3 * step),
            deflections=(1.2, -0.8),
            filter_frequency=frequency,
        ),
    )
    simulation = Simulation([scenario])
    start = moment = dense_step.read(simulation)
    rng = np.random.default_rng(1)
    for _ in range(6):
        action = rng.uniform(-1.0, 1.0, 5).astype(np.float32)
        simulation.step(action[np.newaxis])
        command = STIRRED.thruster_limit * action.astype(float)
        for _ in range(40):
            moment = dense_step.advance(robot, scenario, moment, command)
    assert moment.steps == 240
    assert relative_error(dense_step.read(simulation), moment, start) < 1e-9


def test_joints_may_have_gains_of_the_scenario() -> None:
    scenario = replace(named("table1", "operation"), joint_stiffness=900.0, joint_damping=15.0)
    scenario = replace(scenario, conditions=replace(IDEAL, control_period=IDEAL.physics_step))
    simulation = Simulation([scenario])
    before = dense_step.random_moment(Robot(), np.random.default_rng(0), scenario.steps)
    dense_step.place(simulation, before)
    simulation.step(np.zeros((1, 5), np.float32))
    expected = dense_step.advance(Robot(), scenario, before, np.zeros(5))
    assert relative_error(dense_step.read(simulation), expected, before) < 1e-12


BEND = Scenario(  # a smooth episode of everything that moves, but for the robot's commands
    duration=0.3,
    settle_time=0.0,
    conditions=Conditions(
        control_period=0.1, thruster_time_constant=0.1, thruster_limit=20.0, position_noise=0.0
    ),
    inspection=Inspection(times=(0.1,), deflections=(1.0,)),
    water=Water(
        current=(0.05, -0.03),
        amplitude=(0.05, 0.04),
        phase=(1.0, 2.0),
        period=10.0,
        waves=(Wave(amplitude=(0.02, -0.04), phase=0.5, period=2.0),),
    ),
)
THRUST = np.array([0.5, -0.4, 0.3, 0.6, -0.2], np.float32)  # over the limit, all along


def bend(step: float, integrator: str) -> Array:
    """Return angles (16) and position (2) after the smooth episode."""
    conditions = replace(BEND.conditions, physics_step=step, integrator=integrator)
    simulation = Simulation([replace(BEND, conditions=conditions)])
    for _ in range(simulation.scenarios[0].steps):
        simulation.step(THRUST[np.newaxis])
    return np.concatenate([simulation.read("theta")[0], simulation.read("position")[0]])


@cache
def exact_bend() -> Array:
    """Return the same by a method of order 8 on the equations of motion themselves."""
    robot, water, (wave,) = Robot(), BEND.water, BEND.water.waves
    n, k_p, k_d = robot.links, robot.joint_stiffness, robot.joint_damping
    w = BEND.inspection.filter_frequency
    assert w is not None
    bends = np.arange(n - 1) >= n - 1 - BEND.inspection.bending_joints

    def derivative(t: float, y: Array) -> Array:
        theta, theta_dot, p_dot = y[:n], y[n + 2 : -2], y[-2:]
        since = max(t - 0.1, 0.0)
        decay = np.exp(-w * since)
        phi_ref = bends / 11 * (1.0 - (1.0 + w * since) * decay)
        rate_ref = bends / 11 * (w * w * since * decay)
        torque = k_p * (phi_ref + np.diff(theta)) + k_d * (rate_ref + np.diff(theta_dot))
        thrust = 20.0 * THRUST * (1.0 - np.exp(-t / 0.1))
        rate, wave_rate = 2.0 * np.pi / water.period, 2.0 * np.pi / wave.period
        angle, wave_angle = rate * t + np.array(water.phase), wave_rate * t + wave.phase
        swing, wave_swing = np.array(water.amplitude), np.array(wave.amplitude)
        current = water.current + swing * np.sin(angle) + wave_swing * np.sin(wave_angle)
        theta_ddot, p_ddot = usm_gym.accelerations(
            robot, theta, theta_dot, p_dot, torque, thrust, current
        )
        p_ddot += swing * rate * np.cos(angle) + wave_swing * wave_rate * np.cos(wave_angle)
        return np.concatenate([theta_dot, p_dot, theta_ddot, p_ddot])

    y = np.zeros(2 * n + 4)
    for span in ((0.0, 0.1), (0.1, 0.3)):  # the reference has a corner at 0.1
        y = solve_ivp(derivative, span, y, method="DOP853", rtol=1e-9, atol=1e-12).y[:, -1]
    return y[: n + 2]


@pytest.mark.parametrize(
    ("integrator", "step", "order"), [("midpoint", 1e-3, 2.0), ("explicit", 1e-4, 1.0)]
)
def test_the_integrator_converges(integrator: str, step: float, order: float) -> None:
    errors = [np.abs(bend(step / k, integrator) - exact_bend()).max() for k in (1, 2, 4)]
    assert 0.0 < errors[0] < 1e-3
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, order, atol=0.1)


@pytest.mark.parametrize("links", [2, 3, 10, 16])
def test_robots_of_any_length_keep_still_and_stable(links: int) -> None:
    robot = swimmer(links)
    inspection = Inspection(bending_joints=1, times=(1.0, 3.0), deflections=(0.5, -0.5))
    scenario = Scenario(conditions=IDEAL, inspection=inspection, duration=6.0)
    simulation = Simulation([scenario])
    for _ in range(scenario.steps):
        simulation.step(np.zeros((1, len(robot.thrusters)), np.float32))
    theta = simulation.read("theta")[0]
    # The joint nearest to the head bends, the head turning to minus the deflection.
    np.testing.assert_allclose(np.diff(theta)[:-1], 0.0, atol=0.05)
    assert theta[-1] - theta[-2] == pytest.approx(0.5, abs=0.05)
    assert np.abs(simulation.read("position")[0]).max() < 0.5 * robot.link_length * links


def fastest(links: int, step: float, gains: tuple[float, float]) -> float:
    """Return the largest link rate, rad/s, under thrust and joint references that jump."""
    robot = swimmer(links)
    conditions = Conditions(control_period=0.02, physics_step=step, position_noise=0.0)
    bends = Inspection(
        bending_joints=links - 1, times=(1.0, 2.0), deflections=(1.5, -1.5), filter_frequency=None
    )
    scenario = Scenario(conditions=conditions, inspection=bends, duration=4.0, robot=robot)
    simulation = Simulation([replace(scenario, joint_stiffness=gains[0], joint_damping=gains[1])])
    rng, rates = np.random.default_rng(0), []
    for _ in range(20):
        action = rng.uniform(-1.0, 1.0, (1, len(robot.thrusters))).astype(np.float32)
        for _ in range(10):
            simulation.step(action)
            rates.append(np.abs(simulation.read("theta_dot")).max())
    return float(np.max(rates))  # not finite if any is


@pytest.mark.parametrize("gains", [(20.0, 5.0), (9000.0, 150.0), (2e5, 5e3)])
@pytest.mark.parametrize("links", [2, 3, 16, 17])
def test_stiff_joints_are_stable_at_coarse_steps(links: int, gains: tuple[float, float]) -> None:
    # Two links turn by half a radian in 20 ms, which no step with explicit angles survives.
    for step in (5e-3, 1e-2, 2e-2)[: 2 if links == 2 else 3]:
        # Control instants miss more of how the joints spring at a jump, the finer the step.
        assert fastest(links, step, gains) < 3.0 * fastest(links, 1e-3, gains)


def references_of(simulation: Simulation) -> Array:
    """Return joint references, their rates and accelerations now, (3, joints), in SI units."""
    names = ("joint_references", "joint_reference_rates", "joint_reference_accelerations")
    seen = simulation.observation[0] * simulation.layout.scale
    return np.stack([seen[simulation.layout.slices[name]] for name in names])


@pytest.mark.parametrize("integrator", ["midpoint", "explicit"])
@pytest.mark.parametrize("frequency", [6.0, 14.0])
def test_joint_references_follow_the_critically_damped_filter(
    frequency: float, integrator: str
) -> None:
    conditions = replace(IDEAL, physics_step=1e-4, integrator=integrator)
    inspection = Inspection(
        bending_joints=4, times=(0.2, 0.5), deflections=(1.2, -0.8), filter_frequency=frequency
    )
    simulation = Simulation([Scenario(conditions=conditions, inspection=inspection)])
    for k in range(1, 100):
        simulation.step(np.zeros((1, 5), np.float32))
        expected = np.zeros(3)
        for time, size in ((0.2, 1.2), (0.5, -2.0)):
            since = 0.02 * k - time
            if since > 1e-9:
                w, decay = frequency, np.exp(-frequency * since)
                expected += size * np.array(
                    [
                        1.0 - (1.0 + w * since) * decay,
                        w * w * since * decay,
                        w * w * (1.0 - w * since) * decay,
                    ]
                )
        references = references_of(simulation)
        assert not references[:, :11].any()  # the tail side keeps straight
        scale = np.array([1.0, frequency, frequency**2])[:, None]
        np.testing.assert_allclose(
            references[:, 11:] / scale, (expected[:, None] / 4 / scale).repeat(4, axis=1), atol=1e-6
        )


def test_joint_references_without_a_filter_are_steps() -> None:
    inspection = Inspection(
        bending_joints=4, times=(0.2, 0.4996), deflections=(1.2, -0.8), filter_frequency=None
    )
    scenario = Scenario(conditions=IDEAL, inspection=inspection)
    for copies in (1, 2):
        simulation = Simulation([scenario] * copies)
        for k in range(1, 40):
            simulation.step(np.zeros((copies, 5), np.float32))
            deflection = 0.0 if k <= 10 else 1.2 if k < 25 else -0.8
            expected = np.zeros((3, 15))
            expected[0, 11:] = deflection / 4
            np.testing.assert_allclose(references_of(simulation), expected, atol=1e-7)


def test_still_joints_have_no_reference() -> None:
    conditions = replace(IDEAL, motion=False)
    scenario = replace(named("nominal", "operation", conditions), duration=12.0)
    simulation = Simulation([scenario])
    for _ in range(scenario.steps):
        simulation.step(np.zeros((1, 5), np.float32))
        assert not references_of(simulation).any()


STEPS = 300


@cache
def mixture() -> tuple[Scenario, ...]:
    """Return twenty episodes of one timing that differ in everything else."""
    kinds = [
        ("operation", SEA),
        ("torpedo", PRESETS["field"]),
        ("operation", IDEAL),
        ("operation", replace(SEA, motion=False)),
        ("torpedo", BASIN),
    ]
    rng = np.random.default_rng(0)
    scenarios = []
    for k in range(20):
        mode, conditions = kinds[k % 5]
        scenario = sample(mode, conditions, rng)  # type: ignore[arg-type]
        # Sooner and sometimes oftener, so that the joints move from early on.
        times = tuple(np.sort(rng.uniform(0.5, 5.5, k % 4)).tolist())
        sizes = tuple(rng.uniform(-2.0, 2.0, k % 4).tolist())
        inspection = replace(scenario.inspection, times=times, deflections=sizes)
        if k % 7 == 3:
            inspection = replace(inspection, filter_frequency=None)
        guided = {"heading": "head"} if k % 3 else {"cross_track": True}
        scenarios.append(replace(scenario, inspection=inspection, **guided))
    return tuple(scenarios)


@cache
def actions() -> NDArray[np.float32]:
    """Return an action for every robot and step, beyond saturation at times."""
    rng = np.random.default_rng(1)
    return rng.normal(0.0, 0.6, (STEPS, 20, 5)).astype(np.float32)


def run(scenarios: Sequence[Scenario], first: int = 0) -> list[Array]:
    """Return all that can be seen of each robot, and its state at the end, (robots, numbers)."""
    size = len(scenarios)
    simulation = Simulation(scenarios)
    seen = [simulation.observation.copy()]
    for action in actions()[:, first : first + size, : simulation.world.thrusters]:
        simulation.step(action)
        seen += [
            simulation.observation.copy(),
            simulation.error.copy(),
            simulation.attitude_error.copy(),
        ]
    moments = [dense_step.read(simulation, k) for k in range(size)]
    return [*seen, np.stack([dense_step.flat(moment) for moment in moments])]


@cache
def alone() -> tuple[list[Array], ...]:
    return tuple(run(mixture()[k : k + 1], k) for k in range(20))


def same(one: Array, other: Array) -> bool:
    """Return whether two arrays have the same bits, but for the sign of zero."""
    return bool(((one == other) | (np.isnan(one) & np.isnan(other))).all())


@pytest.mark.parametrize("size", [2, 3, 7, 8, 9, 16, 17, 20])
def test_many_robots_have_the_bits_of_each_alone(size: int) -> None:
    together = run(mixture()[:size])
    for k in range(size):
        for many, one in zip(together, alone()[k], strict=True):
            assert same(many[k], one[0]), f"robot {k} of {size}"


@pytest.mark.parametrize("links", [2, 3, 8, 9, 17])
def test_robots_of_any_length_have_the_bits_of_each_alone(links: int) -> None:
    robot = swimmer(links)
    rng = np.random.default_rng(links)
    drawn = [sample("operation", SEA, rng, robot) for _ in range(3)]
    times, sizes = (1.0, 3.0, 5.0), (0.4, -0.3, 0.1)
    scenarios = [
        replace(s, inspection=replace(s.inspection, times=times, deflections=sizes)) for s in drawn
    ]
    together = run(scenarios)
    for k in range(3):
        for many, one in zip(together, run(scenarios[k : k + 1], k), strict=True):
            assert same(many[k], one[0])


def test_the_lane_does_not_matter() -> None:
    turned = run(mixture()[::-1][:9])
    # actions() are by place: give robot 19 - k those of place k.
    for k in range(9):
        simulation = Simulation([mixture()[19 - k]])
        for action in actions()[:, k : k + 1]:
            simulation.step(action)
        assert same(turned[-1][k], dense_step.flat(dense_step.read(simulation)))


def test_the_mixture_is_one() -> None:
    # Else the two tests above would compare little.
    ends = np.stack([one[-1][0] for one in alone()])
    assert np.isfinite(ends).all()
    assert len(np.unique(ends.round(6), axis=0)) == 20
    assert sum(bool(s.shifts) for s in mixture()) >= 8
