"""What the spatial robot observes, against NumPy and SciPy: any attitude, any shape, any time."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from support.episodes import seen_by
from support.space import REST, at_rest, mass_motion, place, random_state
from support.spatial_swimming import ROBOTS, attitude_rate

from usm_gym import Conditions, Scan, SpatialPath, SpatialScenario
from usm_gym.simulation import Simulation
from usm_gym.spatial_posture import centre_of_mass, link_poses, roll_pitch_yaw
from usm_gym.spatial_robot import EELY
from usm_gym.task.conditions import SPATIAL_PRESETS

Array = NDArray[np.float64]

# Turns about x, y and z.
ANGLES = ("roll_error", "pitch_error", "yaw_error")
# What is observed has 24 bits.
CLOSE: dict[str, Any] = {"rtol": 3e-7, "atol": 3e-7}
EXACT = replace(SPATIAL_PRESETS["ideal"], velocity_period=1)
PATH = SpatialPath(
    speed=0.1, sway=0.3, sway_frequency=0.4, heave=0.2, heave_frequency=0.6, ramp=2.0
)


def made(name: str = "eely", **changes: Any) -> SpatialScenario:
    """Return an episode on a path of its own, all of which is measured exactly."""
    fields = {"path": PATH, "conditions": EXACT, "robot": ROBOTS[name], **changes}
    return replace(REST, **fields)


def reference(path: SpatialPath, time: float) -> Array:
    """Return where the centre of mass shall be, m."""
    s = time**2 / (2.0 * path.ramp) if time < path.ramp else time - path.ramp / 2.0
    sway, heave = np.sin(path.sway_frequency * s), np.sin(path.heave_frequency * s)
    return np.array([path.speed * s, path.sway * sway, path.heave * heave])


def slope(function: Any, at: float, step: float = 1e-4) -> Array:
    return np.asarray((function(at + step) - function(at - step)) / (2.0 * step))


def aim(scenario: SpatialScenario, error: Array, time: float) -> Array:
    """Return the references of pitch and yaw, rad, as the line of sight has them."""
    if scenario.look_ahead is None:
        return np.zeros(2)
    beside = error if scenario.cross_track else error + reference(scenario.path, time)
    return np.arctan2([beside[2], -beside[1]], scenario.look_ahead)


def attitude_error(attitude: Array, pitch: float, yaw: float) -> Array:
    """Return the rotation vector from a yaw, then a pitch, to an attitude, in the body's axes."""
    asked = Rotation.from_euler("ZY", [yaw, pitch])
    turn = asked.inv() * Rotation.from_quat(attitude, scalar_first=True)
    return np.asarray(turn.as_rotvec())


@pytest.mark.parametrize("look_ahead", [None, 2.0])
@pytest.mark.parametrize("cross_track", [False, True])
@pytest.mark.parametrize("name", ["eely", "3 links", "8 links"])
def test_all_that_is_measured_is_true(
    name: str, cross_track: bool, look_ahead: float | None
) -> None:
    rng = np.random.default_rng(0)
    scenario = made(name, cross_track=cross_track, look_ahead=look_ahead)
    robot, simulation = scenario.body, Simulation([scenario] * 9)
    for k in range(20):
        index, time = k % 9, rng.uniform(0.0, 30.0) if k % 2 else rng.uniform(0.0, PATH.ramp)
        state, error = random_state(robot, rng), rng.uniform(-0.4, 0.4, 3)
        time = round(time, 3)
        state["position"] = reference(PATH, time) + error - mass_motion(robot, state)[0]
        place(simulation, index, time, **state)
        seen = seen_by(simulation, index)
        np.testing.assert_allclose(seen["position_error"], error, **CLOSE)
        np.testing.assert_allclose(simulation.error[index], error, atol=1e-12)
        velocity = slope(partial(reference, PATH), time)
        np.testing.assert_allclose(seen["reference_velocity"], velocity, atol=1e-4)
        acceleration = slope(partial(slope, partial(reference, PATH)), time)
        if abs(time - PATH.ramp) > 1e-3:
            np.testing.assert_allclose(seen["reference_acceleration"], acceleration, atol=1e-5)
        attitude = np.copysign(1.0, state["attitude"][0]) * state["attitude"]
        np.testing.assert_allclose(seen["attitude"], attitude, **CLOSE)
        np.testing.assert_allclose(seen["angular_velocity"], state["angular_velocity"], **CLOSE)
        for entry in ("joint_angles", "joint_rates"):
            np.testing.assert_allclose(seen[entry], state[entry], **CLOSE)
        roll, pitch, yaw = attitude_error(state["attitude"], *aim(scenario, error, time))
        expected = {"pitch_error": pitch, "yaw_error": yaw, "roll_error": roll}
        for entry, angle in expected.items():
            np.testing.assert_allclose(seen[entry], [angle], rtol=3e-7, atol=1e-6)
        known = simulation.attitude_error[index]
        np.testing.assert_allclose(known, [pitch, yaw, roll], rtol=1e-9, atol=1e-9)
        # As long as the robot moves as its reference does.
        rates = slope(partial(aim, scenario, error), time)
        np.testing.assert_allclose(seen["reference_rates"], rates, atol=1e-4)
        _, moving = mass_motion(robot, state)
        np.testing.assert_allclose(seen["velocity"], moving, **CLOSE)
        assert (seen["position_age"], seen["velocity_age"]) == (0.0, 0.0)
        np.testing.assert_allclose(seen["thruster_limit"], [EXACT.thruster_limit])


def test_the_positions_of_a_path_are_those_that_are_observed() -> None:
    scenario = made(duration=4.0)
    expected = [reference(PATH, 0.02 * k) for k in range(201)]
    np.testing.assert_allclose(scenario.reference_positions(), expected, atol=1e-14)


def test_the_velocity_is_that_of_the_centre_of_mass() -> None:
    # By differences along the motion, where the test above has a formula.
    rng, simulation, step = np.random.default_rng(1), at_rest(conditions=EXACT), 1e-5
    for _ in range(5):
        state = random_state(EELY, rng)
        ends = []
        for side in (-1.0, 1.0):
            turning = attitude_rate(state["attitude"], state["angular_velocity"])
            poses = link_poses(
                EELY,
                state["position"] + side * step * state["velocity"],
                state["attitude"] + side * step * turning,
                state["joint_angles"] + side * step * state["joint_rates"],
            )
            ends.append(centre_of_mass(EELY, *poses))
        place(simulation, **state)
        velocity = (ends[1] - ends[0]) / (2.0 * step)
        np.testing.assert_allclose(seen_by(simulation)["velocity"], velocity, atol=1e-6)


def test_what_is_reported_is_the_error_of_the_angles_that_are_named() -> None:
    # Turns about one axis alone: no formula of rotations is needed.
    simulation = at_rest()
    for axis, entry in enumerate(ANGLES):
        for angle in np.linspace(-3.1, 3.1, 21):
            vector = np.zeros(3)
            vector[axis] = angle
            x, y, z, w = Rotation.from_rotvec(vector).as_quat()
            place(simulation, attitude=(w, x, y, z))
            seen = seen_by(simulation)
            assert seen.pop(entry) == pytest.approx(angle, rel=1e-6, abs=1e-8)
            others = [value for name, value in seen.items() if name.endswith("_error")]
            np.testing.assert_allclose(np.concatenate(others[1:]), 0.0, atol=1e-8)


def test_attitudes_do_not_unwind() -> None:
    rng, simulation = np.random.default_rng(2), at_rest()
    attitudes = Rotation.random(200, rng=rng).as_quat(scalar_first=True)
    flips = [[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0, 0.6, 0.8, 0], [1, 0, 0, 0]]
    for attitude in (*attitudes, *np.array(flips, float)):
        one = place(simulation, attitude=attitude), simulation.attitude_error.copy()
        other = place(simulation, attitude=-attitude), simulation.attitude_error.copy()
        np.testing.assert_array_equal(one[1] ** 2, other[1] ** 2)  # at half a turn either will do
        if attitude[0] != 0.0:
            np.testing.assert_array_equal(one[0], other[0])
        assert np.linalg.norm(one[1]) <= np.pi + 1e-12
    # All the way round: the error goes back to where it was, and jumps once only.
    place(simulation, attitude=(1, 0, 0, 0))
    before, jumps = simulation.attitude_error[0, 1], 0
    for angle in np.linspace(0.0, 4.0 * np.pi, 400):
        place(simulation, attitude=(np.cos(angle / 2), 0, 0, np.sin(angle / 2)))
        now = simulation.attitude_error[0, 1]
        jumps += abs(now - before) > 0.1
        before = now
    assert jumps == 2  # one in each of two turns
    assert before == pytest.approx(0.0, abs=1e-12)


def test_the_line_of_sight_turns_the_head_to_the_path() -> None:
    scenario = made(path=REST.path, look_ahead=1.5, cross_track=True)
    simulation = Simulation([scenario])
    for error in ((0.0, 0.3, 0.2), (0.2, -0.4, 0.1), (-0.3, 0.2, -0.4)):
        centre = EELY.straight_centre
        place(simulation, position=np.array(error) - centre, attitude=(1, 0, 0, 0))
        seen = seen_by(simulation)
        # Actual minus reference, of a body that lies along x: the reference turned round.
        asked = Rotation.from_rotvec([seen[name][0] for name in ANGLES])
        x, y, z = asked.inv().as_matrix()[:, 0] * 1.5
        assert y == pytest.approx(-error[1] * x / 1.5, abs=1e-6)
        assert np.sign([y, z]).tolist() == np.sign([-error[1], -error[2]]).tolist()


SIZES = {
    "position_error": 2e-3,
    "velocity": 3e-3,
    "attitude": 0.5 * 4e-3,  # of its vector
    "pitch_error": 4e-3,
    "yaw_error": 4e-3,
    "roll_error": 4e-3,
    "joint_angles": 5e-3,
    "angular_velocity": 6e-3,
    "joint_rates": 6e-3,
}


def test_everything_that_is_measured_errs_as_the_conditions_say_and_nothing_else() -> None:
    conditions = Conditions(
        physics_step=0.02,
        thruster_time_constant=0.0,
        position_noise=2e-3,
        velocity_period=1,
        velocity_noise=3e-3,
        tail_angle_noise=4e-3,
        joint_angle_noise=5e-3,
        rate_noise=6e-3,
    )
    simulation = at_rest(robot="eely-neutral", conditions=conditions, duration=60.0)
    seen, slices = [], simulation.layout.slices
    for _ in range(3000):
        simulation.step(np.zeros((1, 7), np.float32))
        seen.append(simulation.observation[0] * simulation.layout.scale)
    assert abs(simulation.error).max() < 1e-12  # it truly keeps its place
    values, independent = np.array(seen), []
    for entry, part in slices.items():
        measured = values[:, part][:, 1:] if entry == "attitude" else values[:, part]
        if entry not in SIZES:
            assert np.ptp(measured, axis=0).max() == 0.0, entry
            continue
        np.testing.assert_allclose(measured.std(axis=0), SIZES[entry], rtol=0.06, err_msg=entry)
        np.testing.assert_allclose(measured.mean(axis=0) / SIZES[entry], 0.0, atol=0.08)
        if entry not in ANGLES:
            independent.append(measured)
    correlation = np.corrcoef(np.hstack(independent).T)
    np.testing.assert_allclose(correlation, np.eye(3 + 3 + 3 + 8 + 3 + 8), atol=0.09)
    # The errors of the angles are those of the attitude; the reference is 0.
    angles = np.hstack([values[:, slices[name]] for name in ANGLES])
    np.testing.assert_allclose(angles, 2.0 * values[:, slices["attitude"]][:, 1:], atol=1e-6)
    assert np.abs(simulation.attitude_error).max() < 1e-12  # what is rewarded has no noise


def test_joints_are_asked_for_their_shares_of_pan_and_tilt() -> None:
    for pan, tilt in ((0.8, 0.0), (0.0, 0.4), (-0.5, -0.3)):
        scan = Scan(times=(0.01,), pans=(pan,), tilts=(tilt,), filter_frequency=None)
        simulation = at_rest(scan=scan)
        simulation.step(np.zeros((1, 7), np.float32))
        asked = seen_by(simulation)["joint_references"]
        assert np.flatnonzero(asked).min() >= 4  # the front half bends
        rotations, _ = link_poses(EELY, np.zeros(3), (1, 0, 0, 0), asked)
        if 0.0 in (pan, tilt):  # else turns about several axes mix
            _, pitch, yaw = roll_pitch_yaw(rotations[-1])
            assert (yaw, pitch) == pytest.approx((pan, -tilt), abs=1e-6)  # lowering is positive
        else:
            ahead = rotations[-1, :, 0]
            assert np.sign(ahead[1:]).tolist() == [np.sign(pan), np.sign(tilt)]
        bent = asked[asked != 0.0]
        assert len(set(np.abs(bent).round(7))) == len({abs(pan), abs(tilt)} - {0.0})


@pytest.mark.parametrize("frequency", [3.0, 5.0])
def test_references_of_joints_are_those_of_a_filter_and_their_derivatives(frequency: float) -> None:
    scan = Scan(times=(0.1,), pans=(0.8,), tilts=(-0.4,), filter_frequency=frequency)
    simulation = at_rest(scan=scan, robot="eely-neutral")
    angle, rate, acceleration = [], [], []
    for k in range(1, 100):
        simulation.step(np.zeros((1, 7), np.float32))
        seen = seen_by(simulation)
        angle.append(seen["joint_references"])
        rate.append(seen["joint_reference_rates"])
        acceleration.append(seen["joint_reference_accelerations"])
        # Critically damped: the answer to a step.
        past = frequency * max(0.02 * k - 0.1, 0.0)
        share = 1.0 - (1.0 + past) * np.exp(-past)
        np.testing.assert_allclose(angle[-1][4:], share * np.array([0.4, 0.2] * 2), atol=2e-3)
    for values, slopes in ((angle, rate), (rate, acceleration)):
        middle, close = np.gradient(values, 0.02, axis=0), 0.02 * np.abs(slopes).max()
        np.testing.assert_allclose(slopes[10:-1], middle[10:-1], atol=close)
