"""The native vector environment against Gymnasium's own, in every autoreset mode, bit for bit."""

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from support.episodes import NOISY

import usm_gym

ID, SPACE = "USM-Operation-v0", "USM-Operation3D-v0"
# Light thrusters and a strong current: some robots are lost soon, others late or never.
HARD = {"thruster_limit": 3.0, "current_limit": 0.3}


def native(count, id=ID, **arguments):
    return gym.make_vec(id, num_envs=count, vectorization_mode="vector_entry_point", **arguments)


def same(a, b):
    """Whether two infos, observations and the like are equal to the bit."""
    if isinstance(a, dict):
        assert a.keys() == b.keys()
        return all(same(a[key], b[key]) for key in a)
    a, b = np.asarray(a), np.asarray(b)
    if a.dtype == object:
        return all((x is None and y is None) or same(x, y) for x, y in zip(a, b, strict=True))
    return a.shape == b.shape and bool((a == b).all())


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_every_autoreset_mode_is_gymnasiums_to_the_bit(mode):
    envs = native(5, conditions=HARD, autoreset_mode=mode)
    assert envs.metadata["autoreset_mode"] is mode
    single = [lambda: gym.make(ID, conditions=HARD) for _ in range(5)]
    reference = SyncVectorEnv(single, autoreset_mode=mode)
    ours, theirs = envs.reset(seed=11), reference.reset(seed=11)
    assert same(ours[0], theirs[0])
    assert same(ours[1], theirs[1])
    actions = np.random.default_rng(0).uniform(-1, 1, (900, 5, 5)).astype(np.float32)
    ends = 0
    for action in actions:
        ours, theirs = envs.step(action), reference.step(action)
        for a, b in zip(ours, theirs, strict=True):
            assert same(a, b)
        done = ours[2] | ours[3]
        ends += done.sum()
        if mode is AutoresetMode.DISABLED and done.any():
            ours = envs.reset(options={"reset_mask": done})
            theirs = reference.reset(options={"reset_mask": done})
            assert same(ours[0], theirs[0])
            assert same(ours[1], theirs[1])
    assert ends >= 5


@pytest.mark.parametrize(
    ("id", "conditions", "threads"),
    [
        *((ID, conditions, threads) for conditions in ("basin", "sea") for threads in (1, 2)),
        *((SPACE, "basin", 1), (SPACE, "sea", 2), ("USM-Torpedo3D-v0", "sea", 1)),
        *(("USM-Head-v0", "sea", 2), ("USM-Head3D-v0", "sea", 1)),
    ],
)
def test_in_basin_and_sea_many_have_the_bits_of_single_environments(id, conditions, threads):
    envs = native(9, id, conditions=conditions, threads=threads)  # more than one block
    reference = SyncVectorEnv([lambda: gym.make(id, conditions=conditions) for _ in range(9)])
    assert same(envs.reset(seed=5)[0], reference.reset(seed=5)[0])
    ends, shape = 0, (400, *envs.action_space.shape)
    for action in np.random.default_rng(0).uniform(-0.5, 0.5, shape).astype(np.float32):
        ours, theirs = envs.step(action), reference.step(action)
        for a, b in zip(ours, theirs, strict=True):
            assert same(a, b)
        ends += (ours[2] | ours[3]).sum()
    assert ends > 0  # some have gone on with another episode


def test_a_whole_noisy_episode_with_feedback_is_the_single_environments():
    envs = native(11, conditions=NOISY)
    policy = usm_baselines.make("sta", envs)
    seeds = list(range(100, 111))
    observations, _ = envs.reset(seed=seeds)
    state, record = None, [observations]
    for _ in range(2000):
        actions, state = policy.predict(observations, state)
        observations, *_, infos = envs.step(actions)
        record.append(observations)
    for index in (0, 7, 8, 10):
        env = gym.make(ID, conditions=NOISY)
        policy = usm_baselines.make("sta", env)
        observation, _ = env.reset(seed=seeds[index])
        state = None
        for k in range(2000):
            assert (observation == record[k][index]).all()
            action, state = policy.predict(observation, state)
            observation, _, _, truncated, info = env.step(action)
        assert truncated
        assert info == {key: infos[key][index] for key in info}


def test_the_number_of_threads_changes_no_bit():
    record = []
    for threads in (1, 2, 3):
        envs = native(40, threads=threads)
        policy = usm_baselines.make("sta", envs)
        observations, _ = envs.reset(seed=0)
        state = None
        for _ in range(300):
            actions, state = policy.predict(observations, state)
            observations, *_ = envs.step(actions)
        record.append(observations)
        envs.close()
        envs.close()
    assert (record[0] == record[1]).all()
    assert (record[0] == record[2]).all()


@pytest.mark.parametrize(("id", "name"), [(ID, "operation"), (SPACE, "operation3d")])
def test_scenarios_for_all_and_for_each(id, name):
    envs = native(3, id)
    envs.reset(options={"scenario": "nominal"})
    assert len(set(envs.unwrapped.simulation.scenarios)) == 1
    suite = usm_gym.suite(name)
    envs.reset(seed=0, options={"scenario": [suite[4], None, suite[5].to_dict()]})
    scenarios = envs.unwrapped.simulation.scenarios
    assert scenarios[0] == suite[4]
    assert scenarios[2] == suite[5]
    assert scenarios[1] not in suite


def test_without_autoreset_an_ended_episode_waits():
    envs = native(2, conditions=HARD, autoreset_mode=AutoresetMode.DISABLED)
    envs.reset(seed=0)
    ended = False
    while not ended:
        _, _, terminated, truncated, _ = envs.step(np.ones((2, 5), np.float32))
        ended = (terminated | truncated).any()
    with pytest.raises(gym.error.ResetNeeded, match="wait for reset"):
        envs.step(np.ones((2, 5), np.float32))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"num_envs": 0}, "num_envs is 0"),
        ({"num_envs": 2, "threads": 0}, "threads is 0"),
        ({"num_envs": 2, "conditions": "wet"}, "conditions is 'wet'"),
        ({"num_envs": 2, "autoreset_mode": "Never"}, "Never"),
        ({"num_envs": 2, "robot": "snake"}, "robot is 'snake'"),
    ],
)
@pytest.mark.parametrize("id", [ID, SPACE])
def test_bad_arguments_are_refused(id, arguments, message):
    with pytest.raises(ValueError, match=message):
        gym.make_vec(id, vectorization_mode="vector_entry_point", **arguments)


def test_what_was_never_made_can_be_closed():
    env = usm_gym.envs.usm.USMVectorEnv
    env.__new__(env).close()


def test_more_robots_than_one_process_can_bear_are_refused():
    envs = native(16_000, robot={"links": 256})
    with pytest.raises(ValueError, match="up to 4000000 links"):
        envs.reset(seed=0, options={"scenario": "nominal"})
    envs = native(4_000, conditions={"control_period": 0.2, "physics_step": 2e-5})
    with pytest.raises(ValueError, match="physics steps at a time"):
        envs.reset(seed=0, options={"scenario": "nominal"})


def test_bad_calls_are_refused():
    envs = native(2)
    with pytest.raises(gym.error.ResetNeeded):
        envs.step(np.zeros((2, 5), np.float32))
    with pytest.raises(ValueError, match="reset_mask"):
        envs.reset(options={"reset_mask": np.array([True, False])})
    envs.reset(seed=0)
    with pytest.raises(ValueError, match="shape"):
        envs.step(np.zeros((3, 5), np.float32))
    with pytest.raises(ValueError, match="seed"):
        envs.reset(seed=[1])
    with pytest.raises(ValueError, match="reset_mask"):
        envs.reset(options={"reset_mask": [True, False]})
    with pytest.raises(ValueError, match="scenario"):
        envs.reset(options={"scenario": ["nominal"]})
    slow = {"conditions": {"control_period": 0.04}}
    with pytest.raises(ValueError, match="as the others"):
        envs.reset(options={"scenario": [None, slow]})
