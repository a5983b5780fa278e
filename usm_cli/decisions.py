"""Measures how long policies take for a decision."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from usm_baselines.registry import entry, make
from usm_baselines.tiers import meant_for

from usm_cli.speed import Figure, Timing, interleaved, summarise
from usm_gym.simulation import Simulation
from usm_gym.support.seeding import EVALUATION, stream
from usm_gym.task.conditions import FIELD, PRESETS
from usm_gym.task.sampling import sample
from usm_gym.task.scenario import Scenario

# Decisions in a row, two seconds of an episode.
DECISIONS = 100


def policies() -> list[str]:
    """The policies that are timed: all that are meant for a tier, but those given true state."""
    tiers = (meant_for(conditions) for conditions in PRESETS.values())
    ids = dict.fromkeys(id for tier in tiers for id in tier)
    return [id for id in ids if not entry(id).privileged]


def decision_times(
    ids: list[str], rounds: int, progress: Callable[[], object] = lambda: None
) -> dict[str, Figure]:
    """How long policies take for a decision, for one robot, us."""
    timings = [timing(id) for id in ids]
    times = interleaved(timings, rounds, progress)
    return {id: summarise(values) for id, values in times.items()}


def timing(id: str) -> Timing:
    """Time a policy's decisions on what it has seen at the beginning of an episode."""
    conditions = PRESETS.get(entry(id).tuned_for, FIELD)
    scenario = sample("operation", conditions, stream(1, EVALUATION, 0))
    seen = observations(id, scenario)
    policy, start = make(id, scenario.nominal), np.array([True])

    def run() -> None:
        state = None
        for k, observation in enumerate(seen):
            _, state = policy.predict(observation, state, start & (k == 0), deterministic=True)

    return Timing(id, run, DECISIONS, 1e6)


def observations(id: str, scenario: Scenario) -> list[NDArray[np.float32]]:
    """What a policy sees at the beginning of an episode, (1, numbers) each."""
    policy, simulation, state = make(id, scenario.nominal), Simulation([scenario]), None
    seen = []
    for k in range(DECISIONS):
        seen.append(simulation.observation.copy())
        action, state = policy.predict(seen[-1], state, np.array([k == 0]), deterministic=True)
        simulation.step(np.asarray(action, np.float32))
    return seen
