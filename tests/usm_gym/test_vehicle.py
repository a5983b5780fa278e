"""What a controller of one's own is told agrees with the simulation and with the dense model."""

import pickle
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from scipy.linalg import expm
from support import oracle

import usm_gym
from usm_gym import Conditions, Inspection, Path, Robot, Scenario, Thruster, Vehicle
from usm_gym.simulation import Simulation
from usm_gym.task.observation import ObservationLayout

# Everything is nominal and measured exactly.
CALM = Conditions(current_limit=0.0, coefficient_range=(1.0, 1.0), position_noise=0.0)
MOVING = Path(speed=0.08, amplitude=0.2, frequency=0.15, ramp=1.0)
PAPER = Robot()
SIZE = ObservationLayout(PAPER.links, len(PAPER.thrusters)).size
BENDS = Inspection(bending_joints=6, times=(0.2, 1.5), deflections=(1.4, -1.2))


def swimming(size=3, robot=PAPER, **conditions):
    """Robots that follow a path and bend, each by its own angle, and their vehicle."""
    scenario = Scenario(
        path=MOVING, inspection=BENDS, conditions=replace(CALM, **conditions), robot=robot
    )
    bends = [replace(BENDS, deflections=(0.4 + 0.5 * i, -1.2)) for i in range(size)]
    scenarios = [replace(scenario, inspection=bend, noise_seed=i) for i, bend in enumerate(bends)]
    return Simulation(scenarios), Vehicle(scenario.nominal)


def swim(simulation, vehicle, steps, force=1.0):
    """Random thrust for a while; what is seen and kept in the end."""
    stream, memory = np.random.default_rng(0), None
    for _ in range(steps):
        _, memory = vehicle.read(simulation.observation, memory)
        action = stream.uniform(-force, force, (simulation.size, simulation.world.thrusters))
        simulation.step((action / CALM.thruster_limit).astype(np.float32))
    return vehicle.read(simulation.observation, memory)


def rigid(robot):
    """Velocities of all joints and the centre of mass over those of a body held stiff."""
    stiff = np.zeros((robot.links + 2, 3))
    stiff[robot.links :, :2], stiff[: robot.links, 2] = np.eye(2), 1.0
    return stiff


def true_wrench(robot, theta, forces):
    """Force and moment of the thrusters by virtual work on the dense model."""
    thrust = oracle.input_matrix(robot, theta)[:, robot.links - 1 :]
    return rigid(robot).T @ thrust @ forces


OTHER = Robot(
    links=7,
    thrusters=tuple(Thruster(1 + i, kind) for i, kind in enumerate(("normal", "axial") * 3)),
)


@pytest.mark.parametrize("robot", [PAPER, OTHER], ids=["paper", "other"])
def test_an_allocated_wrench_is_what_the_thrusters_make_and_the_cheapest_way_to_it(robot):
    simulation, vehicle = swimming(robot=robot)
    seen, _ = swim(simulation, vehicle, 40)
    wanted = np.random.default_rng(1).normal(0.0, 3.0, (3, 3))
    forces = vehicle.allocate(wanted[:, :2], wanted[:, 2:], seen) * seen.thruster_limit
    bent = simulation.read("theta")
    assert np.ptp(bent, axis=1).max() > 0.3
    for theta, force, wrench in zip(bent, forces, wanted, strict=True):
        np.testing.assert_allclose(true_wrench(vehicle.robot, theta, force), wrench, atol=1e-5)
        # Nothing in it is without effect.
        thrust = oracle.input_matrix(vehicle.robot, theta)[:, vehicle.robot.links - 1 :]
        idle = np.linalg.svd(rigid(vehicle.robot).T @ thrust)[2][3:]
        np.testing.assert_allclose(idle @ force, 0.0, atol=1e-5)


def test_what_is_seen_is_what_happens():
    simulation, vehicle = swimming()
    seen, _ = swim(simulation, vehicle, 60)
    theta, force = simulation.read("theta"), simulation.read("force")
    np.testing.assert_allclose(seen.position_error, simulation.error, atol=1e-7)
    np.testing.assert_allclose(seen.link_angles, theta, atol=1e-6)
    np.testing.assert_allclose(
        seen.heading_rate[:, 0], simulation.read("theta_dot").mean(axis=1), atol=1e-6
    )
    np.testing.assert_allclose(seen.thruster_forces, force, atol=1e-5)
    for made, angles, forces in zip(seen.wrench, theta, force, strict=True):
        np.testing.assert_allclose(made, true_wrench(vehicle.robot, angles, forces), atol=1e-5)
    parts = seen.position_error, seen.heading_error, seen.velocity_error, seen.heading_rate
    np.testing.assert_array_equal(seen.state, np.concatenate([*parts, seen.wrench], axis=1))


@pytest.mark.parametrize(
    ("conditions", "periods"),
    [
        ({}, 8),
        ({"position_period": 4}, 16),
        ({"position_period": 4, "position_delay": 3, "position_missing": 0.2}, 30),
        ({"velocity_period": 1}, 1),
    ],
    ids=["at once", "rare", "late", "measured"],
)
def test_the_velocity_error_is_a_mean_of_the_last_ones_whatever_measures_it(conditions, periods):
    simulation, vehicle = swimming(**conditions)
    memory, true = None, []
    for _ in range(150):
        seen, memory = vehicle.read(simulation.observation, memory)
        true.append(simulation.read("velocity") - seen.reference_velocity)
        last = np.array(true[-periods:])
        assert (seen.velocity_error > last.min(axis=0) - 2e-4).all()
        assert (seen.velocity_error < last.max(axis=0) + 2e-4).all()
        simulation.step(np.zeros((3, 5), np.float32))
    assert np.ptp(true, axis=0).min() > 0.02


def test_a_robot_starts_at_rest():
    simulation, vehicle = swimming()
    seen, _ = vehicle.read(simulation.observation)
    np.testing.assert_array_equal(seen.velocity_error, -seen.reference_velocity)


def test_dead_bands_are_known():
    simulation, vehicle = swimming(thruster_dead_band=0.5)
    seen, _ = swim(simulation, vehicle, 40)
    np.testing.assert_allclose(seen.thruster_forces, simulation.read("force"), atol=1e-5)


def test_one_robot_and_a_batch_are_read_alike_and_a_new_episode_forgets():
    simulation, vehicle = swimming()
    _, memory = swim(simulation, vehicle, 30)
    observation = simulation.observation
    restarted = np.array([False, True, False])
    seen, kept = vehicle.read(observation, memory, restarted)
    wanted = np.array([1.0, -2.0]), np.array([0.5])
    action = vehicle.allocate(*(np.tile(part, (3, 1)) for part in wanted), seen)
    for i, restart in enumerate(restarted):
        alone, own = vehicle.read(observation[i], None if restart else memory[i], restart)
        np.testing.assert_array_equal(own, kept[i])
        np.testing.assert_allclose(vehicle.allocate(*wanted, alone), action[i], rtol=1e-12)
        for name, value in vars(alone).items():
            np.testing.assert_allclose(value, getattr(seen, name)[i], rtol=1e-12, err_msg=name)


@pytest.mark.parametrize("bend", [0.0, 0.15])
def test_inertia_and_linear_model_are_those_of_the_dense_model_held_stiff(bend):
    robot = Robot()
    nominal = replace(Scenario().nominal, thruster_time_constant=0.0)
    theta = 0.4 + bend * np.arange(robot.links)
    inertia = Vehicle(nominal).inertia(theta)
    stiff = rigid(robot)
    expected = stiff.T @ oracle.mass_matrix(robot, theta) @ stiff
    np.testing.assert_allclose(inertia, expected, atol=1e-9)
    # The plant answers to slow motion, and to thrust, with torques that hold the joints.
    model = Vehicle(nominal).linear_model(theta)
    joints, none = np.eye(robot.links - 1), np.zeros(len(robot.thrusters))

    def answer(motion, torques, forces):
        rates = np.full(robot.links, motion[2])
        alpha, a = usm_gym.accelerations(robot, theta, rates, motion[:2], torques, forces)
        return np.append(alpha, a)

    by_torque = np.stack([answer(np.zeros(3), torque, none) for torque in joints], axis=1)
    for k in range(3):
        for motion, forces in ((1e-7 * np.eye(3)[k], none), (np.zeros(3), np.eye(5)[k])):
            free = answer(motion, np.zeros(robot.links - 1), forces)
            bending = -np.diff(by_torque[: robot.links], axis=0)
            torques = np.linalg.solve(bending, np.diff(free[: robot.links]))
            held = free + by_torque @ torques
            wrench = true_wrench(robot, theta, forces)
            expected = model.A[3:, 3:] @ motion + model.B[3:] @ wrench
            scale = np.abs(expected).max()
            found = np.append(held[robot.links :], held[0])
            np.testing.assert_allclose(found, expected, atol=1e-5 * scale)


def test_the_linear_model_predicts_what_is_seen_of_a_stiff_robot():
    stiff = Robot(joint_stiffness=2e5, joint_damping=5e3)
    conditions = replace(CALM, motion=False)
    here = Scenario(path=Path(speed=0.0, amplitude=0.0), conditions=conditions, robot=stiff)
    simulation, vehicle = Simulation([here]), Vehicle(here.nominal)
    model, h = vehicle.linear_model(), vehicle.period
    n, m = model.B.shape
    assert n == sum(state.size for state in model.states)
    sampled = expm(h * np.block([[model.A, model.B], [np.zeros((m, n + m))]]))
    predicted, memory = np.zeros(n), None
    for wrench in np.cumsum(np.random.default_rng(0).normal(0.0, 2e-3, (60, 3)), axis=0):
        seen, memory = vehicle.read(simulation.observation, memory)
        action = vehicle.allocate(wrench[np.newaxis, :2], wrench[np.newaxis, 2:], seen)
        simulation.step(action.astype(np.float32))
        predicted = sampled[:n, :n] @ predicted + sampled[:n, n:] @ wrench
    seen, _ = vehicle.read(simulation.observation, memory)
    exact = np.r_[0:3, 5:9]
    scale = np.abs(predicted)
    assert (np.abs(seen.state[0] - predicted) < 0.02 * scale + 1e-6)[exact].all()
    assert (np.abs(seen.state[0] - predicted) < 0.2 * scale)[3:5].all()


def test_without_a_lag_the_wrench_is_no_state():
    simulation, vehicle = swimming(thruster_time_constant=0.0)
    seen, _ = swim(simulation, vehicle, 5)
    model = vehicle.linear_model()
    assert seen.state.shape[1] == len(model.A) == 6
    assert [state.name for state in model.states] == [
        "position",
        "heading",
        "velocity",
        "heading_rate",
    ]


def test_environments_take_what_is_allocated_and_processes_a_vehicle():
    env = gym.make("usm_gym:USM-Torpedo-v0")
    observation, _ = env.reset(seed=0)
    vehicle = pickle.loads(pickle.dumps(Vehicle(env.unwrapped.nominal)))
    seen, _ = vehicle.read(observation)
    assert vehicle.mass == vehicle.nominal.robot.total_mass
    env.step(vehicle.allocate(np.array([1.0, 0.0]), np.array([0.0]), seen))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda vehicle, seen: vehicle.read(np.zeros(5)), "the observation's shape is"),
        (lambda vehicle, seen: vehicle.read("all"), "observation is 'all'"),
        (lambda vehicle, seen: vehicle.read(np.zeros(SIZE), np.zeros(2)), "shape of the memory is"),
        (lambda vehicle, seen: vehicle.allocate([1.0], [0.0], seen), "shape of the force is"),
        (lambda vehicle, seen: vehicle.allocate([1.0, 0.0], 0.0, seen), "shape of the moment is"),
        (lambda vehicle, seen: vehicle.inertia(np.zeros(15)), "link_angles' shape is"),
        (lambda vehicle, seen: vehicle.inertia(np.full(16, np.nan)), "finite"),
        (lambda vehicle, seen: vehicle.linear_model(np.zeros((2, 16))), r"allowed: shape \(16,\)"),
        (lambda vehicle, seen: Vehicle(vehicle.robot), "allowed: a Nominal"),
        (lambda vehicle, seen: Vehicle(replace(vehicle.nominal, robot=3)), "the planar robot"),
    ],
)
def test_what_does_not_fit_is_refused(call, message):
    vehicle = Vehicle(Scenario().nominal)
    seen, _ = vehicle.read(np.zeros(SIZE))
    with pytest.raises(ValueError, match=message):
        call(vehicle, seen)
