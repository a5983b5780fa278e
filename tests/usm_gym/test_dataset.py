"""Datasets hold what the environment of one robot does when it is given the same actions."""

from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines

import usm_gym
from usm_gym.dataset import SPARE, new_dataset, record, reset_seeds
from usm_gym.suites import NAMES, suite, unseen
from usm_gym.task.conditions import FIELD

minari = pytest.importorskip("minari", reason="the extra `datasets` is not installed")

TASK = "usm_gym:USM-Operation-v0"


class Wild:
    """Acts beyond the action space, and loses one robot earlier than the other."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        step = 0 if state is None else state
        action = np.full((len(observation), 5), 3.0 * np.sin(0.1 * step), np.float32)
        action[0] = np.inf if step > 50 else 0.5
        return action, step + 1


@pytest.fixture
def made(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    return gym.make(TASK, conditions={"thruster_limit": 15.0})


@pytest.mark.parametrize("policy", ["sta", "wild"])
def test_stored_actions_make_the_same_episode_again(policy, made):
    env = made.unwrapped
    policy = Wild() if policy == "wild" else usm_baselines.make(policy, env)
    seeds = reset_seeds(1, 2)
    with new_dataset("here/there/those-v0", made, {"algorithm_name": "mine"}) as add:
        add(record(policy, env, seeds))
    dataset = minari.load_dataset("here/there/those-v0")
    assert list(minari.list_local_datasets()) == [dataset.id]
    assert dataset.storage.metadata["algorithm_name"] == "mine"
    assert (dataset.observation_space, dataset.action_space) == (
        env.observation_space,
        env.action_space,
    )
    again = dataset.recover_environment()
    assert again.unwrapped.conditions == env.conditions
    known = list(dataset.storage.get_episode_metadata(range(2)))
    assert [each["seed"] for each in known] == seeds
    for episode, each in zip(dataset, known, strict=True):
        assert episode.observations.dtype == episode.actions.dtype == np.float32
        assert all(map(dataset.action_space.contains, episode.actions))
        assert all(map(dataset.observation_space.contains, episode.observations))
        seen, info = again.reset(seed=each["seed"])
        assert_same(episode, 0, seen, info)
        for k, action in enumerate(episode.actions):
            seen, reward, terminated, truncated, info = again.step(action)
            assert_same(episode, k + 1, seen, info)
            assert episode.rewards[k] == reward
            assert (episode.terminations[k], episode.truncations[k]) == (terminated, truncated)
            assert (terminated or truncated) == (k == len(episode) - 1)


def assert_same(episode, k, seen, info):
    np.testing.assert_array_equal(episode.observations[k], seen)
    assert {key: values[k] for key, values in episode.infos.items()} == info


@pytest.mark.parametrize("policy", ["sta", "zero"])
def test_the_score_of_an_episode_is_the_one_that_evaluation_gives(policy):
    env = gym.make(TASK).unwrapped
    policy, seeds, scenarios = usm_baselines.make(policy, env), reset_seeds(0, 3), []
    for seed in seeds:
        env.reset(seed=seed)
        scenarios.append(env.scenario)
    scores = usm_gym.evaluate(policy, scenarios)
    for index, episode in enumerate(record(policy, env, seeds)):
        assert bool(episode.terminations[-1]) == scores.failed[index]
        time = env.scenario.conditions.control_period * np.arange(1, len(episode) + 1)
        error = np.stack([episode.infos[f"error_{axis}"][1:] for axis in "xy"], axis=1)
        largest = usm_gym.max_error(time, error, env.scenario.settle_time)
        for axis, value in zip("xy", largest, strict=True):
            if not scores.failed[index]:
                assert scores.per_episode[f"max_error_{axis}"][index] == value


def test_nobody_else_meets_the_scenarios_of_a_dataset():
    env = gym.make(TASK).unwrapped
    met = set()
    for seed in range(3):
        assert reset_seeds(seed, 5) == reset_seeds(seed, 9)[:5]
        for each in reset_seeds(seed, 20):
            env.reset(seed=each)
            met.add(env.scenario.noise_seed)
    assert len(met) == 60
    others = [each for seed in range(3) for each in unseen("operation", FIELD, seed, 20)]
    others += [each for name in NAMES for each in suite(name)]
    assert not met & {each.noise_seed for each in others}


@pytest.mark.parametrize("name", ["sta", "sta-v", "", "../sta-v0", "/sta-v0", "a//b.c-v0", "\0-v1"])
def test_what_is_no_id_is_refused(name, made, tmp_path):
    with pytest.raises(ValueError, match="NAMESPACE/NAME-vN"), new_dataset(name, made, {}):
        pass
    assert not list(tmp_path.iterdir())


def test_a_dataset_is_whole_or_not_there_and_never_overwritten(made, tmp_path, monkeypatch):
    episodes = record(Wild(), made.unwrapped, [3])

    def write(name, then=lambda: None):
        with new_dataset(name, made, {}) as add:
            add(episodes)
            assert not minari.list_local_datasets()
            with pytest.raises(BlockingIOError), new_dataset(name, made, {}):
                pass
            then()

    def fail():
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("shutil.disk_usage", lambda path: SimpleNamespace(free=SPARE))
        with pytest.raises(OSError, match="No space left"):
            write("here/those-v0")
    for name in ("here/those-v0", "those-v0"):
        with pytest.raises(KeyboardInterrupt):
            write(name, fail)
        assert not list((tmp_path / "datasets").iterdir())
    write("here/those-v0")
    before = (tmp_path / "datasets/here/those-v0/data/main_data.hdf5").read_bytes()
    with pytest.raises(ValueError, match="here/those-v0'; allowed: a new one"):
        write("here/those-v0")
    assert (tmp_path / "datasets/here/those-v0/data/main_data.hdf5").read_bytes() == before
    with new_dataset("here/others-v0", made, {}):
        pass
    assert set(minari.list_local_datasets()) == {"here/those-v0", "here/others-v0"}
