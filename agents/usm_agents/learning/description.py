"""What `agent.json` says of an agent that was trained."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from usm_agents.artifact.folder import weights_of
from usm_agents.learning.plan import Plan
from usm_agents.learning.validation import Validation, best_of
from usm_agents.residual.task import Residual
from usm_gym.support.provenance import provenance


def describe(
    plan: Plan,
    residual: Residual,
    settings: Mapping[str, Any],
    curve: Sequence[Validation],
    tested: Mapping[str, Any],
    agent: str,
) -> dict[str, Any]:
    """Describe the best agent of a training, as `write_agent` takes it.

    Args:
        plan: What was trained.
        residual: The residual task.
        settings: Settings of the learner.
        curve: The validations so far.
        tested: Scores by the name of where they come from, other than the validation.
        agent: Name of the agent, by which the command that trains it again calls it.
    """
    recorded, best = plan.record(), best_of(curve)
    gains = getattr(residual.base, "gains", None)
    return {
        "summary": summary_of(plan),
        "mode": plan.mode,
        "conditions": recorded["conditions"],
        "base": plan.base.partition("@")[0],
        "base_weights": weights_of(plan.base),
        "gains": gains._asdict() if gains else {},
        **plan.task,
        "layout": residual.layout.fingerprint,
        "algorithm": plan.algorithm,
        "seed": plan.seed,
        "steps": best["steps"],
        "training": {
            "plan": recorded,
            "settings": dict(settings),
            "curve": list(curve),
            "command": plan.command(agent),
            "provenance": provenance({"seed": plan.seed}),
        },
        "scores": {"validation": best, **tested},
    }


def summary_of(plan: Plan) -> str:
    """What is trained, in a line."""
    algorithm = plan.algorithm.rpartition(":")[2]
    if plan.action == "estimates":
        return f"{plan.base} on estimates that are corrected by learning ({algorithm})"
    return f"{algorithm.upper()} residual on {plan.base}"
