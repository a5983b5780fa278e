"""Agents that correct what a law believes, and agents that have one of these as their base."""

from dataclasses import asdict, replace
from itertools import pairwise

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines
from usm_agents.artifact.network import Network, Recurrence
from usm_agents.residual.env import make_residual_env, make_residual_vector_env
from usm_agents.residual.task import Residual, ResidualPolicy
from usm_baselines.estimation.estimator import LEADS

from usm_gym.task.conditions import PRESETS

# Sensors of a basin, and thrusters so weak that robots are lost.
HARD = asdict(replace(PRESETS["basin"], thruster_limit=1.5, current_limit=0.4))
ROBOTS, STEPS, SNAPSHOT, RESET = 3, 400, 20, 40


def plain_vector():
    return gym.make_vec(
        "USM-Operation-v0",
        num_envs=ROBOTS,
        vectorization_mode="vector_entry_point",
        autoreset_mode="SameStep",
        conditions=HARD,
    )


@pytest.fixture(scope="module")
def agent():
    """One that corrects the estimates of a law, by what its memory takes in now and then."""
    residual = Residual(plain_vector().unwrapped.nominal, "sta-navigator", action="estimates")
    rng, inputs, units = np.random.default_rng(0), residual.layout.size, 4
    given, kept = (rng.normal(0, 0.3, (n, 4 * units)).astype(np.float32) for n in (inputs, units))
    sizes = (units + inputs, 5, residual.actions)
    weights = tuple(rng.normal(0, 0.3, pair).astype(np.float32) for pair in pairwise(sizes))
    biases = tuple(np.zeros(size, np.float32) for size in sizes[1:])
    memory = Recurrence(given, kept, np.zeros(4 * units, np.float32), period=5)
    return ResidualPolicy(residual, Network(weights, biases, "tanh", "clip", memory))


@pytest.fixture(params=["corrects", "on an agent"])
def task(request, agent):
    """Arguments of the residual task: the agent corrects estimates, or its base does."""
    if request.param == "corrects":
        return {"base": "lqg-joints", "action": "estimates"}
    return {"base": agent}


def together(envs, actions, begin):
    """Observation, reward and end of every step of all robots; one is reset on the way."""
    found = []
    for k, action in enumerate(actions[begin:], start=begin):
        if k == RESET:
            envs.reset(seed=50, options={"reset_mask": np.arange(ROBOTS) == 1})
        seen, rewards, terminated, truncated, _ = envs.step(action)
        found.append((seen, rewards, terminated | truncated))
    return found


def alone(env, robot, actions):
    """The same of one robot."""
    env.reset(seed=5 + robot)
    found = []
    for k, action in enumerate(actions):
        if k == RESET and robot == 1:
            env.reset(seed=50 + robot)
        seen, reward, terminated, truncated, _ = env.step(action[robot])
        if terminated or truncated:
            seen, _ = env.reset()
        found.append((seen, reward, terminated or truncated))
    return found


def test_a_vector_behaves_as_single_environments_also_after_a_snapshot(task):
    envs = make_residual_vector_env(
        ROBOTS, "operation", conditions=HARD, autoreset_mode="SameStep", **task
    )
    numbers = envs.single_action_space.shape[0]
    random = np.random.default_rng(0)
    actions = random.uniform(-1, 1, (STEPS, ROBOTS, numbers)).astype(np.float32)
    envs.reset(seed=5)
    begun = together(envs, actions[:SNAPSHOT], 0)
    snapshot = envs.snapshot()
    rest = together(envs, actions, SNAPSHOT)
    ends = 0
    for robot in range(ROBOTS):
        expected = alone(make_residual_env("operation", HARD, **task), robot, actions)
        for ours, (seen, reward, end) in zip([*begun, *rest], expected, strict=True):
            assert ours[0][robot].tobytes() == seen.tobytes()
            assert (ours[1][robot], ours[2][robot]) == (reward, end)
            ends += end
    assert ends >= 2
    envs.restore(snapshot)
    for ours, theirs in zip(together(envs, actions, SNAPSHOT), rest, strict=True):
        for one, other in zip(ours, theirs, strict=True):
            assert one.tobytes() == other.tobytes()


def test_nothing_corrected_is_the_base_to_the_bit(task):
    plain = plain_vector()
    envs = make_residual_vector_env(
        ROBOTS, "operation", conditions=HARD, autoreset_mode="SameStep", **task
    )
    base = task["base"]
    policy = usm_baselines.make(base, plain) if isinstance(base, str) else base
    observation, _ = plain.reset(seed=5)
    envs.reset(seed=5)
    nothing = np.zeros(envs.action_space.shape, np.float32)
    state, done, ends = None, np.ones(ROBOTS, bool), 0
    for _ in range(STEPS):
        action, state = policy.predict(observation, state, done)
        observation, rewards, terminated, truncated, _ = plain.step(action)
        _, its_rewards, its_terminated, *_ = envs.step(nothing)
        done = terminated | truncated
        ends += done.sum()
        assert its_rewards.tobytes() == rewards.tobytes()
        assert (its_terminated == terminated).all()
    assert ends >= 2


def test_an_agent_is_shown_what_its_base_believes_and_foresees_by_that(agent):
    nominal = agent.nominal
    above, law = Residual(nominal, agent), usm_baselines.make("sta-navigator", nominal)
    layout, plain, random = above.layout, plain_vector(), np.random.default_rng(0)
    observation, _ = plain.reset(seed=0)
    memory, its_state, law_state, largest = None, None, None, 0.0
    start, ends = np.ones(ROBOTS, bool), 0
    for _ in range(STEPS):
        seen, memory = above.observe(observation, memory, start)
        _, its_state = agent.predict(observation, its_state, start)
        correction = agent.residual.correction * its_state[0].action.reshape(ROBOTS, 2, 3)
        largest = max(largest, np.abs(its_state[0].action).max())
        known = law.perceive(observation, law_state, start)
        _, law_state = law.decide(known, correction)
        believed = known.state[:, law.predictor_columns].copy()
        believed[:, :6] += correction.reshape(ROBOTS, 6)
        ahead = law.predictor.foresee(known.signals, believed, LEADS[-1])
        expected = {
            "estimated_error": believed[:, 0:6:3],
            "estimated_rate": believed[:, 1:6:3],
            "estimated_disturbance": believed[:, 2:6:3],
            **{f"foreseen_error_{lead}": ahead[lead - 1, :, :, 0] for lead in LEADS},
            "foreseen_rate": ahead[-1, :, :, 1],
        }
        for name, values in expected.items():
            place = layout.slices[name]
            bound = layout.bound[place]
            wanted = np.clip(values / layout.scale[place], -bound, bound)
            np.testing.assert_allclose(seen[:, place], wanted, rtol=1e-6, err_msg=name)
        action = random.uniform(-1, 1, (ROBOTS, above.actions)).astype(np.float32)
        command, memory = above.command(memory, action)
        observation, _, terminated, truncated, _ = plain.step(command)
        start = terminated | truncated
        ends += start.sum()
    assert largest > 0.3
    assert ends >= 1
