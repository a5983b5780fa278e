"""Under what an episode takes place: sensors, actuators, timing, ranges of the water; presets."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from usm_gym.robot import Hydrodynamics
from usm_gym.validation import CONFIG, NonNegative, Number, Positive, Switch, require

Range = tuple[Number, Number]


@dataclass(frozen=True, config=CONFIG)
class Conditions:
    """Sensors, actuators, timing, and the ranges from which water and joint motion are drawn.

    The defaults are the preset "field".

    Attributes:
        control_period: Time between two actions, s; a multiple of the physics step.
        physics_step: Step of the integration, s.
        integrator: "symplectic" treats drag and joint controllers implicitly; "explicit" is Euler's
            forward method, stable with the default joint gains only below about 1e-4 s.
        hydrodynamics: "consistent" or "kelasidi2014", see docs/model.md section 3.
        thruster_time_constant: First-order lag of the thrusters, s; 0 for none.
        thruster_limit: Largest force of a thruster, N, up to 1000.
        position_noise: Standard deviation of the position measurement in each axis, m.
        current_limit: Largest constant current in each axis, m/s.
        current_variation: Largest amplitude of a sinusoidal current on top of it, m/s.
        coefficient_range: True hydrodynamic coefficients over the nominal ones.
        deflection_range: Size of the head deflections, rad.
        filter_range: Natural frequency of the joint references' filter, rad/s.
        motion: False keeps the joints still.
    """

    control_period: Positive = 0.02
    physics_step: Positive = 1e-3
    integrator: Literal["symplectic", "explicit"] = "symplectic"
    hydrodynamics: Hydrodynamics = "consistent"
    thruster_time_constant: NonNegative = 0.05
    thruster_limit: Annotated[Positive, Field(le=1000)] = 20.0
    position_noise: NonNegative = 5e-5
    current_limit: NonNegative = 0.05
    current_variation: NonNegative = 0.0
    coefficient_range: Range = (0.8, 1.2)
    deflection_range: Range = (0.7, 1.75)
    filter_range: Range = (6.0, 12.0)
    motion: Switch = True

    def __post_init__(self) -> None:
        """Refuse a control period that is no multiple of the step, and ranges that are none."""
        multiple = self.control_period / self.physics_step
        require(
            round(multiple) >= 1 and math.isclose(multiple, round(multiple), rel_tol=1e-9),
            "control_period",
            self.control_period,
            f"a multiple of physics_step = {self.physics_step}",
        )
        for name in ("coefficient_range", "deflection_range", "filter_range"):
            low, high = getattr(self, name)
            require(0 < low <= high, name, (low, high), "0 < low <= high")

    @property
    def timing(self) -> tuple[float, float, str, str]:
        """What robots that are simulated side by side have to agree in."""
        return self.control_period, self.physics_step, self.integrator, self.hydrodynamics

    @property
    def substeps(self) -> int:
        """Physics steps in a control period."""
        return round(self.control_period / self.physics_step)


FIELD = Conditions()
PRESETS: dict[str, Conditions] = {
    "ideal": Conditions(
        thruster_time_constant=0.0,
        thruster_limit=100.0,
        position_noise=0.0,
        current_limit=0.0,
        coefficient_range=(1.0, 1.0),
    ),
    "field": FIELD,
    "rough": Conditions(
        thruster_time_constant=0.1,
        thruster_limit=15.0,
        position_noise=2e-4,
        current_limit=0.1,
        current_variation=0.05,
        coefficient_range=(0.6, 1.5),
        deflection_range=(0.9, 2.1),
        filter_range=(8.0, 14.0),
    ),
}


def conditions_of(value: str | Mapping[str, Any] | Conditions) -> Conditions:
    """Conditions from a preset's name, or from fields that differ from the preset "field".

    Raises:
        ValueError: If the name or a field is unknown, or a value not allowed.
    """
    if isinstance(value, Conditions):
        return value
    if isinstance(value, str):
        require(value in PRESETS, "conditions", value, ", ".join(PRESETS))
        return PRESETS[value]
    require(isinstance(value, Mapping), "conditions", value, "a preset's name or a dict of fields")
    return Conditions(**value)
