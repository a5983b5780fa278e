"""What laws share in space: allocation matrices, the attitude, and roll that is damped softly."""

from typing import Any

import numpy as np
import pytest
import usm_baselines
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from support.episodes import seen_by
from support.space import at_rest, place, random_state, state_of, wrench_of
from support.spatial_swimming import ROBOTS
from usm_baselines.laws.heading import HeadingGains
from usm_baselines.policy import HEADING_GAIN, ScriptedPolicy
from usm_baselines.signals import (
    ATTITUDE_LEAD,
    ROLL_DAMPING,
    ROLL_LIMIT,
    ROLL_SOFTNESS,
    Signals,
)

from usm_gym.simulation import Simulation
from usm_gym.spatial_robot import EELY

Array = NDArray[np.float64]

# Actions have 24 bits, of a limit of 200 N.
CLOSE = 3e-4
PITCH, YAW, ROLL = 3, 4, 5


class Asking(ScriptedPolicy):
    """A law that asks for a given force."""

    Gains = HeadingGains
    asked: Any = (0.0, 0.0, 0.0)

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        force[:] = self.asked


def wrench_asked(simulation: Simulation, **state: Any) -> Array:
    """Return what the law's thrusters do to a robot in a state, as of `wrench_of`."""
    policy = Asking(simulation.scenarios[0].nominal)
    action, _ = policy.predict(place(simulation, **state))
    forces = action * simulation.limit[0]
    return wrench_of(simulation.scenarios[0].body, state_of(simulation), forces)


@pytest.mark.parametrize("name", ["eely", "eely-uneven", "3 links", "8 links"])
def test_an_allocation_matrix_has_what_unit_forces_do(name: str) -> None:
    rng, robot = np.random.default_rng(0), ROBOTS[name]
    simulation = at_rest(robot=robot)
    thrusters = len(robot.thrusters)
    seen, expected = [], []
    for _ in range(10):
        seen.append(place(simulation, **random_state(robot, rng)))
        state, units = state_of(simulation), np.eye(thrusters)
        expected.append(np.transpose([wrench_of(robot, state, unit) for unit in units]))
    matrices = np.empty((10, 6, thrusters))
    simulation.world.allocate(np.array(seen), matrices)
    np.testing.assert_allclose(matrices, expected, atol=2e-6)


def test_of_the_straight_body_it_is_that_which_the_robot_was_checked_with() -> None:
    matrix = np.empty((1, 6, 7))
    simulation = at_rest()
    simulation.world.allocate(simulation.observation, matrix)
    np.testing.assert_allclose(matrix[0], EELY.straight_allocation(), atol=1e-12)


def test_thrusters_make_the_force_and_the_moments_and_yield_in_roll() -> None:
    rng, simulation = np.random.default_rng(1), at_rest(look_ahead=2.0)
    for _ in range(30):
        state = random_state(EELY, rng, bend=0.4)
        policy = Asking(simulation.scenarios[0].nominal)
        policy.asked = rng.normal(0.0, 5.0, 3)
        action, _ = policy.predict(place(simulation, **state))
        seen, forces = seen_by(simulation), action * simulation.limit[0]
        errors = np.array([seen["pitch_error"][0], seen["yaw_error"][0]])
        roll_rate, *rates = seen["angular_velocity"]
        ahead = errors + ATTITUDE_LEAD * (rates - seen["reference_rates"])
        damping = np.clip(-ROLL_DAMPING * roll_rate, -ROLL_LIMIT, ROLL_LIMIT)
        wanted = np.array([*policy.asked, *(-HEADING_GAIN * ahead), damping])
        made = wrench_of(EELY, state_of(simulation), forces)
        np.testing.assert_allclose(made[:ROLL], wanted[:ROLL], atol=CLOSE)
        # The least of forces and of what roll lacks, weighed against them.
        units = np.eye(7)
        matrix = np.transpose([wrench_of(EELY, state_of(simulation), unit) for unit in units])
        lack = np.zeros((6, 1))
        lack[ROLL] = ROLL_SOFTNESS
        expected = (np.linalg.pinv(np.hstack([matrix, lack])) @ wanted)[:7]
        np.testing.assert_allclose(forces, expected, atol=CLOSE)


@pytest.mark.parametrize("row", [PITCH, YAW])
@pytest.mark.parametrize("degrees", [-170, -30, 10, 90, 179, 190, 350])
def test_an_attitude_is_turned_back_the_short_way(row: int, degrees: int) -> None:
    axis = np.eye(3)[row - 2]
    turn = Rotation.from_rotvec(np.radians(degrees) * axis).as_quat(scalar_first=True)
    short = np.radians(degrees - 360 * round(degrees / 360))
    for attitude in (turn, -turn):
        made = wrench_asked(at_rest(), attitude=attitude)
        assert made[row] == pytest.approx(-HEADING_GAIN * short, rel=1e-5)
        made[row] = 0.0
        np.testing.assert_allclose(made[:ROLL], 0.0, atol=CLOSE)


@pytest.mark.parametrize("rate", [-3.0, -0.05, 0.02, 0.1, 3.0])
def test_roll_is_damped_by_no_more_than_is_asked(rate: float) -> None:
    made = wrench_asked(at_rest(), angular_velocity=(rate, 0.0, 0.0))
    asked = min(ROLL_DAMPING * abs(rate), ROLL_LIMIT)
    assert 0.3 * asked < -np.sign(rate) * made[ROLL] < asked
    np.testing.assert_allclose(made[:ROLL], 0.0, atol=CLOSE)
    # Nothing answers to the angle of roll itself: the keel does.
    tilted = wrench_asked(at_rest(), attitude=(np.cos(0.2), np.sin(0.2), 0.0, 0.0))
    np.testing.assert_allclose(tilted, 0.0, atol=CLOSE)


def turned_for(seconds: float, **state: Any) -> Simulation:
    """Return a robot that begins in a state and turns back by the attitude's controller alone."""
    simulation = at_rest(duration=60.0)
    policy: Any = usm_baselines.make("heading", simulation.scenarios[0].nominal)
    place(simulation, **state)
    memory = None
    for _ in range(round(seconds / 0.02)):
        action, memory = policy.predict(simulation.observation, memory)
        simulation.step(action)
    return simulation


@pytest.mark.parametrize(
    "vector", [(0.0, 0.4, -0.3), (0.0, -0.3, -0.5), (0.3, 0.2, 0.2), (0.0, 0.0, 2.5)]
)
def test_pitch_and_yaw_come_back_and_stay(vector: tuple[float, float, float]) -> None:
    attitude = Rotation.from_rotvec(vector).as_quat(scalar_first=True)
    simulation = turned_for(20.0, attitude=attitude)
    pitch, yaw, roll = simulation.attitude_error[0]
    assert max(abs(pitch), abs(yaw)) < 0.02
    assert abs(roll) < 0.1


def test_beyond_half_a_turn_the_robot_turns_on() -> None:
    turn = Rotation.from_euler("z", 200, degrees=True).as_quat(scalar_first=True)
    simulation = turned_for(2.0, attitude=turn)
    assert -np.radians(160) < simulation.attitude_error[0, 1] < 0.0
    assert simulation.read("angular_velocity")[0, 2] > 0.05


@pytest.mark.parametrize("id", ["sta", "pd", "pid", "ladrc", "smc", "gsta", "agsta"])
def test_laws_act_alike_alone_and_in_a_batch_and_whatever_the_sign_of_the_attitude(
    id: str,
) -> None:
    rng, simulation = np.random.default_rng(2), at_rest()
    policy: Any = usm_baselines.make(id, simulation.scenarios[0].nominal)
    part, flip = simulation.layout.slices["attitude"], np.ones(74, np.float32)
    flip[part] = -1.0
    batch = turned = None
    singles: list[Any] = [None] * 3
    for _ in range(5):
        states = [random_state(EELY, rng, bend=0.3) for _ in range(3)]
        seen = np.array([place(simulation, **state) for state in states])
        action, batch = policy.predict(seen, batch)
        assert action.shape == (3, 7)
        for k, now in enumerate(seen):
            alone, singles[k] = policy.predict(now, singles[k])
            np.testing.assert_array_equal(alone, action[k])
        other, turned = policy.predict(flip * seen, turned)
        np.testing.assert_array_equal(other, action)
