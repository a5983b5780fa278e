"""Labels: what a law should have believed, against what is known of the simulation."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines
from usm_agents.learning.supervised.labels import Labels

from usm_gym.planar_world import PlanarWorld
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import named
from usm_gym.task.scenario import STILL

PERIODS = 200
# A robot that is as nominal as it can be, under the sensors of a basin.
EXACT = replace(
    PRESETS["basin"],
    coefficient_range=(1.0, 1.0),
    coefficient_spread=0.0,
    thruster_gain_range=(1.0, 1.0),
    current_limit=0.0,
    current_variation=0.0,
)


def rates(envs, observation):
    """True rates of the errors, m/s, (robots, axes)."""
    layout = PlanarWorld(envs.unwrapped.nominal.robot).layout
    part = layout.slices["reference_velocity"]
    return envs.unwrapped.truth()["velocity"] - layout.scale[part] * observation[:, part]


def labelled(conditions, base="lqg-joints"):
    """Corrections of a law's beliefs, (periods, 8, 2, 3), these, and true errors and rates."""
    envs = gym.make_vec("USM-Operation-v0", 8, "vector_entry_point", conditions=conditions)
    observation, _ = envs.reset(seed=0)
    law = usm_baselines.make(base, envs)
    labels, state = Labels(law), None
    corrections, beliefs, truths = [], [], []
    for k in range(PERIODS):
        error, rate = envs.unwrapped.truth()["error"], rates(envs, observation)
        if k > 0:
            corrections[-1][:, :, 2] += labels.missed(observation, rate)
        action, state = law.predict(observation, state, np.full(8, k == 0))
        corrections.append(labels.take(state, error, rate))
        beliefs.append(state[:, law.predictor_columns][:, :6].reshape(8, 2, 3).copy())
        truths.append(np.stack([error, rate], axis=2))
        observation, *_ = envs.step(action)
    return np.array(corrections)[:-1], np.array(beliefs)[:-1], np.array(truths)[:-1]


@pytest.mark.parametrize("base", ["lqg-joints", "sta-navigator", "adaptive"])
def test_belief_and_correction_make_the_truth(base):
    corrections, beliefs, truths = labelled(PRESETS["basin"], base)
    assert (corrections + beliefs)[..., :2] == pytest.approx(truths, abs=1e-12)


def test_nothing_is_left_out_of_a_robot_that_is_nominal():
    corrections, beliefs, _ = labelled(EXACT)
    exact = (corrections + beliefs)[..., 2]
    corrections, beliefs, _ = labelled(PRESETS["basin"])
    # What the predictor leaves out by its coarser step, and what it does not know in a basin.
    assert np.sqrt(np.mean(exact**2)) < 0.05 * np.sqrt(
        np.mean((corrections + beliefs)[..., 2] ** 2)
    )


def left_out(gain):
    """What the nominal plant leaves out of a robot that accelerates, its thrusters being weak."""
    nominal = named("nominal", "operation", EXACT)
    scenario = replace(nominal, thruster_gains=5 * (gain,), inspection=STILL)
    envs = gym.make_vec("USM-Operation-v0", 1, "vector_entry_point", conditions=EXACT)
    observation, _ = envs.reset(seed=0, options={"scenario": [scenario]})
    law = usm_baselines.make("lqg-joints", envs)
    labels, state = Labels(law), None
    for k in range(30):
        if k > 0:
            missed = labels.missed(observation, rates(envs, observation))
        _, state = law.predict(observation, state, np.full(1, k == 0))
        labels.take(state, envs.unwrapped.truth()["error"], rates(envs, observation))
        observation, *_ = envs.step(np.array([[0.5, 0.0, 0.0, 0.0, 0.5]], np.float32))
    return missed[0]


def test_what_weak_thrusters_lack_is_left_out():
    little, much = np.linalg.norm(left_out(0.8)), np.linalg.norm(left_out(0.6))
    assert little > 0.01
    assert much / little == pytest.approx(2.0, rel=0.1)
