"""Records episodes of policies as pictures, for films and pages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from usm_baselines.contender import Contender

from usm_gym.evaluation import rollout
from usm_gym.recording import Trajectory
from usm_gym.rendering.depiction import depiction_of
from usm_gym.simulation import Simulation
from usm_gym.support.validation import UsageError, in_one_line
from usm_gym.world import Episode


@dataclass(frozen=True)
class Take:
    """An episode of a policy.

    Attributes:
        name: The policy's name.
        told: What it is told besides the measured position and the reference; empty if unknown.
        pictures: One per frame, or fewer if the robot was lost, which the last one then shows.
        trajectory: The episode.
    """

    name: str
    told: str
    pictures: list[Any]
    trajectory: Trajectory


def instants(scenario: Episode, fps: float, speed: float) -> list[int]:
    """The control instants that the frames of an episode show, played `speed` times real time."""
    frames = max(1, round(fps * scenario.duration / speed))
    times = np.arange(frames + 1) * (speed / fps)
    counts = np.rint(times / scenario.conditions.control_period).astype(int)
    listed: list[int] = np.minimum(counts, scenario.steps).tolist()
    return listed


def take(
    contender: Contender,
    scenario: Episode,
    shown: Sequence[int],
    progress: Callable[[float], None] = lambda episodes: None,
) -> Take:
    """Let a policy act in a scenario.

    Args:
        contender: The policy.
        scenario: The scenario.
        shown: The control instants of the pictures, in ascending order.
        progress: See `usm_gym.evaluate`.

    Raises:
        ValueError: If the policy cannot be made or fails to act.
    """
    recorder, wanted = depiction_of(scenario.body).recorder(), set(shown)
    seen: dict[int, Any] = {}
    lost = False

    def watch(simulation: Simulation) -> None:
        nonlocal lost
        count = int(simulation.count[0])
        recorder.note(simulation)
        if not lost and (count in wanted or simulation.lost[0]):
            seen[count] = recorder.picture(simulation)
        lost |= bool(simulation.lost[0])

    policy = contender.make(scenario.nominal)
    try:
        (trajectory,) = rollout(policy, [scenario], progress, watch)
    except contender.refusals as error:
        kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
        raise UsageError(f"{contender.name} is refused: {kind}{in_one_line(error)}") from error
    end = max(seen)
    pictures = [seen[count] for count in shown if count < end] + [seen[end]]
    return Take(contender.name, contender.told, pictures, trajectory)
