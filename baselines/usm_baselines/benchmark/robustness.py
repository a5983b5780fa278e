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
from usm_gym.task.modes import AnyScenario, of_head
from usm_gym.task.nominal import shared_nominal
from usm_gym.task.scenario import Scenario
from usm_gym.task.spatial_scenario import SpatialScenario
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
    vary: Callable[[AnyScenario, float], AnyScenario]


def condition(*fields: str, scale: float = 1.0) -> Callable[[AnyScenario, float], AnyScenario]:
    """Sets fields of the conditions, leaving water and gains as they are."""

    def vary(scenario: AnyScenario, value: float) -> AnyScenario:
        changed: dict[str, Any] = dict.fromkeys(fields, scale * value)
        return replace(scenario, conditions=replace(scenario.conditions, **changed))

    return vary


def periods(field: str) -> Callable[[AnyScenario, float], AnyScenario]:
    """Sets a field of the conditions that counts control periods."""

    def vary(scenario: AnyScenario, value: float) -> AnyScenario:
        whole = float(value).is_integer()
        require(whole, field, value, "a whole number of control periods")
        changed: dict[str, Any] = {field: int(value)}
        return replace(scenario, conditions=replace(scenario.conditions, **changed))

    return vary


def drawn(field: str) -> Callable[[AnyScenario, float], AnyScenario]:
    """Stretches what is drawn within a limit: water, or what links differ in."""

    def vary(scenario: AnyScenario, value: float) -> AnyScenario:
        changed: dict[str, Any] = {field: value}
        return scenario.under(replace(scenario.conditions, **changed))

    return vary


def spread(field: str) -> Callable[[AnyScenario, float], AnyScenario]:
    """Stretches about 1 what is drawn from a range."""

    def vary(scenario: AnyScenario, value: float) -> AnyScenario:
        require(0 <= value < 1, f"spread of {field}", value, "0 or more, below 1")
        changed: dict[str, Any] = {field: (1.0 - value, 1.0 + value)}
        return scenario.under(replace(scenario.conditions, **changed))

    return vary


def speed(scenario: AnyScenario, factor: float) -> AnyScenario:
    """Filters the joint references more or less."""
    return _moved_by_task(scenario).bending(faster=factor)


def amplitude(scenario: AnyScenario, factor: float) -> AnyScenario:
    """Bends the head more or less."""
    return _moved_by_task(scenario).bending(further=factor)


def _moved_by_task(scenario: AnyScenario) -> Scenario | SpatialScenario:
    """A scenario in which the task moves the joints; others are refused."""
    allowed = "a quantity other than amplitude and speed: here the policy moves the joints"
    require(not of_head(scenario.mode), "mode", scenario.mode, allowed)
    assert isinstance(scenario, (Scenario, SpatialScenario))
    return scenario


def rate(scenario: AnyScenario, frequency: float) -> AnyScenario:
    """Lets the controller act more or less often; sensors keep their periods in its periods."""
    require(frequency > 0, "control rate", frequency, "more than 0 Hz")
    conditions = scenario.conditions
    substeps = round(1.0 / (frequency * conditions.physics_step))
    period = round(substeps * conditions.physics_step, 12)
    return replace(scenario, conditions=replace(conditions, control_period=period))


QUANTITIES = {
    "noise": Quantity(
        "position noise, standard deviation [mm]",
        (0.0, 0.02, 0.05, 0.1, 0.2, 0.5),
        condition("position_noise", scale=1e-3),
    ),
    "fix-period": Quantity(
        "period of the position fixes [control periods]",
        (1.0, 2.0, 5.0, 10.0, 25.0),
        periods("position_period"),
    ),
    "fix-delay": Quantity(
        "delay of the position fixes [control periods]",
        (0.0, 1.0, 2.0, 3.0, 5.0),
        periods("position_delay"),
    ),
    "fix-missing": Quantity(
        "share of the position fixes that never arrive [1]",
        (0.0, 0.02, 0.1, 0.2, 0.5),
        condition("position_missing"),
    ),
    "angle-noise": Quantity(
        "noise of all angles and rates, standard deviation [mrad, mrad/s]",
        (0.0, 1.0, 2.0, 5.0, 10.0),
        condition("tail_angle_noise", "joint_angle_noise", "rate_noise", scale=1e-3),
    ),
    "lag": Quantity(
        "time constant of the thrusters [s]",
        (0.0, 0.02, 0.05, 0.1, 0.2),
        condition("thruster_time_constant"),
    ),
    "delay": Quantity(
        "delay of the commands [control periods]",
        (0.0, 1.0, 2.0, 3.0, 5.0),
        periods("action_delay"),
    ),
    "limit": Quantity(
        "thruster limit [N]", (2.5, 5.0, 10.0, 20.0, 40.0), condition("thruster_limit")
    ),
    "dead-band": Quantity(
        "dead-band of the thrusters [N]", (0.0, 0.1, 0.2, 0.4, 0.8), condition("thruster_dead_band")
    ),
    "gain": Quantity(
        "error of each thruster's gain, up to [1]",
        (0.0, 0.1, 0.2, 0.3, 0.4),
        spread("thruster_gain_range"),
    ),
    "speed": Quantity("speed of the joints, factor [1]", (0.25, 0.5, 1.0, 2.0, 4.0), speed),
    "amplitude": Quantity("head deflection, factor [1]", (0.0, 0.5, 1.0, 1.5, 2.0), amplitude),
    "current": Quantity(
        "largest current in each axis [m/s]",
        (0.0, 0.05, 0.1, 0.15, 0.2),
        drawn("current_limit"),
    ),
    "waves": Quantity(
        "largest speed of the water in waves [m/s]",
        (0.0, 0.05, 0.1, 0.2, 0.4),
        drawn("wave_limit"),
    ),
    "model": Quantity(
        "error of the hydrodynamic coefficients, up to [1]",
        (0.0, 0.2, 0.4, 0.6),
        spread("coefficient_range"),
    ),
    "links": Quantity(
        "error of each link's coefficients beside the common one, up to [1]",
        (0.0, 0.1, 0.2, 0.3, 0.5),
        drawn("coefficient_spread"),
    ),
    "rate": Quantity("control rate [Hz]", (10.0, 20.0, 25.0, 50.0, 100.0), rate),
    "step": Quantity(
        "physics step [ms]", (0.1, 0.2, 0.5, 1.0, 2.0), condition("physics_step", scale=1e-3)
    ),
}


@validated
class ScoredPoint(Scores):
    """Scores at one value of the quantity.

    Attributes:
        value: The value.
    """

    order: ClassVar[tuple[str, ...]] = (
        "value",
        "metrics",
        "failures",
        "lost_share",
        "per_episode",
    )
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
    def scored(self) -> dict[str, list[ScoredPoint]]:
        """The points with scores by policy."""
        return {
            name: [point for point in points if isinstance(point, ScoredPoint)]
            for name, points in self.results.items()
        }

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
        return [point for points in self.scored.values() for point in points]


def jobs(
    contenders: Sequence[Contender],
    scenarios: Sequence[AnyScenario],
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
