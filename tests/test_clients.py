"""What docs/tasks.md tells the users of other libraries to write works as it stands there."""

import re
import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

TASKS = (Path(__file__).parents[1] / "docs" / "tasks.md").read_text(encoding="utf-8")
TABLE = TASKS.split("| library | what to write |")[1].split("\n\n")[0]
LINES = dict(re.findall(r"^\| (.+?) \| `(.+)` \|$", TABLE, flags=re.MULTILINE))


def stable_baselines3(line):
    model = evaluated(line, "from stable_baselines3 import PPO")
    env = model.get_env()
    assert env.render_mode == "rgb_array"
    action, _ = model.predict(env.reset())
    assert env.step(action)[0].shape == (1, 94)


def rl_zoo(line):
    short = "--n-timesteps 1 --hyperparams n_steps:8 batch_size:8 --device cpu --eval-freq -1"
    subprocess.run([sys.executable, *line.split()[1:], *short.split()], check=True)


def torchrl(line):
    env = evaluated(line, "from torchrl.envs import GymEnv")
    assert env.rollout(3)["next", "max_error_x"].shape == (3,)
    env.close()


def rllib(line):
    config = evaluated(line, "from ray.rllib.algorithms.ppo import PPOConfig")
    runners = config.env_runners(num_env_runners=0, rollout_fragment_length=8)
    runners.training(train_batch_size_per_learner=8, minibatch_size=8, num_epochs=1)
    algorithm = runners.build_algo()
    assert algorithm.train()["num_env_steps_sampled_lifetime"] >= 8
    algorithm.stop()


def tianshou(line):
    envs = evaluated(line, "import gymnasium as gym; from tianshou.env import SubprocVectorEnv")
    assert envs.reset()[0].shape == (4, 94)
    assert envs.step(np.zeros((4, 5), np.float32))[0].shape == (4, 94)
    envs.close()


def skrl(line):
    envs = evaluated(
        line, "import gymnasium as gym, torch; from skrl.envs.wrappers.torch import wrap_env"
    )
    import torch

    assert envs.reset()[0].shape == (64, 94)
    assert envs.step(torch.zeros(64, 5))[0].shape == (64, 94)


def cleanrl(line):
    def thunk():
        env = gym.make("usm_gym:USM-Operation-v0")
        env = gym.wrappers.FlattenObservation(env)
        env = gym.wrappers.RecordEpisodeStatistics(env)
        env = gym.wrappers.ClipAction(env)
        env = gym.wrappers.NormalizeObservation(env)
        env = evaluated(line, "import gymnasium as gym, numpy as np", env=env)
        env = gym.wrappers.NormalizeReward(env)
        return gym.wrappers.TransformReward(env, lambda reward: np.clip(reward, -10, 10))

    same_step = gym.vector.AutoresetMode.SAME_STEP
    envs = gym.vector.SyncVectorEnv([thunk] * 2, autoreset_mode=same_step)
    envs.reset(seed=1)
    infos = {}
    while "final_info" not in infos:
        *_, infos = envs.step(np.ones((2, 5), np.float32))
    over = infos["final_info"]["_episode"]
    assert (infos["final_info"]["episode"]["r"][over] < 0).all()


def minari(line):
    pytest.importorskip("jax")  # which it collects with, and does not itself require
    env = evaluated(line, "import gymnasium as gym; from minari import DataCollector")
    env.reset(seed=0)
    env.step(env.action_space.sample())
    env.close()


def time_aware(line):
    env = evaluated(
        line, "import gymnasium as gym; from gymnasium.wrappers import TimeAwareObservation"
    )
    env.reset(seed=0)
    first = env.step(np.zeros(5, np.float32))[0]
    assert first.shape == (95,)
    assert first[-1] == 1.0


def evaluated(line, imports, **names):
    exec(imports, names)
    return eval(line, names)


# By the name in the table: the module that is needed, and what is done with the line.
CLIENTS = {
    "Stable-Baselines3": ("stable_baselines3", stable_baselines3),
    "RL Baselines3 Zoo": ("rl_zoo3", rl_zoo),
    "TorchRL": ("torchrl", torchrl),
    "RLlib": ("ray.rllib", rllib),
    "Tianshou": ("tianshou", tianshou),
    "skrl": ("skrl", skrl),
    "CleanRL": ("gymnasium", cleanrl),
    "Minari": ("minari", minari),
    "Gymnasium's `TimeAwareObservation`": ("gymnasium", time_aware),
}


def test_the_table_has_these_clients():
    assert LINES.keys() == CLIENTS.keys()


@pytest.mark.slow
@pytest.mark.parametrize("client", CLIENTS)
def test_the_line_of_a_client_works(client, tmp_path, monkeypatch):
    module, use = CLIENTS[client]
    pytest.importorskip(module, exc_type=ImportError)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    use(LINES[client])
