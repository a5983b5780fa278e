"""A learner without Stable-Baselines3 and torch: regression of the true disturbance."""

import pickle

import numpy as np
from usm_agents.artifact.network import Network
from usm_agents.learning.learner import register

SETTINGS = {"robots": 4, "rollout": 16, "exploration": 0.2, "ridge": 1e-3, "full_action": 20.0}
STATE = "regression.pickle"


class Regression:
    """Learns by least squares to cancel, from what the agent observes, the true disturbance.

    Settings: control periods of a rollout; standard deviation of random actions; weight of the
    squared parameters; force of a full action, N.
    """

    def __init__(self, setup):
        self._setup, self._random = setup, np.random.default_rng(setup.seed)
        inputs, outputs = setup.envs.residual.layout.size, setup.envs.residual.actions
        self._squares = setup.settings["ridge"] * np.eye(inputs + 1)
        self._mass = setup.envs.residual.nominal.robot.total_mass
        self._products = np.zeros((inputs + 1, outputs))
        self._observation = None
        self.steps = 0

    def learn(self, steps, pause):
        if self._observation is None:
            self._observation, _ = self._setup.envs.reset(
                seed=self._setup.episode_seed,
                options={"scenario": self._setup.first_episodes},
            )
        while self.steps < steps:
            pause()
            for _ in range(self._setup.settings["rollout"]):
                self._step()

    def _step(self):
        settings, envs = self._setup.settings, self._setup.envs
        inputs = np.column_stack([self._observation, np.ones(envs.num_envs)]).astype(np.float64)
        wanted = np.zeros((envs.num_envs, envs.residual.actions))
        force = -self._mass * self._setup.truth()["disturbance"]
        wanted[:, :2] = force / settings["full_action"]
        self._squares += inputs.T @ inputs
        self._products += inputs.T @ wanted
        action = settings["exploration"] * self._random.standard_normal(wanted.shape)
        self._observation, *_ = envs.step(action.astype(np.float32))
        self.steps += envs.num_envs

    def export(self):
        solution = np.linalg.solve(self._squares, self._products).astype(np.float32)
        return Network((solution[:-1].copy(),), (solution[-1],), "tanh", "clip")

    def log(self, numbers):
        pass

    def save(self, checkpoint):
        learned = self.steps, self._squares, self._products, self._observation, self._random
        state = learned, self._setup.envs.snapshot()
        (checkpoint / STATE).write_bytes(pickle.dumps(state))

    def restore(self, checkpoint):
        learned, robots = pickle.loads((checkpoint / STATE).read_bytes())
        self.steps, self._squares, self._products, self._observation, self._random = learned
        self._setup.envs.restore(robots)


register("regression", Regression, SETTINGS)
