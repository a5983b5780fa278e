"""The study of residual agents: who is trained, on what all are scored, what follows from it."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.artifact import agent_contender, make_agent, read_agent, write_agent
from agents.dissection import dissect
from agents.plan import TEST_EPISODES, TEST_SEED, Plan, read_plan
from agents.selection import unseen
from agents.training import CURVE, train
from baselines.contender import Contender, contender
from baselines.scoring import Refusal, Task, score_all, shared_nominal
from usm_gym import parallel
from usm_gym.conditions import FIELD, PRESETS, Conditions
from usm_gym.evaluation import Evaluation, joined
from usm_gym.robot import Robot
from usm_gym.scenario import Mode
from usm_gym.statistics import interquartile_mean, interval
from usm_gym.validation import require

OBSERVER_STATES = ("base_rate", "base_disturbance", "base_integral", "base_alpha")
KALMAN_STATES = (
    "estimated_error",
    "estimated_rate",
    "estimated_disturbance",
    "estimated_thrust",
    "innovation",
)
JOINT_REFERENCES = (
    "reference_deflection",
    "reference_deflection_rate",
    "reference_deflection_acceleration",
    "bending_joints",
)

# The agents that are shipped, each as its seed 0.
AGENTS: dict[str, Plan] = {
    "residual-ppo": Plan(steps=2_000_000),
    "residual-sta-tuned": Plan(base="sta-tuned", steps=1_000_000),
    "residual-pd": Plan(base="pd", steps=1_500_000),
    "residual-lqg": Plan(base="lqg-tuned", steps=1_500_000),
    "residual-lqg-joints": Plan(base="lqg-joints-tuned", steps=1_500_000),
    "residual-torpedo": Plan(env="agents:USM-TorpedoResidual-v0", steps=1_000_000),
    "rl-only": Plan(base="zero", steps=2_000_000),
    "residual-sac": Plan(algorithm="sac", residual_scale=6.0, steps=400_000),
}

_SHORT = Plan(steps=1_000_000)
_EXACT = replace(
    FIELD,
    coefficient_range=(1.0, 1.0),
    current_limit=0.0,
    deflection_range=(1.2, 1.2),
    filter_range=(9.0, 9.0),
)
# What an agent owes to one decision or another: `residual-ppo` with a shorter training, less one.
ABLATIONS: dict[str, Plan] = {
    "reference": _SHORT,
    "scale-3": replace(_SHORT, residual_scale=3.0),
    "scale-6": replace(_SHORT, residual_scale=6.0),
    # To be held against scale-6.
    "thrusters": replace(_SHORT, action="thrusters", residual_scale=6.0),
    "scale-12": replace(_SHORT, residual_scale=12.0),
    "scale-40": replace(_SHORT, residual_scale=40.0),
    "no-observer-states": replace(_SHORT, omit=OBSERVER_STATES),
    "no-kalman-states": replace(_SHORT, omit=KALMAN_STATES),
    "frames-not-kalman": replace(_SHORT, omit=KALMAN_STATES, frames=4),
    "no-joint-references": replace(_SHORT, omit=JOINT_REFERENCES),
    "no-randomisation": replace(_SHORT, conditions=_EXACT),
}
PLANS = AGENTS | ABLATIONS
# Seeds of each training at most.
SEEDS = dict.fromkeys(AGENTS, 5) | dict.fromkeys(ABLATIONS, 3)

# Classical policies beside which the agents stand.
RIVALS = ("sta", "sta-tuned", "pd", "pd-tuned", "lqg", "lqg-tuned", "lqg-joints-tuned", "mpc-tuned")
# Where agents are taken that they have not been trained for.
TRANSFER: dict[str, Conditions] = {
    "ideal": PRESETS["ideal"],
    "rough": PRESETS["rough"],
    "still": replace(FIELD, motion=False),
    "coefficients": replace(FIELD, coefficient_range=(0.6, 1.4)),
}
HOME = "field"
DISSECTED_EPISODES = 16
# Kept of each episode.
KEPT = (
    "max_error_x",
    "max_error_y",
    "settled_error_x",
    "settled_error_y",
    "thrust_variation",
    "thrust_effort",
)

Array = NDArray[np.float64]
Document = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Run:
    """One training of the study.

    Attributes:
        name: Name of the agent or ablation.
        plan: What is trained.
        folder: Where.
    """

    name: str
    plan: Plan
    folder: Path

    @property
    def done(self) -> bool:
        """Whether the training has come to its end.

        Raises:
            ValueError: If the folder holds a training of another plan.
        """
        if not (self.folder / CURVE).exists():
            return False
        plan = read_plan(self.folder)
        name = self.folder.name
        had, has = plan.command(name), self.plan.command(name)
        require(had == has, f"the training in {self.folder}", had, has)
        return bool(self.curve[-1]["steps"] >= plan.steps)

    @property
    def curve(self) -> list[dict[str, Any]]:
        """The learning curve, as far as it goes."""
        curve: list[dict[str, Any]] = json.loads((self.folder / CURVE).read_text())
        return curve


def runs(names: Sequence[str], seeds: int, folder: Path, steps: int | None = None) -> list[Run]:
    """The trainings of the study, seed by seed, so that an early stop leaves some of each.

    Args:
        names: Names of agents and ablations.
        seeds: How many seeds, from 0 on, and no more than `SEEDS` of each.
        folder: Folder of the study.
        steps: How many steps each is trained; without it, as its plan says.

    Raises:
        ValueError: If a name is unknown.
    """
    found = []
    for seed in range(seeds):
        for name in names:
            require(name in PLANS, "--only", name, ", ".join(PLANS))
            if seed >= SEEDS[name]:
                continue
            plan = replace(PLANS[name], seed=seed, steps=steps or PLANS[name].steps)
            found.append(Run(name, plan, folder / "runs" / f"{name}-{seed}"))
    return found


def train_all(chosen: Sequence[Run], workers: int, report: Callable[[Run], object]) -> None:
    """Train what is not trained yet; an interrupted training goes on where it was."""
    waiting = []
    for run in chosen:
        if run.done:
            report(run)
        else:
            waiting.append(run)
    for index, _ in parallel.results(train_one, [(run,) for run in waiting], workers):
        report(waiting[index])


def train_one(run: Run) -> None:
    """Carry out one training."""
    train(run.plan, run.folder, lambda steps, line: None)


def tasks(
    chosen: Sequence[Run], rivals: Sequence[str], episodes: int = TEST_EPISODES
) -> dict[tuple[str, str], Task]:
    """What is scored, by policy and set: all at home, agents and rivals also elsewhere."""
    robot = Robot()
    modes = {run.plan.mode for run in chosen}
    sets = {
        (mode, name): unseen(
            mode, conditions, TEST_SEED, episodes if name == HOME else episodes // 2
        )
        for mode in sorted(modes)
        for name, conditions in {HOME: FIELD, **TRANSFER}.items()
    }
    found = {}

    def add(name: str, policy: Contender, mode: Mode, everywhere: bool) -> None:
        for (its, kind), chosen in sets.items():
            if its == mode and (everywhere or kind == HOME):
                nominal = shared_nominal(robot, chosen)
                found[name, kind] = Task(policy, tuple(chosen), nominal, robot)

    for run in chosen:
        agent = agent_contender(str(run.folder))
        add(run.folder.name, agent, run.plan.mode, run.name in AGENTS)
    for mode in sorted(modes):
        for id in rivals:
            add(rival_name(id, mode), contender(id), mode, everywhere=True)
    return found


def rival_name(id: str, mode: Mode) -> str:
    """The name of a classical policy's scores."""
    return id if mode == "operation" else f"{id} ({mode})"


def score(
    chosen: Mapping[tuple[str, str], Task],
    workers: int,
    cache: Path,
    progress: Callable[[int], object],
) -> dict[tuple[str, str], Evaluation]:
    """Score the tasks.

    Raises:
        ValueError: If a policy is refused.
    """
    outcomes = score_all(list(chosen.values()), workers, cache, progress)
    found = {}
    for key, outcome in zip(chosen, outcomes, strict=True):
        if isinstance(outcome, Refusal):
            raise ValueError(f"{key[0]} on {key[1]} is refused: {outcome.reason}")
        found[key] = outcome
    return found


def ship(chosen: Sequence[Run], folder: Path, provenance: Mapping[str, Any]) -> None:
    """Put each agent, as its seed 0, under its own name into a folder.

    Args:
        chosen: The trainings.
        folder: Where; each agent has a folder of its own there.
        provenance: Of the study.
    """
    for run in chosen:
        if run.name not in AGENTS or run.plan.seed != 0:
            continue
        agent, network = read_agent(run.folder)
        given = ("activation", "output", "weights")
        description = {
            field.name: getattr(agent, field.name)
            for field in dataclasses.fields(agent)
            if field.name not in given
        }
        trained = agent.training["provenance"]
        description["training"] = {
            **agent.training,
            "command": run.plan.command(run.name),
            "provenance": {**trained, "command": provenance["command"]},
        }
        tested = {**agent.scores["sampled"], "command": run.plan.test_command(run.name)}
        description["scores"] = {**agent.scores, "sampled": tested}
        write_agent(folder / run.name, description, network)


def document(
    chosen: Sequence[Run], scores: Mapping[tuple[str, str], Evaluation], rivals: Sequence[str]
) -> Document:
    """A row for each agent and ablation over its seeds, and one for each rival."""
    rows: dict[str, Any] = {}
    sets = [HOME, *TRANSFER]
    for name in dict.fromkeys(run.name for run in chosen):
        its = [run for run in chosen if run.name == name]
        parts = {
            kind: [scores[run.folder.name, kind] for run in its]
            for kind in sets
            if (its[0].folder.name, kind) in scores
        }
        rows[name] = {
            "agent": name in AGENTS,
            "mode": its[0].plan.mode,
            "base": its[0].plan.base,
            "command": its[0].plan.command(name),
            "curves": {str(run.plan.seed): run.curve for run in its},
            "scores": {kind: row(each) for kind, each in parts.items()},
        }
    modes: dict[Mode, None] = dict.fromkeys(run.plan.mode for run in chosen)
    return {
        "kind": "study",
        "study": "residual",
        "home": HOME,
        "seed": TEST_SEED,
        "rows": rows,
        "rivals": {
            name: {
                "mode": mode,
                "scores": {kind: row([scores[name, kind]]) for kind in sets},
            }
            for mode in modes
            for name in (rival_name(id, mode) for id in rivals)
        },
    }


def row(parts: Sequence[Evaluation]) -> dict[str, Any]:
    """Scores over seeds, as `Evaluation.summary` has them, with middle half and the seeds' means.

    Seeds are strata of the bootstrap, whose episodes are resampled; episodes are in the order of
    the seeds.
    """
    scores = joined(parts)
    labels = [str(seed) for seed, part in enumerate(parts) for _ in part.failed]
    found: dict[str, Any] = {"failures": int(scores.failed.sum()), "per_episode": {}}
    for name in KEPT:
        values = scores.per_episode[name]
        found["per_episode"][name] = values.tolist()
        found[name] = {
            "mean": float(values.mean()),
            "ci95": list(interval(np.mean, values, labels)),
            "iqm": float(interquartile_mean(values)),
            "iqm_ci95": list(interval(interquartile_mean, values, labels)),
            "worst": float(values.max()),
            "seeds": [float(part.per_episode[name].mean()) for part in parts],
        }
    return found


def claims(found: Document) -> dict[str, Any]:
    """What agents are to their bases and rivals at home, in pairs of equal episodes and noise.

    For each agent and rival of its mode: the ratio of the means in x and y, and in what share of
    scenarios the agent, as its seed 0, is better in both axes.
    """
    answer: dict[str, Any] = {}
    for name, each in found["rows"].items():
        if not each["agent"]:
            continue
        answer[name] = {}
        for rival, other in found["rivals"].items():
            if other["mode"] != each["mode"]:
                continue
            ours, theirs = each["scores"][HOME], other["scores"][HOME]
            axes = ("max_error_x", "max_error_y")
            pairs = [
                list(zip(ours["per_episode"][a], theirs["per_episode"][a], strict=False))
                for a in axes
            ]
            better = np.all([[one < two for one, two in each] for each in pairs], axis=0)
            answer[name][rival] = {
                "ratio": [ours[a]["mean"] / theirs[a]["mean"] for a in axes],
                "better_in_both": float(np.mean(better)),
            }
    return answer


def dissected(chosen: Sequence[Run]) -> dict[str, Any]:
    """What each agent, as its seed 0, does to its base; see `dissection`."""
    found = {}
    for run in chosen:
        if run.name in AGENTS and run.plan.seed == 0:
            episodes = unseen(run.plan.mode, FIELD, TEST_SEED, DISSECTED_EPISODES)
            nominal = shared_nominal(Robot(), episodes)
            policy = make_agent(nominal, str(run.folder))
            found[run.name] = dissect(policy, nominal, episodes)
    return found
