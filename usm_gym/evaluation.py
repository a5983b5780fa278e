"""The one rollout loop that scores every policy, scripted or learned."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usm_gym.policy import as_action, is_privileged, nominal_of
from usm_gym.recording import Recording, Trajectory, at_rest
from usm_gym.robot import Robot
from usm_gym.simulation import Simulation
from usm_gym.statistics import mean_interval
from usm_gym.support import parallel
from usm_gym.support.validation import is_whole, require
from usm_gym.task import metrics
from usm_gym.world import World, world_of

# Episodes that a policy meets side by side; a multiple of the plant's lanes.
BATCH = 64
# Per axis.
POSITION_METRICS = ("max_error", "settled_error", "rms_error")
THRUST_METRICS = ("thrust_effort", "thrust_variation", "saturation_share")
# Mean absolute commanded rate of the joints, rad/s, where a policy moves them.
JOINT_EFFORT = "joint_effort"
# Shifts of a scan after which the largest errors are kept, per axis: they show what is learned.
SHIFT_METRICS = {
    "first_shift_error": 0,
    "third_shift_error": 2,
    "fifth_shift_error": 4,
    "last_shift_error": -1,
}
# The row of an episode that is no metric.
FAILED = "failed"


@dataclass(frozen=True)
class Evaluation:
    """Scores of a policy, per episode in the order of the scenarios.

    Attributes:
        per_episode: Values by metric, (episodes,): what `metric_names` lists for all of them.
        failed: Which episodes lost the robot, (episodes,).
    """

    per_episode: dict[str, NDArray[np.float64]]
    failed: NDArray[np.bool_]

    def objective(self, variation_weight: float = metrics.VARIATION_WEIGHT) -> NDArray[np.float64]:
        """What policies are ranked by, mm, (episodes,): see `metrics.objective`."""
        return np.asarray(metrics.objective(self.per_episode, variation_weight))

    def summary(self) -> dict[str, Any]:
        """Mean with interval, worst and median episode by metric, losses, and all episodes."""
        row: dict[str, Any] = {}
        for name, values in self.per_episode.items():
            mean, interval = mean_interval(values)
            row[name] = {"mean": mean, "ci95": list(interval), "worst": float(values.max())}
            row[name]["median"] = float(np.median(values))
        row["failures"] = int(self.failed.sum())
        row["lost_share"] = float(self.failed.mean())
        row["per_episode"] = {name: values.tolist() for name, values in self.per_episode.items()}
        row["per_episode"]["failed"] = self.failed.tolist()
        return row


def joined(parts: Sequence[Evaluation]) -> Evaluation:
    """Scores of one policy on one list of scenarios after the other."""
    return Evaluation(
        per_episode={
            name: np.concatenate([part.per_episode[name] for part in parts])
            for name in _common([part.per_episode for part in parts])
        },
        failed=np.concatenate([part.failed for part in parts]),
    )


def evaluate(
    policy: Any,
    scenarios: Sequence[Any],
    *,
    robot: Robot | None = None,
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Evaluation:
    """Score a policy on scenarios, each with its own noise.

    Args:
        policy: Anything with `predict` (`usm_gym.policy`); it is called with a batch axis.
            To be pickled for more than one worker. One with `privileged = True` is also given
            `snapshot=`, the true state. What was trained on the residual task goes in as
            `usm_agents.ResidualPolicy(env, model)`.
        scenarios: The episodes.
        robot: The robot that carries them out; without one, the one that the scenario names.
        workers: Number of processes; without effect on the result, unless the policy's answer to
            a row depends on the other rows, as torch's does in its last bits.
        progress: Called now and then with the number of episodes done since the last call; with
            one worker, fractions of them.

    Returns:
        The scores.

    Raises:
        ValueError: If there is no scenario, or the policy is a class or has no `predict`, wants
            another observation, or returns what is no action.
    """
    listed = isinstance(scenarios, Sequence) and len(scenarios) > 0
    valid = listed and all(hasattr(scenario, "body") for scenario in scenarios)
    require(valid, "scenarios", scenarios, "a list of one Scenario or more")
    require(is_whole(workers, 1), "workers", workers, "1 or more")
    report = progress or (lambda episodes: None)
    if robot is not None:
        scenarios = [dataclasses.replace(scenario, robot=robot) for scenario in scenarios]
    for scenario in scenarios:
        _require_fit(policy, scenario)
        score(at_rest(scenario))  # refuses an episode that leaves nothing to score
    chunks = [scenarios[part] for part in batches(len(scenarios), workers)]
    if workers == 1:
        rows = [row for chunk in chunks for row in _scores(policy, chunk, report)]
    else:
        done = {}
        tasks = [(policy, chunk) for chunk in chunks]
        for index, part in parallel.results(_scores, tasks, workers):
            done[index] = part
            report(len(part))
        rows = [row for index in sorted(done) for row in done[index]]
    return Evaluation(
        per_episode={
            name: np.array([row[name] for row in rows]) for name in _common(rows) if name != FAILED
        },
        failed=np.array([bool(row[FAILED]) for row in rows]),
    )


def batches(episodes: int, workers: int = 1, batch: int = BATCH) -> list[slice]:
    """Which episodes a policy meets side by side: a batch, or a worker's share if that is less."""
    size = min(batch, -(-episodes // workers))
    return [slice(first, min(first + size, episodes)) for first in range(0, episodes, size)]


def rollout(
    policy: Any,
    scenarios: Sequence[Any],
    progress: Callable[[float], None] = lambda episodes: None,
    watch: Callable[[Simulation], None] = lambda simulation: None,
) -> list[Trajectory]:
    """Run a policy through scenarios, side by side as far as robot and timing agree.

    `watch` is called with every simulation at its start and after every step.
    """
    trajectories: dict[int, Trajectory] = {}

    def kind(index: int) -> tuple[str, Any]:
        return repr(scenarios[index].body), scenarios[index].conditions.timing

    order = sorted(range(len(scenarios)), key=lambda index: (kind(index), index))
    for _, group in groupby(order, key=kind):
        indices = list(group)
        batch = [scenarios[index] for index in indices]
        trajectories.update(zip(indices, _run(policy, batch, progress, watch), strict=True))
    return [trajectories[index] for index in range(len(scenarios))]


def metric_names(world: World, by_shift: bool = False) -> list[str]:
    """Names of the metrics of an episode in a world, in the order of results.

    Args:
        world: The world.
        by_shift: Whether errors by shift are among them: see `scored_by_shift`.
    """
    position = [f"{name}_{axis}" for name in POSITION_METRICS for axis in world.axes]
    shifts = [f"{name}_{axis}" for name in SHIFT_METRICS for axis in world.axes]
    efforts = [*THRUST_METRICS, *([JOINT_EFFORT] if world.actions > world.thrusters else ())]
    return [*position, *_angle_metrics(world), *efforts, *(shifts if by_shift else ())]


def _angle_metrics(world: World) -> list[str]:
    """Names of the metrics of angles; those that are only watched do not enter the objective."""
    return [*(f"{angle}_error" for angle in world.attitude), *world.watched]


def scored_by_shift(scenario: Any) -> bool:
    """Whether an episode has scores by shift, as a scan has: five shifts or more, none too late."""
    shifts = scenario.shifts
    return len(shifts) > max(SHIFT_METRICS.values()) and bool(shifts[-1] <= scenario.duration)


def score(trajectory: Trajectory) -> dict[str, float | bool]:
    """The metrics of an episode; a lost one counts as at least 0.5 m in all axes."""
    scenario, lost = trajectory.scenario, trajectory.lost
    world, conditions = world_of(scenario.body), scenario.conditions
    found = {
        f"{name}_{axis}": float(error)
        for name, errors in _position_errors(trajectory).items()
        for axis, error in zip(world.axes, errors, strict=True)
    }
    counted = (trajectory.time >= scenario.settle_time) | lost
    largest = np.abs(trajectory.attitude_error[counted]).max(axis=0, initial=0.0).tolist()
    found |= dict(zip(_angle_metrics(world), largest, strict=True))
    values = (
        metrics.thrust_effort(trajectory.command),
        metrics.thrust_variation(trajectory.command, conditions.control_period),
        metrics.saturation_share(trajectory.command, conditions.thruster_limit),
    )
    found |= dict(zip(THRUST_METRICS, values, strict=True))
    if trajectory.joint_rates.size > 0:
        found[JOINT_EFFORT] = float(np.abs(trajectory.joint_rates).mean())
    names = metric_names(world, scored_by_shift(scenario))
    return {**{name: found[name] for name in names}, FAILED: lost}


def _position_errors(trajectory: Trajectory) -> dict[str, NDArray[np.float64]]:
    """Position errors of an episode by metric, m, (axes,)."""
    scenario, time, error = trajectory.scenario, trajectory.time, trajectory.error
    settle, shifts, by_shift = scenario.settle_time, scenario.shifts, scored_by_shift(scenario)
    names = [*POSITION_METRICS, *(SHIFT_METRICS if by_shift else ())]
    if trajectory.lost:
        world = world_of(scenario.body)
        worst = max(world.lost_error, float(np.abs(error).max()))
        return {name: np.full(len(world.axes), worst) for name in names}
    values = [
        metrics.max_error(time, error, settle),
        metrics.settled_error(time, error, shifts, settle, metrics.recovery_from(shifts)),
        metrics.rms_error(time, error, settle),
    ]
    if by_shift:
        after = metrics.shift_errors(time, error, shifts)
        values += [after[shift] for shift in SHIFT_METRICS.values()]
    return dict(zip(names, values, strict=True))


def _run(
    policy: Any,
    scenarios: Sequence[Any],
    progress: Callable[[float], None],
    watch: Callable[[Simulation], None],
) -> list[Trajectory]:
    """Run a policy through scenarios side by side."""
    _require_period(policy, scenarios[0].conditions.control_period)
    simulation = Simulation(scenarios)
    watch(simulation)
    recording, size = Recording(simulation), simulation.size
    state: Any = None
    for k in range(recording.length):
        truth = {"snapshot": simulation.snapshot()} if is_privileged(policy) else {}
        start, seen = np.full(size, k == 0), simulation.observation.copy()
        answer = policy.predict(seen, state, start, deterministic=True, **truth)
        require(
            isinstance(answer, tuple) and len(answer) == 2,
            "what predict returns",
            type(answer).__name__,
            "a pair (action, state)",
        )
        state = answer[1]
        action = as_action(answer[0], (size, simulation.world.actions))
        missing = np.isnan(action)
        require(not missing[recording.alive(k)].any(), "the policy's action", "NaN", "numbers")
        simulation.step(np.where(missing, np.float32(0.0), action))
        watch(simulation)
        recording.note(k)
        if k % 100 == 99 or k == recording.length - 1:
            progress(size * (k % 100 + 1) / recording.length)
            if recording.lost.all():
                progress(size * (recording.length - 1 - k) / recording.length)
                break
    return recording.trajectories()


def _require_period(policy: Any, period: float) -> None:
    """Refuse a policy that was made for another control period."""
    known = nominal_of(policy)
    if known is not None:
        own = known.control_period
        allowed = f"that for which the policy was made, {own}"
        require(own == period, "control_period", period, allowed)


def _require_fit(policy: Any, scenario: Any) -> None:
    """Refuse what does not act, and a model of another observation, such as the residual task's."""
    acts = callable(getattr(policy, "predict", None)) and not isinstance(policy, type)
    require(acts, "policy", policy, "an object with `predict`, and not its class")
    space = getattr(policy, "observation_space", None)
    if space is not None:
        shape = world_of(scenario.body).layout.space.shape
        require(
            space.shape == shape,
            "the shape of the policy's observation",
            space.shape,
            f"{shape}; a model of the residual task goes in as "
            "usm_agents.ResidualPolicy(env, model)",
        )


def _common(tables: Sequence[Mapping[str, Any]]) -> list[str]:
    """The names that all tables have, in the order of the first."""
    return [name for name in tables[0] if all(name in table for table in tables)]


def _scores(
    policy: Any,
    scenarios: Sequence[Any],
    progress: Callable[[float], None] = lambda episodes: None,
) -> list[dict[str, float | bool]]:
    return [score(trajectory) for trajectory in rollout(policy, scenarios, progress)]
