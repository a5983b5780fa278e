"""Shipped agents: policies like the scripted ones, and as good as their files say."""

import subprocess
import sys

import pytest
import usm_agents  # noqa: F401 (registers them)
import usm_baselines
from usm_agents.artifact.folder import DESCRIPTION, PRETRAINED, read_agent
from usm_baselines.tiers import meant_for

import usm_gym
from usm_gym.suites import unseen
from usm_gym.task.conditions import Conditions
from usm_gym.task.metrics import MAX_ERROR, axes_of

SHIPPED = [file.parent for file in sorted(PRETRAINED.glob(f"*/{DESCRIPTION}"))]


@pytest.mark.parametrize("folder", SHIPPED, ids=lambda folder: folder.name)
def test_a_shipped_agent_beats_its_base_as_it_says(folder):
    agent, _ = read_agent(folder)
    conditions = Conditions(**agent.conditions)
    assert folder.name in meant_for(conditions, agent.mode)
    scenarios = unseen(agent.mode, conditions, seed=11, episodes=16)
    nominal = scenarios[0].nominal
    ours, base = (
        usm_gym.evaluate(usm_baselines.make(id, nominal, **gains), scenarios)
        for id, gains in ((folder.name, {}), (agent.base, agent.gains))
    )
    assert not ours.failed.any()
    assert ours.objective().mean() < base.objective().mean()
    for name in (MAX_ERROR + axis for axis in axes_of(ours.per_episode)):
        assert ours.per_episode[name].mean() < 2.0 * agent.scores["validation"][name]


@pytest.mark.slow
def test_scoring_a_shipped_agent_does_not_import_torch():
    code = """
import sys, usm_agents, usm_baselines, usm_gym
suite = usm_gym.suite("operation")[:1]
usm_gym.evaluate(usm_baselines.make("residual-ppo", suite[0].nominal), suite)
sys.exit("torch" in sys.modules)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
