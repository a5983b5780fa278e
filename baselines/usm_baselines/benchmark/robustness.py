"""Robustness curves: how errors grow with one quantity, all else being equal.

Policies keep the nominal knowledge of the scenarios as they were before the quantity was varied;
only the control period is known to them whatever it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

from pydantic import Discriminator, Field, Tag

from usm_baselines.benchmark.results import Scores, axes_in, require_alike
from usm_baselines.benchmark.scoring import TIME_LIMIT, Job, Refusal
from usm_baselines.contender import Contender
from usm_gym.evaluation import Evaluation
from usm_gym.support.results import Provenance, Result
from usm_gym.support.validation import Number, require, validated
from usm_gym.task.nominal import shared_nominal
from usm_gym.task.scenario import Scenario
from usm_gym.task.stored_scenario import StoredScenarios


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
    require(frequency is not None, "filter_frequency", frequency, "a number that can be varied")
    motion = replace(scenario.inspection, filter_frequency=factor * (frequency or 0.0))
    return replace(scenario, inspection=motion)


def amplitude(scenario: Scenario, factor: float) -> Scenario:
    """Bends the head more or less."""
    deflections = tuple(factor * angle for angle in scenario.inspection.deflections)
    return replace(scenario, inspection=replace(scenario.inspection, deflections=deflections))


def current(scenario: Scenario, limit: float) -> Scenario:
    """Stretches the current."""
    return scenario.under(replace(scenario.conditions, current_limit=limit))


def model(scenario: Scenario, spread: float) -> Scenario:
    """Stretches the true coefficients about the nominal ones."""
    require(0 <= spread < 1, "model", spread, "0 or more, below 1")
    limits = (1.0 - spread, 1.0 + spread)
    return scenario.under(replace(scenario.conditions, coefficient_range=limits))


def delay(scenario: Scenario, periods: float) -> Scenario:
    """Lets commands take effect later."""
    require(periods == int(periods), "delay", periods, "a whole number of control periods")
    return replace(scenario, conditions=replace(scenario.conditions, action_delay=int(periods)))


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
    "delay": Quantity("delay of the commands [control periods]", (0.0, 1.0, 2.0, 3.0, 5.0), delay),
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
    "step": Quantity(
        "physics step [ms]", (0.1, 0.2, 0.5, 1.0, 2.0), condition("physics_step", 1e-3)
    ),
}


@validated
class ScoredPoint(Scores):
    """Scores at one value of the quantity.

    Attributes:
        value: The value.
    """

    order: ClassVar[tuple[str, ...]] = ("value", "metrics", "failures", "per_episode")
    value: Number


@validated
class RefusedPoint:
    """A value of the quantity at which a policy has no scores.

    Attributes:
        value: The value.
        refused: Why.
    """

    value: Number
    refused: str


def _kind_of_point(point: Any) -> str:
    refused = "refused" in point if isinstance(point, Mapping) else isinstance(point, RefusedPoint)
    return "refused" if refused else "scored"


Point = Annotated[
    Annotated[ScoredPoint, Tag("scored")] | Annotated[RefusedPoint, Tag("refused")],
    Discriminator(_kind_of_point),
]


@validated
class RobustnessResult(Result):
    """Errors against one quantity, as `usm robustness` writes them.

    Attributes:
        quantity: Name of the quantity.
        label: What it is, with its unit.
        values: Its values.
        scenarios: The scenarios before anything is varied.
        results: Curves by policy: a point at every value.
        provenance: Where all this comes from.
    """

    kind: ClassVar[str] = "robustness"
    quantity: str
    label: str
    values: Annotated[tuple[Number, ...], Field(min_length=1)]
    scenarios: StoredScenarios
    results: Mapping[str, tuple[Point, ...]]
    provenance: Provenance

    def __post_init__(self) -> None:
        """Refuse curves at other values, and points that cannot be compared."""
        for name, points in self.results.items():
            values = tuple(point.value for point in points)
            require(values == self.values, f"values of {name}", values, f"{self.values}")
        require_alike(self._scored)

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes of the task; none if no policy has scores."""
        return axes_in(self._scored)

    @property
    def refused(self) -> dict[str, str]:
        """Why there are no scores, by policy and value."""
        return {
            f"{name} at {point.value:g}": point.refused
            for name, points in self.results.items()
            for point in points
            if isinstance(point, RefusedPoint)
        }

    @property
    def _scored(self) -> list[ScoredPoint]:
        points = [point for row in self.results.values() for point in row]
        return [point for point in points if isinstance(point, ScoredPoint)]


def jobs(
    contenders: Sequence[Contender],
    scenarios: Sequence[Scenario],
    quantity: Quantity,
    values: Sequence[float],
    time_limit: float = TIME_LIMIT,
) -> list[Job]:
    """One job per policy and value, all values of a policy one after the other."""
    nominal = shared_nominal(scenarios)
    varied = [tuple(quantity.vary(scenario, value) for scenario in scenarios) for value in values]
    return [
        Job(
            policy,
            batch,
            replace(nominal, control_period=batch[0].conditions.control_period),
            time_limit,
        )
        for policy in contenders
        for batch in varied
    ]


def curves(
    names: Sequence[str], values: Sequence[float], outcomes: Sequence[Evaluation | Refusal]
) -> dict[str, tuple[ScoredPoint | RefusedPoint, ...]]:
    """By policy, its scores at all values, or why there are none."""
    points = [
        RefusedPoint(value=value, refused=outcome.reason)
        if isinstance(outcome, Refusal)
        else ScoredPoint.of(outcome.summary(), value=value)
        for value, outcome in zip([*values] * len(names), outcomes, strict=True)
    ]
    size = len(values)
    return {name: tuple(points[size * k : size * (k + 1)]) for k, name in enumerate(names)}


def draw(result: RobustnessResult) -> Any:
    """Draw the errors axis by axis against the quantity, with their intervals, by matplotlib."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    columns = max(len(result.axes), 1)
    figure, (panels,) = plt.subplots(
        1, columns, figsize=(5 * columns, 4.5), squeeze=False, layout="constrained"
    )
    for panel, axis in zip(panels, result.axes, strict=False):
        for number, (name, points) in enumerate(result.results.items()):
            scored = [point for point in points if isinstance(point, ScoredPoint)]
            errors = [point.errors[axis] for point in scored]
            places = [point.value for point in scored]
            colour = f"C{number % 10}"
            panel.plot(places, [1e3 * e.mean for e in errors], ".-", color=colour, label=name)
            low, high = ([1e3 * e.ci95[side] for e in errors] for side in (0, 1))
            panel.fill_between(places, low, high, color=colour, alpha=0.2, linewidth=0)
        panel.set(yscale="log", xlabel=result.label, ylabel=f"error in {axis} [mm]")
        panel.grid(alpha=0.3)
    if result.axes:
        panels[0].legend(fontsize=8)
    return figure
