"""The compiled step in space is that of docs/model_spatial.md, for one robot and for many."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from support import dense_spatial_step as dense
from support import spatial_oracle as oracle
from support.dense_spatial_step import Episode, Moment
from support.spatial_kernels import Swimmers
from support.spatial_swimming import ROBOTS, attitude_rate, random_chain, without_drag

from usm_gym.spatial_robot import EELY, EELY_NEUTRAL, SpatialRobot

Array = NDArray[np.float64]

IDLE = np.zeros(len(EELY.thrusters))


def relative_error(actual: Moment, expected: Moment, before: Moment) -> float:
    """Return the largest error over all parts, each relative to how far that part moved."""
    errors = [
        np.max(np.abs(np.subtract(a, e))) / np.max(np.abs(np.subtract(e, b)))
        for a, e, b in zip(actual, expected, before, strict=True)
    ]
    return float(max(errors))


@pytest.mark.parametrize("euler", [False, True], ids=["midpoint", "euler"])
@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
def test_one_step_agrees_with_the_dense_one(robot: SpatialRobot, euler: bool) -> None:
    rng, size = np.random.default_rng(0), 4
    episodes = [dense.random_episode(robot, rng, euler=euler) for _ in range(size)]
    moments = [dense.random_moment(robot, rng) for _ in range(size)]
    actions = rng.uniform(-1.5, 1.5, (size, len(robot.thrusters)))
    actions[:, 0] *= 0.2  # now above, now below the smallest force
    swimmers = Swimmers(robot, episodes, moments)
    swimmers.step(actions)
    for k, (episode, before) in enumerate(zip(episodes, moments, strict=True)):
        command = episode.limit * np.clip(actions[k], -1.0, 1.0)
        expected = dense.advance(robot, episode, before, command)
        assert relative_error(swimmers.moment(k), expected, before) < 1e-11


@pytest.mark.parametrize("frequency", [6.0, 0.0])
@pytest.mark.parametrize(("euler", "step"), [(False, 2e-3), (True, 1e-4)])
def test_a_control_period_is_many_steps_under_one_command(
    euler: bool, step: float, frequency: float
) -> None:
    # The changes of the joint references fall into steps and between two.
    robot, rng = random_chain(4), np.random.default_rng(0)
    robot = replace(robot, joint_stiffness=50.0, joint_damping=10.0)
    shifts = step * np.array([3.0, 17.3, 30.999])
    episode = dense.random_episode(
        robot, rng, euler=euler, step=step, frequency=frequency, shifts=shifts
    )
    start = moment = dense.start(robot)
    swimmers = Swimmers(robot, [episode], [start], substeps=20)
    for _ in range(2):
        action = rng.uniform(-1.0, 1.0, len(robot.thrusters))
        swimmers.step(action)
        for _ in range(20):
            moment = dense.advance(robot, episode, moment, episode.limit * action)
    assert moment.steps == 40
    assert relative_error(swimmers.moment(), moment, start) < 1e-10


def turning(robot: SpatialRobot, seed: int = 0, **changes: Array) -> Moment:
    """Return a moment in which a robot coasts along and turns, its joints at rest and straight."""
    rng = np.random.default_rng(seed)
    moment = dense.start(robot)._replace(
        quaternion=dense.unit_quaternion(rng),
        velocity=rng.normal(0.0, 0.5, 3),
        angular_velocity=rng.normal(0.0, 0.5, 3),
    )
    return moment._replace(**changes)


# A smooth episode of everything that moves a robot of uneven links and axes.
CHAIN = replace(random_chain(4), joint_stiffness=10.0, joint_damping=2.0)
SHIFT, END = 0.1, 0.3  # s
BEND = Episode(
    step=1e-3,
    current=np.array([0.05, -0.03, 0.02]),
    amplitudes=np.array([[0.05, 0.04, -0.03], [0.02, -0.04, 0.03]]),
    phases=np.array([[1.0, 2.0, 3.0], [0.5, 0.5, 0.5]]),
    frequencies=np.array([0.6, 3.1]),
    shifts=np.array([SHIFT]),
    sizes=np.array([[0.8, 0.4]]),
    shares=np.array([[0.5, 0.0, 0.5], [0.0, 1.0, -0.5]]),
    frequency=8.0,
    time_constant=0.1,
    limit=10.0,
)
THRUST = np.linspace(-0.5, 0.6, len(CHAIN.thrusters))  # over the limit, all along


def bend(step: float, euler: bool) -> tuple[Array, Array, Array]:
    """Return position, attitude and joint angles after the smooth episode."""
    episode = BEND._replace(step=step, euler=euler)
    swimmers = Swimmers(CHAIN, [episode], [turning(CHAIN)], substeps=round(END / step))
    swimmers.step(THRUST)
    end = swimmers.moment()
    return end.position, end.quaternion, end.joint_angles


@pytest.fixture(scope="module")
def exact_bend() -> tuple[Array, Array, Array]:
    """Return the same by a method of order 8 on the equations of motion of the oracle."""
    start, w = turning(CHAIN), BEND.frequency
    bends = BEND.sizes[0] @ BEND.shares
    parts = (
        *(start.position, start.quaternion, start.joint_angles),
        *(start.velocity, start.angular_velocity, start.joint_rates),
    )
    ends = np.cumsum([part.size for part in parts])[:-1]

    def derivative(t: float, y: Array) -> Array:
        _, quaternion, angles, velocity, omega, rates = np.split(y, ends)
        since = max(t - SHIFT, 0.0)
        decay = np.exp(-w * since)
        angle_error = bends * (1.0 - (1.0 + w * since) * decay) - angles
        torque = CHAIN.joint_stiffness * angle_error
        torque += CHAIN.joint_damping * (bends * w * w * since * decay - rates)
        thrust = BEND.limit * THRUST * (1.0 - np.exp(-t / BEND.time_constant))
        unit = quaternion / np.linalg.norm(quaternion)
        linear, angular, joint = oracle.accelerations(
            *(CHAIN, unit, omega, velocity, angles, rates, torque, thrust),
            *dense.water_at(BEND, t),
        )
        turn = attitude_rate(quaternion, omega)
        return np.concatenate([velocity, turn, rates, linear, angular, joint])

    y = np.concatenate(parts)
    for span in ((0.0, SHIFT), (SHIFT, END)):  # the reference has a corner there
        y = solve_ivp(derivative, span, y, method="DOP853", rtol=1e-8, atol=1e-11).y[:, -1]
    position, quaternion, angles, *_ = np.split(y, ends)
    return position, quaternion / np.linalg.norm(quaternion), angles


@pytest.mark.parametrize(("euler", "step", "order"), [(False, 2e-3, 2.0), (True, 1e-4, 1.0)])
def test_the_integrator_converges(
    euler: bool, step: float, order: float, exact_bend: tuple[Array, Array, Array]
) -> None:
    runs = [bend(step / k, euler) for k in (1, 2, 4)]
    errors = np.array(
        [[np.abs(a - e).max() for a, e in zip(run, exact_bend, strict=True)] for run in runs]
    )
    assert np.all(errors[0] < 1e-3)
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), order, atol=0.1)


def fastest(step: float, gains: tuple[float, float]) -> float:
    """Return the largest joint rate, rad/s, under thrust and joint references that jump."""
    robot = replace(EELY, joint_stiffness=gains[0], joint_damping=gains[1])
    shares = np.array([np.tile([0.5, 0.0], 4), np.tile([0.0, -0.5], 4)])
    sizes = np.array([[0.8, 0.4], [-1.6, -0.8]])
    episode = Episode(step, shifts=np.array([1.0, 2.0]), sizes=sizes, shares=shares)
    swimmers = Swimmers(robot, [episode], [dense.start(robot)], substeps=round(0.02 / step))
    rng, rates = np.random.default_rng(0), []
    for _ in range(20):
        action = rng.uniform(-1.0, 1.0, len(robot.thrusters))
        for _ in range(10):
            swimmers.step(action)
            rates.append(np.abs(swimmers.moment().joint_rates).max())
    return float(np.max(rates))  # not finite if any is


@pytest.mark.parametrize("gains", [(1e3, 200.0), (9e3, 1500.0), (1e5, 1e4)])
def test_stiff_joints_are_stable_at_coarse_steps(gains: tuple[float, float]) -> None:
    usual = fastest(1e-3, gains)
    for step in (5e-3, 1e-2, 2e-2):
        # Control instants miss more of how the joints spring at a jump, the finer the step.
        assert fastest(step, gains) < 2.0 * usual


def test_the_quaternion_keeps_its_length() -> None:
    start = turning(EELY, angular_velocity=np.array([5.0, -3.0, 4.0]))
    swimmers = Swimmers(EELY, [Episode(step=1e-2)], [start], substeps=100)
    for _ in range(50):
        swimmers.step(IDLE)
        assert abs(np.linalg.norm(swimmers.moment().quaternion) - 1.0) < 1e-15


def test_a_neutral_robot_with_free_joints_stays_as_it_is() -> None:
    robot = replace(EELY_NEUTRAL, joint_stiffness=0.0, joint_damping=0.0)
    drawn = dense.random_moment(robot, np.random.default_rng(0))
    start = dense.start(robot)._replace(
        position=drawn.position, quaternion=drawn.quaternion, joint_angles=drawn.joint_angles
    )
    swimmers = Swimmers(robot, [Episode(step=1e-3)], [start], substeps=1000)
    swimmers.step(IDLE)
    end = swimmers.moment()
    np.testing.assert_allclose(end.quaternion, start.quaternion, rtol=0.0, atol=1e-15)
    for part, given in zip(end[1:], start[1:], strict=True):
        if part.shape != (4,):
            np.testing.assert_array_equal(part, given)


def test_water_that_speeds_up_takes_a_neutral_robot_along() -> None:
    # From 0 to 0.3 m/s and back: whatever the robot's shape, it has the water's velocity.
    robot = replace(EELY_NEUTRAL, joint_stiffness=0.0, joint_damping=0.0)
    drawn = dense.random_moment(robot, np.random.default_rng(0))
    start = dense.start(robot)._replace(
        quaternion=drawn.quaternion, joint_angles=drawn.joint_angles
    )
    wave = Episode(
        step=1e-3,
        amplitudes=np.array([[0.1, -0.2, 0.2]]),
        phases=np.zeros((1, 3)),
        frequencies=np.array([np.pi]),
    )
    swimmers = Swimmers(robot, [wave], [start], substeps=500)
    for half in (1, 2):
        swimmers.step(IDLE)
        end = swimmers.moment()
        velocity, _ = dense.water_at(wave, 0.5 * half)
        np.testing.assert_allclose(end.velocity, velocity, rtol=0.0, atol=1e-6)
        np.testing.assert_allclose(end.joint_angles, start.joint_angles, rtol=0.0, atol=1e-6)


def test_the_keel_rights_a_robot() -> None:
    # Rolled by 137 degrees, in water so viscous that it does not swing for long.
    robot = replace(EELY, linear_drag=20.0)
    rolled = np.array([np.cos(1.2), np.sin(1.2), 0.0, 0.0])
    start = dense.start(robot)._replace(quaternion=rolled)
    swimmers = Swimmers(robot, [Episode(step=1e-2)], [start], substeps=1000)
    swimmers.step(IDLE)
    up = oracle.rotation_of(swimmers.moment().quaternion)[:, 2]
    np.testing.assert_allclose(up, [0.0, 0.0, 1.0], rtol=0.0, atol=1e-3)


def energies(robot: SpatialRobot, step: float) -> Array:
    """Return the energy of a robot that coasts for 1 s with free joints, every 10 ms, J."""
    robot = replace(robot, joint_stiffness=0.0, joint_damping=0.0)
    rates = np.linspace(-1.0, 1.0, len(robot.joint_axes))
    start = turning(robot, joint_angles=-0.5 * rates, joint_rates=rates)
    swimmers = Swimmers(robot, [Episode(step)], [start], substeps=round(1e-2 / step))
    found = []
    for _ in range(101):
        now = swimmers.moment()
        found.append(
            oracle.energy(
                *(robot, now.quaternion, now.angular_velocity, now.velocity),
                *(now.joint_angles, now.joint_rates, now.position),
            )
        )
        swimmers.step(IDLE)
    return np.array(found)


def test_drag_takes_energy_in_every_step() -> None:
    for step in (1e-3, 1e-2):
        assert np.all(np.diff(energies(EELY, step)) < 0.0)


def test_without_drag_energy_changes_by_the_error_of_the_step_alone() -> None:
    changes = [np.abs(np.diff(energies(without_drag(EELY), h))).sum() for h in (2e-3, 1e-3, 5e-4)]
    np.testing.assert_allclose(np.log2(np.divide(changes[:-1], changes[1:])), 2.0, atol=0.2)


def mixture(size: int) -> tuple[list[Episode], list[Moment], Array]:
    """Return episodes, moments and actions over twenty periods that differ in everything."""
    rng = np.random.default_rng(0)
    episodes = [dense.random_episode(EELY, rng, step=5e-3) for _ in range(size)]
    moments = [dense.random_moment(EELY, rng, steps=20) for _ in range(size)]
    return episodes, moments, rng.normal(0.0, 0.6, (20, size, IDLE.size))


def test_a_robot_has_the_same_bits_alone_and_in_any_lane_of_any_block() -> None:
    episodes, moments, actions = mixture(20)
    alone, together, turned = (Swimmers(EELY, episodes, moments, substeps=4) for _ in range(3))
    turned.rows = turned.rows[::-1]
    for action in actions:
        alone.step(action)
        together.step_side_by_side(action)
        turned.step_side_by_side(action[::-1])
    ends = [dense.flat(alone.moment(k)) for k in range(20)]
    for k, end in enumerate(ends):
        np.testing.assert_array_equal(dense.flat(together.moment(k)), end)
        np.testing.assert_array_equal(dense.flat(turned.moment(19 - k)), end)
    # Else the above would compare little.
    assert np.isfinite(ends).all()
    assert len(np.unique(np.round(ends, 6), axis=0)) == 20
