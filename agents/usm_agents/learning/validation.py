"""Scores of an agent: on held-out scenarios while it is trained, and on others in the end.

A validation is a point of the learning curve, as `curve.json` has it: `steps` and `seconds` of the
training so far, the means of `max_error_AXIS` (m), `ANGLE_error` (rad) and `thrust_variation`
(N/s) over the held-out scenarios, and in how many of them the robot was lost, `failures`. Curves of
version 0.1.0 lack the angles.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from usm_agents.artifact.network import Network
from usm_agents.learning.plan import TEST_SEED, Plan
from usm_agents.residual.task import Residual, ResidualPolicy
from usm_gym.evaluation import evaluate
from usm_gym.suites import unseen
from usm_gym.support.seeding import VALIDATION, stream
from usm_gym.support.text import mm
from usm_gym.support.validation import require
from usm_gym.task.metrics import ANGLE_ERROR, MAX_ERROR, attitude_of, axes_of, objective
from usm_gym.task.modes import AnyScenario
from usm_gym.task.nominal import shared_nominal

# Held-out scenarios of the training distribution, the same for all trainings.
VALIDATION_EPISODES = 32

Validation = dict[str, Any]


def held_out(plan: Plan, residual: Residual, episodes: int) -> list[AnyScenario]:
    """Draw the scenarios on which the agents of a plan are validated.

    Raises:
        ValueError: If they are not all of the nominal knowledge that the agent is trained with.
    """
    scenarios = [plan.scenario(stream(0, VALIDATION, i)) for i in range(episodes)]
    require(
        shared_nominal(scenarios) == residual.nominal,
        "conditions",
        plan.conditions,
        "one nominal knowledge for all scenarios",
    )
    return scenarios


def validate(
    residual: Residual,
    network: Network,
    scenarios: Sequence[AnyScenario],
    steps: int,
    seconds: float,
) -> Validation:
    """Score a network after so many steps and seconds of its training."""
    scores = evaluate(ResidualPolicy(residual, network), scenarios)
    means = {name: float(values.mean()) for name, values in metrics_of(scores.per_episode).items()}
    failures = int(scores.failed.sum())
    return {"steps": steps, "seconds": seconds, **means, "failures": failures}


def metrics_of(scores: Mapping[str, Any]) -> dict[str, Any]:
    """Those metrics of scores that a validation has, by name."""
    names = [MAX_ERROR + axis for axis in axes_of(scores)]
    names += [angle + ANGLE_ERROR for angle in attitude_of(scores)]
    return {name: scores[name] for name in (*names, "thrust_variation")}


def best_of(curve: Sequence[Validation]) -> Validation:
    """The best validation of a learning curve, the first of equal ones."""
    return min(curve, key=objective)


def in_words(validation: Validation) -> str:
    """A validation as a progress bar shows it."""
    errors = (mm(validation[MAX_ERROR + axis]) for axis in axes_of(validation))
    angles = (
        f", {np.degrees(validation[angle + ANGLE_ERROR]):.1f}°" for angle in attitude_of(validation)
    )
    variation = f"{validation['thrust_variation']:.0f} N/s"
    return f"{' / '.join(errors)} mm{''.join(angles)} at {variation}"


def score_unseen(
    plan: Plan, residual: Residual, network: Network, episodes: int, agent: str
) -> dict[str, Any]:
    """Score a network on scenarios that neither trained nor chose it.

    Args:
        plan: What was trained.
        residual: The residual task.
        network: The agent.
        episodes: How many scenarios.
        agent: The name by which the command that does it again calls the agent.

    Returns:
        The summary of the scores without the single episodes, and that command.
    """
    scenarios = unseen(plan.mode, plan.conditions, TEST_SEED, episodes)
    summary = evaluate(ResidualPolicy(residual, network), scenarios).summary()
    del summary["per_episode"]
    return {"command": plan.test_command(agent), **summary}
