"""The residual task in space: its base to the bit, single as vector, and what is seen and told."""

import warnings

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines
from usm_agents.residual.env import make_residual_vector_env

ID = "usm_agents:USM-Operation3DResidual-v0"
# How many numbers an action has.
ACTIONS = {"force": 3, "wrench": 5, "thrusters": 7, "estimates": 9}


@pytest.mark.parametrize("id", [ID, "usm_agents:USM-Torpedo3DResidual-v0"])
def test_checkers_have_no_complaint(checkers, id):
    for check in checkers:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            # The wrapper is the environment here; unwrapping it would check the plain one.
            warnings.filterwarnings("ignore", message=".*different from the unwrapped version.*")
            check(gym.make(id, disable_env_checker=True).env.env)


@pytest.mark.parametrize("action", ACTIONS)
def test_a_zero_residual_is_the_base_to_the_bit(action):
    base = "lqg-joints" if action == "estimates" else "sta"
    plain, residual = gym.make("USM-Operation3D-v0"), gym.make(ID, base=base, action=action)
    assert residual.action_space.shape == (ACTIONS[action],)
    policy = usm_baselines.make(base, plain)
    observation, _ = plain.reset(seed=2)
    residual.reset(seed=2)
    state, nothing = None, np.zeros(ACTIONS[action], np.float32)
    for _ in range(300):
        chosen, state = policy.predict(observation, state)
        observation, reward, *_, info = plain.step(chosen)
        _, its_reward, *_, its_info = residual.step(nothing)
        assert its_reward == reward
        assert its_info == info


def test_a_vector_behaves_as_single_environments():
    envs = make_residual_vector_env(3, "operation3d", autoreset_mode="SameStep")
    singles = [gym.make(ID) for _ in range(3)]
    seen, _ = envs.reset(seed=5)
    assert (seen == np.stack([env.reset(seed=5 + i)[0] for i, env in enumerate(singles)])).all()
    for actions in np.random.default_rng(0).uniform(-1, 1, (40, 3, 3)).astype(np.float32):
        seen, rewards, *_ = envs.step(actions)
        for env, its, one, reward in zip(singles, actions, seen, rewards, strict=True):
            expected, alone, *_ = env.step(its)
            assert (one == expected).all()
            assert reward == alone


def test_a_force_moves_the_centre_of_mass_along_its_axis_and_turns_nothing():
    conditions = {"thruster_time_constant": 0.0, "current_limit": 0.0, "motion": False}
    for axis in range(3):
        env = gym.make(ID, base="zero", residual_scale=10.0, conditions=conditions)
        env.reset(seed=0)
        action = np.zeros(3, np.float32)
        action[axis] = 1.0
        for _ in range(25):
            *_, info = env.step(action)
        velocity = env.unwrapped.simulation.velocity[0]
        assert np.argmax(np.abs(velocity)) == axis
        assert velocity[axis] > 0.02
        assert max(abs(info[f"{angle}_error"]) for angle in ("pitch", "yaw")) < 0.02


def test_training_is_told_the_velocity_of_the_centre_of_mass():
    envs = make_residual_vector_env(2, "operation3d", base="zero")
    envs.reset(seed=0)
    plain = envs.unwrapped
    action = np.ones((2, 3), np.float32)
    for _ in range(50):
        before, known = plain.simulation.error.copy(), plain.truth()
        envs.step(action)
    layout, after = plain.simulation.layout, plain.truth()
    part = layout.slices["reference_velocity"]
    asked = layout.scale[part] * plain.simulation.observation[:, part]
    rate = (known["velocity"] + after["velocity"]) / 2 - asked
    moved = (after["error"] - before) / 0.02
    np.testing.assert_allclose(moved, rate, atol=1e-3)
    assert set(after) == {"error", "velocity", "coefficients", "water_velocity"}
