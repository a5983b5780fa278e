"""The linear model is that of the simulated robot: its numbers, its answers, what it is for."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag, solve_discrete_are

import usm_gym
from usm_gym import Conditions, Inspection, Path, Robot, Scenario, linear_model
from usm_gym.plant import layout as rows
from usm_gym.simulation import Simulation

# Everything is nominal, the reference rests.
CALM = Conditions(current_limit=0.0, coefficient_range=(1.0, 1.0), position_noise=0.0)
HERE = Scenario(path=Path(speed=0.0, amplitude=0.0), conditions=replace(CALM, motion=False))
NOMINAL = HERE.nominal
STILL = np.zeros((1, 5), np.float32)


def state_of(simulation):
    """The state of a simulated robot in the order of the model, not as a deviation."""
    links, row = simulation.world.links, simulation.fleet.blocks[0]
    theta, omega = simulation.read("theta")[0], row[rows.row_of(rows.OMEGA, links) :][:links]
    parts = [simulation.read("position")[0], [theta.mean()], -np.diff(theta)]
    parts += [
        row[rows.V_X : rows.V_Y + 1],
        [omega.mean()],
        -np.diff(omega),
        simulation.read("force")[0],
    ]
    return np.concatenate(parts)


def simulated(lag, bent):
    """A robot at rest, straight or bent, whose thrusters have a lag."""
    conditions = replace(CALM, thruster_time_constant=lag, motion=bent)
    motion = Inspection(times=(0.0,), deflections=(1.1,), filter_frequency=None)
    simulation = Simulation([replace(HERE, conditions=conditions, inspection=motion)])
    for _ in range(1500 if bent else 0):
        simulation.step(STILL)
    return simulation


def test_a_stiff_body_has_the_numbers_of_a_rigid_one():
    stiff = replace(Robot(), joint_stiffness=2e5, joint_damping=5e3)
    model = usm_gym.linearise(replace(NOMINAL, robot=stiff, thruster_time_constant=0.0))
    h = model.period
    velocity = model.slices["velocity"].start
    turning = model.slices["heading_rate"].start
    # docs/model.md, section 1: linear drag over inertia, along, across and in yaw.
    for index, drag, inertia in (
        (velocity, 4.222, 10.555),
        (velocity + 1, 134.4, 16.889),
        (turning, 56.0, 4.41 + 2.64),
    ):
        assert -np.log(model.A[index, index]) / h == pytest.approx(drag / inertia, rel=5e-3)
    # A thruster's force, held: the first pushes forwards, the others to the left, at their levers.
    levers = 0.14 * (np.array([1, 3, 6, 11, 14]) - 8.5)
    across = np.array([0.0, 1.0, 1.0, 1.0, 1.0])
    for index, drag, inertia, push in (
        (velocity, 4.222, 10.555, 1.0 - across),
        (velocity + 1, 134.4, 16.889, across),
        (turning, 56.0, 4.41 + 2.64, across * levers),
    ):
        gain = (1.0 - np.exp(-drag / inertia * h)) / drag
        assert model.B[index] == pytest.approx(gain * push, rel=0.02, abs=1e-9)


@pytest.mark.parametrize("bent", [False, True])
@pytest.mark.parametrize("lag", [0.0, 0.05])
def test_small_commands_have_the_same_effect_as_in_the_simulation(lag, bent):
    simulation = simulated(lag, bent)
    origin = state_of(simulation)
    model = usm_gym.linearise(
        replace(NOMINAL, thruster_time_constant=lag),
        heading=origin[2],
        joint_angles=origin[3:18],
    )
    assert [state.name for state in model.states][6:] == ["thruster_forces"] * (lag > 0)
    predicted = np.zeros(len(model.A))
    commands = np.random.default_rng(0).normal(0.0, 1e-4, (50, 1, 5))
    for command in np.cumsum(commands, axis=0):
        simulation.step((command / CALM.thruster_limit).astype(np.float32))
        predicted = model.A @ predicted + model.B @ command[0]
    actual = (state_of(simulation) - origin)[: len(predicted)]
    for name, part in model.slices.items():
        error = np.abs(actual[part] - predicted[part]).max()
        assert error < 1e-3 * np.abs(actual[part]).max(), name


def test_derivatives_are_as_exact_as_they_are_said_to_be(monkeypatch):
    bend = np.linspace(-0.3, 0.3, 15)

    def both():
        model = usm_gym.linearise(NOMINAL, joint_angles=bend)
        return np.hstack([model.A, model.B])

    found = both()
    monkeypatch.setattr(linear_model, "STEP", 2.0**-18)
    coarse = both()
    monkeypatch.setattr(linear_model, "STEP", 2.0**-19)
    exact = 2 * both() - coarse  # without the error of first order
    assert (np.abs(found - exact).max(axis=1) < 1e-7 * np.abs(exact).max(axis=1)).all()


def test_position_and_heading_integrate_and_the_rest_decays():
    model = usm_gym.linearise(NOMINAL)
    sizes = np.sort(np.abs(np.linalg.eigvals(model.A)))[::-1]
    assert sizes[:3] == pytest.approx(1.0, abs=1e-9)
    assert sizes[3] < 0.999
    # Position and heading, which do not come to rest by themselves, are controllable (Hautus).
    hautus = np.hstack([model.A - np.eye(len(model.A)), model.B])
    assert np.linalg.svd(hautus, compute_uv=False).min() > 1e-6


def test_the_model_turns_with_the_robot():
    angle = 0.7
    model, turned = usm_gym.linearise(NOMINAL), usm_gym.linearise(NOMINAL, heading=angle)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    T = block_diag(turn, np.eye(16), turn, np.eye(21))
    np.testing.assert_allclose(turned.A, T @ model.A @ T.T, atol=1e-6)
    np.testing.assert_allclose(turned.B, T @ model.B, atol=1e-6)


def test_a_linear_quadratic_regulator_brings_the_simulated_robot_back():
    model = usm_gym.linearise(NOMINAL)
    weights = np.zeros(len(model.A))
    weights[model.slices["position"]], weights[model.slices["heading"]] = 1.0, 0.1
    A, B, Q, R = model.A, model.B, np.diag(weights), 1e-5 * np.eye(5)
    P = solve_discrete_are(A, B, Q, R)
    K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    simulation = simulated(0.05, bent=False)
    for _ in range(50):
        simulation.step(np.array([[0.3, 0.2, 0.2, 0.2, -0.4]], np.float32))
    pushed = np.abs(state_of(simulation)[:3]).min()
    for _ in range(400):
        command = -K @ state_of(simulation) / CALM.thruster_limit
        simulation.step(command[np.newaxis].astype(np.float32))
    assert np.abs(state_of(simulation)[:3]).max() < 1e-3 * pushed


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"heading": np.nan}, "heading is nan"),
        ({"heading": "north"}, "heading is 'north'"),
        ({"heading": [0.0]}, r"heading is \[0.0\]"),
        ({"joint_angles": np.zeros(16)}, r"shape \(15,\)"),
        ({"joint_angles": np.full(15, np.inf)}, "finite"),
    ],
)
def test_what_is_no_operating_point_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        usm_gym.linearise(NOMINAL, **arguments)


def test_a_robot_is_no_nominal_knowledge():
    with pytest.raises(ValueError, match="allowed: a Nominal"):
        usm_gym.linearise(Robot())
