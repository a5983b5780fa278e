"""The kernel that fills in what the agent sees: all of the table, in few calls."""

import sys

import gymnasium as gym
import numpy as np
import pytest
from usm_agents.residual.observation import BASE_ENTRIES, base_entries
from usm_agents.residual.task import Residual
from usm_baselines.estimation.estimator import LEADS, Estimator

from usm_gym.robot import Robot, Thruster
from usm_gym.task.observation import ObservationLayout
from usm_gym.task.sampling import named

ID = "usm_agents:USM-OperationResidual-v0"
SMALL = Robot(
    links=6, thrusters=(Thruster(1, "axial"), Thruster(2, "normal"), Thruster(5, "normal"))
)
LONG = Robot(links=27)


def summed(values):
    return values.sum(axis=1, keepdims=True)


def expected(residual, memory, observation, estimator_state, start, last):
    """All entries by name, physical."""
    layout = ObservationLayout(residual.nominal.robot.links, len(residual.nominal.robot.thrusters))
    (signals, ahead), _ = Estimator(residual.nominal).update(observation, estimator_state, start)
    value = {name: (observation * layout.scale)[:, part] for name, part in layout.slices.items()}
    behind = np.arange(layout.links - 1, 0, -1) / layout.links
    numbers = {
        "position_error": value["position_error"],
        "position_age": value["position_age"],
        "velocity_age": value["velocity_age"],
        "reference_velocity": signals.velocity,
        "reference_acceleration": signals.acceleration,
        "estimated_error": signals.y,
        "estimated_rate": signals.rate,
        "estimated_disturbance": signals.disturbance,
        "estimated_thrust": signals.thrust,
        **{f"foreseen_error_{lead}": ahead[k, :, :, 0] for k, lead in enumerate(LEADS)},
        "foreseen_rate": ahead[-1, :, :, 1],
        "thruster_command": value["thruster_command"],
        "heading": value["tail_angle"] - summed(behind * value["joint_angles"]),
        "heading_error": value["heading_error"],
        "heading_rate": value["tail_rate"] - summed(behind * value["joint_rates"]),
        "deflection": summed(value["joint_angles"]),
        "deflection_rate": summed(value["joint_rates"]),
        "reference_deflection": summed(value["joint_references"]),
        "reference_deflection_rate": summed(value["joint_reference_rates"]),
        "reference_deflection_acceleration": summed(value["joint_reference_accelerations"]),
        "bending_joints": summed((value["joint_references"] != 0.0).astype(float)),
    }
    if residual.corrects:  # what the base believes; it has not acted yet
        believed = memory.base_state[:, residual.base.predictor_columns]
        for k, name in enumerate(("base_error", "base_rate", "base_disturbance")):
            numbers[name] = believed[:, k:6:3]
        return numbers
    parts = signals.allocation * (memory.base_action * value["thruster_limit"])[:, None]
    wrench = parts.sum(axis=2)
    numbers |= {"base_force": wrench[:, :2], "base_moment": wrench[:, 2:]}
    numbers["last_action"] = np.where(start[:, None], 0.0, last)
    for name in getattr(residual.base, "shown", ()):
        numbers[BASE_ENTRIES[name].name] = residual.base.state_of(memory.base_state)[name]
    return numbers


@pytest.mark.parametrize("robot", [Robot(), SMALL, LONG], ids=["paper", "small", "long"])
@pytest.mark.parametrize(
    ("base", "action"),
    [
        ("sta", "force"),
        ("lqg-joints", "wrench"),
        ("zero", "thrusters"),
        ("lqg-joints", "estimates"),
        ("sta-navigator", "estimates"),
    ],
)
def test_every_entry_of_the_table_is_filled_in(base, action, robot):
    nominal = named("nominal", "operation", robot=robot).nominal
    residual = Residual(nominal, base, action=action, omit=("heading",), frames=2)
    layout = residual.layout
    plain = ObservationLayout(robot.links, len(robot.thrusters))
    rng = np.random.default_rng(0)
    half = layout.size // 2
    memory, start = None, np.ones(3, bool)
    last, earlier = np.zeros((3, residual.actions)), np.zeros((3, half), np.float32)
    for _ in range(30):
        observation = rng.normal(0.0, 0.3, (3, plain.size)).astype(np.float32)
        # Joints that do not bend have references of 0.
        observation[:, plain.slices["joint_references"].start] = 0.0
        observation[:, plain.slices["thruster_limit"]] = 1.0
        filtered = None if memory is None else memory.estimator_state
        seen, memory = residual.observe(observation, memory, start)
        numbers = expected(residual, memory, observation, filtered, start, last)
        assert {entry.name for entry in layout.frame} == {*numbers} - {"heading"}
        frame = np.concatenate([numbers[entry.name] for entry in layout.frame], axis=1)
        now = np.clip(frame / layout.scale[half:], -layout.bound[half:], layout.bound[half:])
        assert seen[:, half:] == pytest.approx(now, rel=1e-6, abs=1e-6)
        earlier = np.where(start[:, None], seen[:, half:], earlier)
        assert seen[:, :half].tobytes() == earlier.tobytes()
        earlier = seen[:, half:]
        last = rng.uniform(-1.0, 1.0, last.shape).astype(np.float32)
        _, memory = residual.command(memory, last)
        start = rng.random(3) < 0.2


def test_a_base_may_not_show_what_has_no_entry():
    with pytest.raises(ValueError, match="shown is 'mood'; allowed: error, rate"):
        base_entries(["rate", "mood"], 2)


def calls(step, *arguments):
    """How many functions a call calls, those of libraries included."""
    count = 0

    def note(frame, event, argument):
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(note)
    try:
        step(*arguments)
    finally:
        sys.setprofile(None)
    return count


def test_a_step_of_one_robot_is_not_mostly_small_operations():
    """What a step costs is its calls, not its numbers; it once took four times the plain one's."""
    plain = gym.make("USM-Operation-v0", disable_env_checker=True)
    residual = gym.make(ID, base="zero", disable_env_checker=True)
    counts = []
    for env in (plain, residual):
        env.reset(seed=0)
        action = np.zeros(env.action_space.shape, np.float32)
        env.step(action)  # the first one compiles
        counts.append(calls(env.step, action))
    assert counts[1] < 3 * counts[0]
