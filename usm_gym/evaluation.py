"""The one rollout loop that scores every policy, scripted or learned."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usm_gym.envs.env import saturated
from usm_gym.robot import Robot
from usm_gym.simulation import Simulation
from usm_gym.statistics import mean_interval
from usm_gym.support import parallel
from usm_gym.support.validation import is_whole, require
from usm_gym.task import metrics
from usm_gym.task.observation import ObservationLayout
from usm_gym.task.scenario import Scenario

AXES = ("x", "y")
# What side by side is kept of all episodes: some three gigabytes.
MOST_SAMPLES = 50_000_000
POSITION_METRICS = tuple(
    f"{name}_{axis}" for name in ("max_error", "settled_error", "rms_error") for axis in AXES
)
METRICS = (
    *POSITION_METRICS,
    "heading_error",
    "thrust_effort",
    "thrust_variation",
    "saturation_share",
)


@dataclass(frozen=True)
class Trajectory:
    """What happened in an episode, at the control instants after each step, up to a loss.

    Attributes:
        scenario: The episode's scenario.
        time: Times, s, (samples,).
        error: True position errors, m, (samples, 2).
        heading_error: Heading errors, rad, (samples,).
        command: Thruster commands after saturation, N, (samples, thrusters).
        lost: Whether the robot was lost.
    """

    scenario: Scenario
    time: NDArray[np.float64]
    error: NDArray[np.float64]
    heading_error: NDArray[np.float64]
    command: NDArray[np.float64]
    lost: bool


@dataclass(frozen=True)
class Evaluation:
    """Scores of a policy, per episode in the order of the scenarios.

    Attributes:
        per_episode: Values of each metric of `METRICS`, (episodes,).
        failed: Which episodes lost the robot, (episodes,).
    """

    per_episode: dict[str, NDArray[np.float64]]
    failed: NDArray[np.bool_]

    def summary(self) -> dict[str, Any]:
        """Mean with interval and worst episode of each metric, failures, and all episodes."""
        row: dict[str, Any] = {}
        for name, values in self.per_episode.items():
            mean, interval = mean_interval(values)
            row[name] = {"mean": mean, "ci95": list(interval), "worst": float(values.max())}
        row["failures"] = int(self.failed.sum())
        row["per_episode"] = {name: values.tolist() for name, values in self.per_episode.items()}
        row["per_episode"]["failed"] = self.failed.tolist()
        return row


def joined(parts: Sequence[Evaluation]) -> Evaluation:
    """Scores of one policy on one list of scenarios after the other."""
    return Evaluation(
        per_episode={
            name: np.concatenate([part.per_episode[name] for part in parts]) for name in METRICS
        },
        failed=np.concatenate([part.failed for part in parts]),
    )


def evaluate(
    policy: Any,
    scenarios: Sequence[Scenario],
    *,
    robot: Robot | None = None,
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Evaluation:
    """Score a policy on scenarios, each with its own noise.

    Args:
        policy: Anything with `predict`; it is called with a batch axis. To be pickled for more than
            one worker. One with `privileged = True` is also given `snapshot=`, the true state. What
            was trained on the residual task goes in as `usm_agents.ResidualPolicy(env, model)`.
        scenarios: The episodes.
        robot: The robot; without one, the paper's.
        workers: Number of processes; without effect on the result, unless the policy's answer to
            a row depends on the other rows, as torch's does in its last bits.
        progress: Called now and then with the number of episodes done since the last call; with
            one worker, fractions of them.

    Returns:
        The scores.

    Raises:
        ValueError: If there is no scenario, or the policy wants another observation or returns what
            is no action.
    """
    listed = isinstance(scenarios, Sequence) and len(scenarios) > 0
    valid = listed and all(isinstance(each, Scenario) for each in scenarios)
    require(valid, "scenarios", scenarios, "a list of one Scenario or more")
    require(is_whole(workers, 1), "workers", workers, "1 or more")
    report = progress or (lambda episodes: None)
    body = robot or Robot()
    _require_fit(policy, body)
    for scenario in scenarios:
        score(_at_rest(scenario, body))  # refuses an episode that leaves nothing to score
    if workers == 1:
        rows = [score(each) for each in rollout(policy, scenarios, body, report)]
    else:
        size = -(-len(scenarios) // workers)
        chunks = [scenarios[i : i + size] for i in range(0, len(scenarios), size)]
        done = {}
        for index, part in parallel.results(
            _score_all, [(policy, chunk, body) for chunk in chunks], workers
        ):
            done[index] = part
            report(len(part))
        rows = [row for index in sorted(done) for row in done[index]]
    return Evaluation(
        per_episode={name: np.array([row[name] for row in rows]) for name in METRICS},
        failed=np.array([bool(row["failed"]) for row in rows]),
    )


def rollout(
    policy: Any,
    scenarios: Sequence[Scenario],
    robot: Robot,
    progress: Callable[[float], None] = lambda episodes: None,
    watch: Callable[[Simulation], None] = lambda simulation: None,
) -> list[Trajectory]:
    """Run a policy through scenarios, side by side as far as their timing agrees.

    `watch` is called with each simulation at its start and after each step.
    """
    trajectories: dict[int, Trajectory] = {}
    order = sorted(range(len(scenarios)), key=lambda i: (scenarios[i].conditions.timing, i))
    for _, group in groupby(order, key=lambda i: scenarios[i].conditions.timing):
        indices = list(group)
        batch = [scenarios[i] for i in indices]
        trajectories.update(zip(indices, _run(policy, batch, robot, progress, watch), strict=True))
    return [trajectories[i] for i in range(len(scenarios))]


def score(trajectory: Trajectory) -> dict[str, float | bool]:
    """The metrics of an episode; a lost one counts as at least 0.5 m in both axes."""
    scenario, time, error = trajectory.scenario, trajectory.time, trajectory.error
    settle = scenario.settle_time
    if trajectory.lost:
        largest = max(metrics.LOST_ERROR, float(np.abs(error).max()))
        row = dict.fromkeys(POSITION_METRICS, largest)
        heading = np.abs(trajectory.heading_error).max()
    else:
        values = np.concatenate(
            [
                metrics.max_error(time, error, settle),
                metrics.settled_error(time, error, scenario.shifts, settle),
                metrics.rms_error(time, error, settle),
            ]
        )
        row = dict(zip(POSITION_METRICS, values.tolist(), strict=True))
        heading = np.abs(trajectory.heading_error[time >= settle]).max()
    period, limit = scenario.conditions.control_period, scenario.conditions.thruster_limit
    return {
        **row,
        "heading_error": float(heading),
        "thrust_effort": metrics.thrust_effort(trajectory.command),
        "thrust_variation": metrics.thrust_variation(trajectory.command, period),
        "saturation_share": metrics.saturation_share(trajectory.command, limit),
        "failed": trajectory.lost,
    }


def _run(
    policy: Any,
    scenarios: Sequence[Scenario],
    robot: Robot,
    progress: Callable[[float], None],
    watch: Callable[[Simulation], None],
) -> list[Trajectory]:
    size, thrusters = len(scenarios), len(robot.thrusters)
    length = max(scenario.steps for scenario in scenarios)
    require(
        size * length <= MOST_SAMPLES,
        "scenarios",
        f"{size} episodes of up to {length} control periods",
        f"{MOST_SAMPLES} control periods side by side",
    )
    simulation = Simulation(robot, scenarios)
    watch(simulation)
    error = np.empty((length, size, 2))
    heading = np.empty((length, size))
    command = np.empty((length, size, thrusters))
    ends = simulation.steps.copy()
    lost = np.zeros(size, bool)
    state: Any = None
    known = getattr(policy, "nominal", None)
    period = scenarios[0].conditions.control_period
    if known is not None:
        require(
            known.control_period == period,
            "control_period",
            period,
            f"that for which the policy was made, {known.control_period}",
        )
    for k in range(length):
        truth = {"snapshot": simulation.snapshot()} if getattr(policy, "privileged", False) else {}
        start = np.full(size, k == 0)
        seen = simulation.observation.copy()
        answer = policy.predict(seen, state, start, deterministic=True, **truth)
        require(
            isinstance(answer, tuple) and len(answer) == 2,
            "what predict returns",
            type(answer).__name__,
            "a pair (action, state)",
        )
        state = answer[1]
        action = saturated(answer[0], (size, thrusters))
        alive = (k < ends) & ~lost
        missing = np.isnan(action)
        require(not missing[alive].any(), "the policy's action", "NaN", "numbers")
        simulation.step(np.where(missing, np.float32(0.0), action))
        watch(simulation)
        error[k], heading[k] = simulation.error, simulation.heading_error
        command[k] = simulation.command
        now = simulation.lost & alive
        ends[now] = k + 1
        lost |= now
        if k % 100 == 99 or k == length - 1:
            progress(size * (k % 100 + 1) / length)
            if lost.all():
                progress(size * (length - 1 - k) / length)
                break
    return [
        Trajectory(
            scenario=scenario,
            time=np.arange(1, end + 1, dtype=np.float64) * period,
            error=error[:end, i],
            heading_error=heading[:end, i],
            command=command[:end, i],
            lost=bool(lost[i]),
        )
        for i, (scenario, end) in enumerate(zip(scenarios, ends, strict=True))
    ]


def _require_fit(policy: Any, robot: Robot) -> None:
    """Refuse a model that was trained on another observation, such as the residual task's."""
    space = getattr(policy, "observation_space", None)
    shape = ObservationLayout(robot.links, len(robot.thrusters)).space.shape
    if space is not None:
        require(
            space.shape == shape,
            "the shape of the policy's observation",
            space.shape,
            f"{shape}; a model of the residual task goes in as "
            "usm_agents.ResidualPolicy(env, model)",
        )


def _at_rest(scenario: Scenario, robot: Robot) -> Trajectory:
    samples = scenario.steps
    return Trajectory(
        scenario=scenario,
        time=np.arange(1, samples + 1, dtype=np.float64) * scenario.conditions.control_period,
        error=np.zeros((samples, 2)),
        heading_error=np.zeros(samples),
        command=np.zeros((samples, len(robot.thrusters))),
        lost=False,
    )


def _score_all(
    policy: Any, scenarios: Sequence[Scenario], robot: Robot
) -> list[dict[str, float | bool]]:
    return [score(each) for each in rollout(policy, scenarios, robot)]
