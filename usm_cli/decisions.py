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
from usm_gym.task.conditions import IN_SPACE
from usm_gym.task.modes import AnyMode, AnyScenario, presets_of, sample_of

# Decisions in a row, two seconds of an episode.
DECISIONS = 100


def policies(mode: AnyMode = "operation") -> list[str]:
    """The policies that are timed in a mode: all meant for a tier, but those given true state."""
    tiers = (meant_for(conditions, mode) for conditions in presets_of(mode).values())
    ids = dict.fromkeys(id for tier in tiers for id in tier)
    return [id for id in ids if not entry(id).privileged]


def decision_times(
    ids: list[str],
    rounds: int,
    progress: Callable[[], object] = lambda: None,
    mode: AnyMode = "operation",
) -> dict[str, Figure]:
    """How long policies take for a decision in a mode, for one robot, us."""
    timings = [timing(id, mode) for id in ids]
    times = interleaved(timings, rounds, progress)
    return {id: summarise(values) for id, values in times.items()}


def timing(id: str, mode: AnyMode) -> Timing:
    """Time a policy's decisions on what it has seen at the beginning of an episode."""
    presets = presets_of(mode)
    tier = entry(id).tuned_for.removesuffix(IN_SPACE)
    scenario = sample_of(mode, presets.get(tier, presets["field"]), stream(1, EVALUATION, 0))
    seen = observations(id, scenario)
    policy, start = make(id, scenario.nominal), np.array([True])

    def run() -> None:
        state = None
        for k, observation in enumerate(seen):
            _, state = policy.predict(observation, state, start & (k == 0), deterministic=True)

    return Timing(id, run, DECISIONS, 1e6)


def observations(id: str, scenario: AnyScenario) -> list[NDArray[np.float32]]:
    """What a policy sees at the beginning of an episode, (1, numbers) each."""
    policy, simulation, state = make(id, scenario.nominal), Simulation([scenario]), None
    seen = []
    for k in range(DECISIONS):
        seen.append(simulation.observation.copy())
        action, state = policy.predict(seen[-1], state, np.array([k == 0]), deterministic=True)
        simulation.step(np.asarray(action, np.float32))
    return seen
