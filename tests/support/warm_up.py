"""Compile kernels, so that tests find them compiled instead of each process compiling its own.

    python tests/support/warm_up.py robots
    python tests/support/warm_up.py laws

The two parts share few kernels, and so may run side by side. Of those of the robot in space, which
take longest, one has those for a single robot and the other those for many.
"""

import sys
from dataclasses import replace

import gymnasium as gym
import numpy as np
import usm_agents  # noqa: F401 (registers the residual tasks and the agents)
import usm_baselines
from usm_baselines import registry
from usm_baselines.paper.reproduction import cases, run_cases

from usm_gym.evaluation import evaluate
from usm_gym.suites import suite
from usm_gym.task.modes import of_head
from usm_gym.task.scenario import STILL
from usm_gym.world import world_of

TASKS = ("USM-Operation-v0", "usm_agents:USM-OperationResidual-v0")
SPACE = "USM-Operation3D-v0"


def brief(scenario):
    return replace(scenario, duration=0.1, settle_time=0.02, inspection=STILL)


def step(env):
    env.reset(seed=0)
    env.step(env.action_space.sample())


def robots():
    """Simulations, environments, and the reproduction of the paper."""
    step(gym.make(SPACE))
    for conditions in ("field", "basin"):
        for task in TASKS:
            step(gym.make(task, conditions=conditions))
            step(gym.make_vec(task, 2, "vector_entry_point", conditions=conditions))
    scenario = suite("operation")[0]
    evaluate(usm_baselines.make("zero", scenario.nominal), [brief(scenario)])
    run_cases([replace(case, scenario=brief(case.scenario)) for case in cases()], 1, lambda: None)


def laws():
    """Every policy that acts on observations alone, and many robots in space."""
    step(gym.make_vec(SPACE, 2, "vector_entry_point"))
    for name in ("operation", "operation-basin", "head"):
        scenario = suite(name)[0]
        nominal = scenario.nominal
        observation = np.zeros((1, world_of(nominal.robot).layout.size), np.float32)
        for id in usm_baselines.ids():
            if registry.entry(id).privileged or registry.entry(id).tuned_for:
                continue
            if registry.entry(id).moves_joints != of_head(scenario.mode):
                continue
            policy = usm_baselines.make(id, nominal)
            _, state = policy.predict(observation, None, np.ones(1, bool))
            policy.predict(observation, state, np.zeros(1, bool))


if __name__ == "__main__":
    {"robots": robots, "laws": laws}[sys.argv[1]]()
