"""Robustness curves: how errors grow with one quantity, all else being equal.

Policies keep the nominal knowledge of the scenarios as they were before the quantity was varied;
only the control period is known to them whatever it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from usm_baselines.benchmark.scoring import TIME_LIMIT, Refusal, Task, shared_nominal
from usm_baselines.contender import Contender
from usm_gym.evaluation import Evaluation
from usm_gym.robot import Robot
from usm_gym.support.validation import require
from usm_gym.task.scenario import Scenario


@dataclass(frozen=True)
class Quantity:
    """What is varied.

    Attributes:
        label: What it is, with its unit.
        values: The values by default.
        vary: Gives a scenario a value of it.
    """

    label: str
    values: tuple[float, ...]
    vary: Callable[[Scenario, float], Scenario]


def condition(field: str, scale: float = 1.0) -> Callable[[Scenario, float], Scenario]:
    """Sets a field of the conditions, leaving the water as it is."""

    def vary(scenario: Scenario, value: float) -> Scenario:
        changed: dict[str, Any] = {field: scale * value}
        return replace(scenario, conditions=replace(scenario.conditions, **changed))

    return vary


def speed(scenario: Scenario, factor: float) -> Scenario:
    """Filters the joint references more or less."""
    frequency = scenario.inspection.filter_frequency
    require(frequency is not None, "filter_frequency", frequency, "a number, for it to be varied")
    motion = replace(scenario.inspection, filter_frequency=factor * (frequency or 0.0))
    return replace(scenario, inspection=motion)


def amplitude(scenario: Scenario, factor: float) -> Scenario:
    """Bends the head more or less."""
    deflections = tuple(factor * each for each in scenario.inspection.deflections)
    return replace(scenario, inspection=replace(scenario.inspection, deflections=deflections))


def current(scenario: Scenario, limit: float) -> Scenario:
    """Stretches the current."""
    return scenario.under(replace(scenario.conditions, current_limit=limit))


def model(scenario: Scenario, spread: float) -> Scenario:
    """Stretches the true coefficients about the nominal ones."""
    require(0 <= spread < 1, "model", spread, "0 or more, below 1")
    limits = (1.0 - spread, 1.0 + spread)
    return scenario.under(replace(scenario.conditions, coefficient_range=limits))


def rate(scenario: Scenario, frequency: float) -> Scenario:
    """Lets the controller act more or less often."""
    conditions = scenario.conditions
    substeps = round(1.0 / (frequency * conditions.physics_step))
    period = round(substeps * conditions.physics_step, 12)
    return replace(scenario, conditions=replace(conditions, control_period=period))


QUANTITIES = {
    "noise": Quantity(
        "position noise, standard deviation [mm]",
        (0.0, 0.02, 0.05, 0.1, 0.2, 0.5),
        condition("position_noise", 1e-3),
    ),
    "lag": Quantity(
        "time constant of the thrusters [s]",
        (0.0, 0.02, 0.05, 0.1, 0.2),
        condition("thruster_time_constant"),
    ),
    "limit": Quantity(
        "thruster limit [N]", (2.5, 5.0, 10.0, 20.0, 40.0), condition("thruster_limit")
    ),
    "speed": Quantity("speed of the joints, factor [1]", (0.25, 0.5, 1.0, 2.0, 4.0), speed),
    "amplitude": Quantity("head deflection, factor [1]", (0.0, 0.5, 1.0, 1.5, 2.0), amplitude),
    "current": Quantity("largest current in each axis [m/s]", (0.0, 0.05, 0.1, 0.15, 0.2), current),
    "model": Quantity(
        "error of the hydrodynamic coefficients, up to [1]", (0.0, 0.2, 0.4, 0.6), model
    ),
    "rate": Quantity("control rate [Hz]", (10.0, 20.0, 25.0, 50.0, 100.0), rate),
}


def tasks(
    contenders: Sequence[Contender],
    scenarios: Sequence[Scenario],
    quantity: Quantity,
    values: Sequence[float],
    time_limit: float = TIME_LIMIT,
) -> list[Task]:
    """One task for each policy and value, values of one policy side by side."""
    robot = Robot()
    nominal = shared_nominal(robot, scenarios)
    varied = [tuple(quantity.vary(each, value) for each in scenarios) for value in values]
    return [
        Task(
            each,
            batch,
            replace(nominal, control_period=batch[0].conditions.control_period),
            robot,
            time_limit,
        )
        for each in contenders
        for batch in varied
    ]


def curves(
    names: Sequence[str], values: Sequence[float], outcomes: Sequence[Evaluation | Refusal]
) -> dict[str, list[dict[str, Any]]]:
    """For each policy a list over the values: its summary, or why there is none."""
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in names}
    places = [(name, value) for name in names for value in values]
    for (name, value), outcome in zip(places, outcomes, strict=True):
        if isinstance(outcome, Refusal):
            found[name].append({"value": value, "refused": outcome.reason})
        else:
            found[name].append({"value": value, **outcome.summary()})
    return found


def draw(found: dict[str, list[dict[str, Any]]], label: str) -> Any:
    """Draw errors in x and y against the quantity, with their intervals; a matplotlib figure."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(10, 4.5), layout="constrained")
    for panel, axis in zip(panels, "xy", strict=True):
        for number, (name, points) in enumerate(found.items()):
            known = [each for each in points if "refused" not in each]
            scores = [each[f"max_error_{axis}"] for each in known]
            places = [each["value"] for each in known]
            colour = f"C{number % 10}"
            panel.plot(
                places, [1e3 * each["mean"] for each in scores], ".-", color=colour, label=name
            )
            low, high = ([1e3 * each["ci95"][side] for each in scores] for side in (0, 1))
            panel.fill_between(places, low, high, color=colour, alpha=0.2, linewidth=0)
        panel.set(yscale="log", xlabel=label, ylabel=f"error in {axis} [mm]")
        panel.grid(alpha=0.3)
    panels[0].legend(fontsize=8)
    return figure
