"""The residual task: its base to the bit, saturation once, single as vector, and what is seen."""

import dataclasses
import warnings

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines
from support import laws
from usm_agents.residual.env import make_residual_vector_env

import usm_gym
from usm_gym.robot import Robot

ID = "usm_agents:USM-OperationResidual-v0"
TORPEDO = "usm_agents:USM-TorpedoResidual-v0"
HARD = {"thruster_limit": 3.0, "current_limit": 0.3}


def vector(count, **arguments):
    return gym.make_vec(ID, num_envs=count, vectorization_mode="vector_entry_point", **arguments)


def test_checkers_have_no_complaint(checkers):
    for check in checkers:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            # The wrapper is the environment here; unwrapping it would check the plain one.
            warnings.filterwarnings("ignore", message=".*different from the unwrapped version.*")
            check(gym.make(ID, disable_env_checker=True).env.env)


@pytest.mark.parametrize("base", ["sta", "pd", "lqg-joints", "zero"])
def test_a_zero_residual_is_the_base_to_the_bit(base):
    plain, residual = gym.make("USM-Operation-v0"), gym.make(ID, base=base)
    policy = usm_baselines.make(base, plain)
    observation, _ = plain.reset(seed=2)
    residual.reset(seed=2)
    state = None
    for _ in range(600):
        action, state = policy.predict(observation, state)
        observation, reward, *_, info = plain.step(action)
        _, its_reward, *_, its_info = residual.step(np.zeros(2, np.float32))
        assert its_reward == reward
        assert its_info == info


def test_a_zero_residual_is_the_base_to_the_bit_in_a_vector():
    arguments = {
        "num_envs": 3,
        "vectorization_mode": "vector_entry_point",
        "autoreset_mode": "SameStep",
        "conditions": HARD,
    }
    plain, residual = (gym.make_vec(id, **arguments) for id in ("USM-Operation-v0", ID))
    policy = usm_baselines.make("sta", plain)
    observation, _ = plain.reset(seed=5)
    residual.reset(seed=5)
    state, done, ends = None, np.ones(3, bool), 0
    for _ in range(700):
        action, state = policy.predict(observation, state, done)
        observation, rewards, terminated, truncated, _ = plain.step(action)
        _, its_rewards, its_terminated, *_ = residual.step(np.zeros((3, 2), np.float32))
        done = terminated | truncated
        ends += done.sum()
        assert (its_rewards == rewards).all()
        assert (its_terminated == terminated).all()
    assert ends >= 3


@pytest.mark.parametrize("autoreset_mode", ["NextStep", "SameStep"])
def test_a_vector_behaves_as_single_environments(autoreset_mode):
    envs = vector(3, autoreset_mode=autoreset_mode, conditions=HARD)
    singles = [gym.make(ID, conditions=HARD) for _ in range(3)]
    seen, _ = envs.reset(seed=5)
    expected = [env.reset(seed=5 + i)[0] for i, env in enumerate(singles)]
    assert (seen == np.stack(expected)).all()
    waiting, ends = [False] * 3, 0
    for actions in np.random.default_rng(0).uniform(-1, 1, (500, 3, 2)).astype(np.float32):
        seen, rewards, terminated, truncated, infos = envs.step(actions)
        for i, env in enumerate(singles):
            if waiting[i]:
                expected[i], _ = env.reset()
                waiting[i] = False
                continue
            expected[i], reward, lost, over, _ = env.step(actions[i])
            assert (reward, lost, over) == (rewards[i], terminated[i], truncated[i])
            if lost or over:
                ends += 1
                if autoreset_mode == "SameStep":
                    assert (infos["final_obs"][i] == expected[i]).all()
                    expected[i], _ = env.reset()
                else:
                    waiting[i] = True
        assert (seen == np.stack(expected)).all()
    assert ends >= 3


def test_resetting_some_robots_leaves_the_others_alone():
    envs, reference = (vector(3, autoreset_mode="Disabled") for _ in range(2))
    actions = np.random.default_rng(0).uniform(-1, 1, (60, 3, 2)).astype(np.float32)
    for each in (envs, reference):
        each.reset(seed=3)
    for action in actions[:30]:
        envs.step(action)
        reference.step(action)
    seen, _ = envs.reset(seed=3, options={"reset_mask": np.array([False, True, False])})
    first, _ = vector(3).reset(seed=3)
    assert (seen[1] == first[1]).all()
    for action in actions[30:]:
        ours, theirs = envs.step(action)[0], reference.step(action)[0]
        assert (ours[[0, 2]] == theirs[[0, 2]]).all()


@pytest.mark.parametrize("action", ["force", "wrench", "thrusters"])
def test_base_and_residual_are_saturated_once_and_the_base_is_told(action):
    """What was applied drives a plain environment, whose observations drive a base of its own."""
    residual, plain = gym.make(ID, action=action, residual_scale=6.0), gym.make("USM-Operation-v0")
    policy, robot = usm_baselines.make("sta", plain), Robot()
    observation, _ = plain.reset(seed=0)
    residual.reset(seed=0)
    residual.action_space.seed(0)
    layout = residual.get_wrapper_attr("residual").layout
    state, largest = None, 0.0
    for _ in range(200):
        base, state = policy.predict(observation, state)
        chosen = residual.action_space.sample()
        forces = 6.0 * chosen
        if action != "thrusters":
            wrench = np.pad(forces, (0, 3 - len(forces)))
            forces = np.linalg.pinv(laws.look(robot, observation).T) @ wrench
        seen, *_ = residual.step(chosen)
        applied = seen[layout.slices["thruster_command"]]
        np.testing.assert_allclose(applied, np.clip(base + forces / 20.0, -1.0, 1.0), atol=2e-7)
        observation, *_ = plain.step(applied)
        largest = max(largest, np.abs(base).max())
    assert largest > 1.0


def test_what_is_seen_means_what_the_table_says():
    env = gym.make("USM-Operation-v0")
    residual = gym.make(ID)
    layout = residual.get_wrapper_attr("residual").layout
    assert residual.observation_space == layout.space
    plain, _ = env.reset(seed=0)
    seen, _ = residual.reset(seed=0)
    action = np.array([0.1, -0.2], np.float32)
    part = layout.slices
    for _ in range(700):
        seen, *_ = residual.step(action)
        plain, *_ = env.step(seen[part["thruster_command"]])
    values = {name: (seen * layout.scale)[place] for name, place in part.items()}
    known = env.unwrapped.layout
    given = {name: (plain * known.scale)[place] for name, place in known.slices.items()}
    theta = given["tail_angle"] - np.concatenate([[0.0], np.cumsum(given["joint_angles"])])
    theta_dot = given["tail_rate"] - np.concatenate([[0.0], np.cumsum(given["joint_rates"])])
    scenario = env.unwrapped.scenario
    expected = {
        "position_error": given["position_error"],
        "last_action": action,
        "heading": theta.mean(),
        "heading_rate": theta_dot.mean(),
        "heading_error": given["heading_error"],
        "deflection": given["joint_angles"].sum(),
        "reference_deflection": given["joint_references"].sum(),
        "bending_joints": scenario.inspection.bending_joints,
    }
    for name, value in expected.items():
        np.testing.assert_allclose(values[name], value, rtol=1e-5, atol=1e-6, err_msg=name)
    assert (np.abs(seen) <= layout.bound).all()


def test_entries_are_left_out_and_earlier_frames_shown():
    hidden = ("base_disturbance", "reference_deflection")
    whole, less = gym.make(ID), gym.make(ID, omit=hidden)
    framed = vector(2, frames=3, autoreset_mode="SameStep", conditions=HARD)
    single = vector(2, autoreset_mode="SameStep", conditions=HARD)
    complete, layout = (each.get_wrapper_attr("residual").layout for each in (whole, less))
    assert set(complete.slices) - set(layout.slices) == set(hidden)
    whole.reset(seed=0)
    less.reset(seed=0)
    random = np.random.default_rng(0)
    frames = [single.reset(seed=0)[0]] * 3
    assert (framed.reset(seed=0)[0] == np.concatenate(frames, axis=1)).all()
    ends = 0
    for _ in range(500):
        action = random.uniform(-1, 1, (2, 2)).astype(np.float32)
        seen, shown = whole.step(action[0])[0], less.step(action[0])[0]
        for name, place in layout.slices.items():
            assert (shown[place] == seen[complete.slices[name]]).all()
        latest, _, terminated, truncated, info = single.step(action)
        both, *_, its_info = framed.step(action)
        done = terminated | truncated
        ends += done.sum()
        for index in np.flatnonzero(done):
            assert (
                its_info["final_obs"][index][-latest.shape[1] :] == info["final_obs"][index]
            ).all()
        frames = [np.where(done[:, None], latest, each) for each in (*frames[1:], latest)]
        assert (both == np.concatenate(frames, axis=1)).all()
    assert ends > 0
    assert framed.residual.layout.fingerprint != single.residual.layout.fingerprint


def test_the_kalman_filter_knows_better_than_the_measurement():
    envs = vector(16)
    part, scale = envs.residual.layout.slices, envs.residual.layout.scale
    seen, _ = envs.reset(seed=0)
    measured, estimated = [], []
    for _ in range(500):
        seen, *_, info = envs.step(np.zeros((16, 2), np.float32))
        truth = np.stack([info["error_x"], info["error_y"]], axis=1)
        for name, found in (("position_error", measured), ("estimated_error", estimated)):
            place = part[name]
            found.append((seen[:, place] * scale[place] - truth)[~(np.abs(truth) > 0.02)])
    errors = [np.sqrt(np.mean(np.concatenate(found) ** 2)) for found in (measured, estimated)]
    assert errors[1] < errors[0] < 6e-5


def test_a_snapshot_holds_the_base_too():
    env = gym.make(ID, disable_env_checker=True).env
    envs = vector(2, autoreset_mode="SameStep", conditions=HARD)
    env.reset(seed=1)
    envs.reset(seed=1)
    actions = np.random.default_rng(0).uniform(-1, 1, (400, 2, 2)).astype(np.float32)
    for each, of in ((env, lambda action: action[0]), (envs, lambda action: action)):
        for action in actions[:30]:
            each.step(of(action))
        snapshot = each.snapshot()
        length = 60 if each is env else 400
        first = [each.step(of(action))[0] for action in actions[30:length]]
        each.restore(snapshot)
        second = [each.step(of(action))[0] for action in actions[30:length]]
        assert (np.array(first) == np.array(second)).all()


def test_arguments_survive_the_spec_and_bad_ones_are_refused():
    env = gym.make(ID, base="pd", residual_scale=3.0, action="thrusters", conditions="basin")
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    first, second = env.reset(seed=0)[0], again.reset(seed=0)[0]
    assert (first == second).all()
    with pytest.raises(ValueError, match="policy is 'nobody'"):
        gym.make(ID, base="nobody")
    with pytest.raises(ValueError, match="residual_scale is -1"):
        gym.make(ID, residual_scale=-1.0)
    with pytest.raises(ValueError, match="action is 'sideways'"):
        make_residual_vector_env(2, "operation", action="sideways")
    with pytest.raises(ValueError, match="omit is 'nothing'"):
        gym.make(ID, omit=("nothing",))
    with pytest.raises(ValueError, match="frames is 0"):
        gym.make(ID, frames=0)


def test_torpedo_mode():
    envs = gym.make_vec(TORPEDO, num_envs=2, vectorization_mode="vector_entry_point")
    seen, _ = envs.reset(seed=0)
    assert envs.unwrapped.mode == "torpedo"
    assert envs.observation_space.contains(seen)


@pytest.mark.parametrize("some", [True, False])
def test_robots_of_different_nominal_knowledge_are_refused_and_nothing_changes(some):
    envs = vector(2)
    envs.reset(seed=0)
    plain = envs.unwrapped
    before = [*plain.simulation.scenarios], envs.snapshot()
    one, other = usm_gym.suite("operation")[:2]
    slower = dataclasses.replace(other.conditions, thruster_time_constant=0.2)
    options = {"scenario": [one, other.under(slower)]}
    if some:
        options |= {"reset_mask": np.array([False, True])}
    with pytest.raises(ValueError, match="one nominal knowledge"):
        envs.reset(options=options)
    assert plain.simulation.scenarios == before[0]
    action = np.zeros((2, 2), np.float32)
    seen = envs.step(action)[0]
    envs.restore(before[1])
    np.testing.assert_array_equal(envs.step(action)[0], seen)
