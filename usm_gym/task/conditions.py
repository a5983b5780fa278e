"""Under what an episode takes place: sensors, actuators, timing, ranges of the water; presets."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal

from pydantic import Field, Strict, TypeAdapter

from usm_gym.robot import Drag, Hydrodynamics
from usm_gym.support.validation import Number, Switch, build, require, validated

# No water that a robot swims in moves faster, m/s.
LARGEST_CURRENT = 5.0
# What a control period costs at most, which nothing can interrupt.
MOST_SUBSTEPS = 10_000

# The longest episode: 1000 s at the paper's step of 1e-5 s.
MOST_PHYSICS_STEPS = 100_000_000

# Beyond these nothing is worth simulating: control periods, and s.
LARGEST_DELAY, LARGEST_PERIOD, LARGEST_TIME_CONSTANT = 100, 1000, 100.0

Coefficient = Annotated[Number, Field(ge=0.01, le=100)]
Deflection = Annotated[Number, Field(ge=1e-3, le=20)]
Delay = Annotated[int, Strict(), Field(ge=0, le=LARGEST_DELAY)]
Every = Annotated[int, Strict(), Field(ge=1, le=LARGEST_PERIOD)]
Noise = Annotated[Number, Field(ge=0, le=1)]
# A scan has room for so many shifts up to its end, and metrics leave 3 s after each out.
Gap = Annotated[Number, Field(ge=4, le=30)]
FilterFrequency = Annotated[Number, Field(ge=0.01, le=1000)]


@validated
class Conditions:
    """Sensors, actuators, timing, and the ranges from which water and joint motion are drawn.

    The defaults are the preset "field".

    Attributes:
        control_period: Time between two actions, 1e-6 to 1 s; up to 10000 physics steps.
        physics_step: Step of the integration, 1e-6 to 0.1 s.
        integrator: "midpoint" is of second order and treats drag and joint controllers implicitly;
            "explicit" is Euler's forward method, stable with the default joint gains only below
            about 1e-4 s.
        hydrodynamics: Added mass, "consistent" or "kelasidi2014", see docs/model.md section 3.
        drag: "linear and quadratic", as published, or "quadratic" alone, ibidem. No control law is
            told.
        thruster_time_constant: First-order lag of the thrusters, 0 (none) to 100 s.
        thruster_limit: Largest command of a thruster, 0.01 to 1000 N.
        thruster_dead_band: Commands below this make no force, 0 to 1000 N.
        thruster_gain_range: Force of a thruster over its command, drawn for each, 0.01 to 100.
        action_delay: After how many control periods a command takes effect, 0 to 100.
        position_noise: Standard deviation of the position measurement, per axis, 0 to 1 m.
        position_period: Control periods between measurements of the position, 1 to 1000.
        position_delay: By how many control periods a measured position is late, 0 to 100.
        position_missing: Share of the positions that never arrive, 0 to 0.99.
        velocity_period: Control periods between measurements of the velocity over ground, 1 to
            1000; None: nothing measures it.
        velocity_delay: By how many control periods a measured velocity is late, 0 to 100.
        velocity_noise: Standard deviation of the velocity measurement, per axis, 0 to 1 m/s.
        tail_angle_noise: Standard deviation of the measured angle of the tail, in space of the
            attitude of the middle link about each axis, 0 to 1 rad.
        joint_angle_noise: The same of the joint angles, 0 to 1 rad.
        rate_noise: The same of the rates of these and of the joints, 0 to 1 rad/s.
        current_limit: Largest constant current per axis, 0 to 5 m/s.
        current_variation: Largest amplitude of a slow sinusoidal current on top of it, 0 to 5 m/s.
        wave_limit: Largest speed of the water in waves, on top of the current, 0 to 5 m/s.
        coefficient_range: True hydrodynamic coefficients over the nominal ones, 0.01 to 100.
        coefficient_spread: Largest deviation of a link's coefficients from those common to all, as
            a share of them, 0 to 0.99.
        deflection_range: Size of the head deflections, 0.001 to 20 rad.
        filter_range: Natural frequency of the joint references' filter, 0.01 to 1000 rad/s.
        shift_gap_range: Time between shifts of a scan, 4 to 30 s; None: three shifts in 40 s. A
            scan lasts 60 s, of which the first 20 do not count, in either mode.
        motion: False keeps the joints still.
    """

    control_period: Annotated[Number, Field(ge=1e-6, le=1)] = 0.02
    physics_step: Annotated[Number, Field(ge=1e-6, le=0.1)] = 1e-3
    integrator: Literal["midpoint", "explicit"] = "midpoint"
    hydrodynamics: Hydrodynamics = "consistent"
    drag: Drag = "linear and quadratic"
    thruster_time_constant: Annotated[Number, Field(ge=0, le=LARGEST_TIME_CONSTANT)] = 0.05
    thruster_limit: Annotated[Number, Field(ge=0.01, le=1000)] = 20.0
    thruster_dead_band: Annotated[Number, Field(ge=0, le=1000)] = 0.0
    thruster_gain_range: tuple[Coefficient, Coefficient] = (1.0, 1.0)
    action_delay: Delay = 0
    position_noise: Noise = 5e-5
    position_period: Every = 1
    position_delay: Delay = 0
    position_missing: Annotated[Number, Field(ge=0, le=0.99)] = 0.0
    velocity_period: Every | None = None
    velocity_delay: Delay = 0
    velocity_noise: Noise = 0.0
    tail_angle_noise: Noise = 0.0
    joint_angle_noise: Noise = 0.0
    rate_noise: Noise = 0.0
    current_limit: Annotated[Number, Field(ge=0, le=LARGEST_CURRENT)] = 0.05
    current_variation: Annotated[Number, Field(ge=0, le=LARGEST_CURRENT)] = 0.0
    wave_limit: Annotated[Number, Field(ge=0, le=LARGEST_CURRENT)] = 0.0
    coefficient_range: tuple[Coefficient, Coefficient] = (0.8, 1.2)
    coefficient_spread: Annotated[Number, Field(ge=0, le=0.99)] = 0.0
    deflection_range: tuple[Deflection, Deflection] = (0.7, 1.75)
    filter_range: tuple[FilterFrequency, FilterFrequency] = (6.0, 12.0)
    shift_gap_range: tuple[Gap, Gap] | None = None
    motion: Switch = True

    def __post_init__(self) -> None:
        """Refuse a control period that is not a multiple of the step, and reversed ranges."""
        multiple = self.control_period / self.physics_step
        require(
            1 <= round(multiple) <= MOST_SUBSTEPS
            and math.isclose(multiple, round(multiple), rel_tol=1e-9),
            "control_period",
            self.control_period,
            f"1 to {MOST_SUBSTEPS} times physics_step = {self.physics_step}",
        )
        for name in RANGES:
            low, high = getattr(self, name) or (0.0, 0.0)
            require(low <= high, name, (low, high), "low <= high")
        allowed = f"up to thruster_limit = {self.thruster_limit}"
        reachable = self.thruster_dead_band <= self.thruster_limit
        require(reachable, "thruster_dead_band", self.thruster_dead_band, allowed)

    @property
    def timing(self) -> tuple[float, float, str, str, str]:
        """What robots that are simulated side by side have to agree in."""
        step = self.control_period, self.physics_step
        return *step, self.integrator, self.hydrodynamics, self.drag

    @property
    def substeps(self) -> int:
        """Physics steps in a control period."""
        return round(self.control_period / self.physics_step)


# Fields that are ranges from which something is drawn.
RANGES = (
    "thruster_gain_range",
    "coefficient_range",
    "deflection_range",
    "filter_range",
    "shift_gap_range",
)

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
    "basin": Conditions(
        thruster_time_constant=0.15,
        thruster_limit=8.0,
        thruster_dead_band=0.3,
        thruster_gain_range=(0.85, 1.15),
        position_noise=1e-3,
        position_period=5,
        position_delay=3,
        position_missing=0.02,
        tail_angle_noise=2e-3,
        joint_angle_noise=1e-3,
        rate_noise=2e-3,
        current_limit=0.03,
        current_variation=0.02,
        coefficient_range=(0.7, 1.4),
        coefficient_spread=0.15,
        filter_range=(4.0, 8.0),
        shift_gap_range=(4.0, 6.0),
    ),
    "sea": Conditions(
        thruster_time_constant=0.2,
        thruster_limit=20.0,
        thruster_dead_band=0.3,
        thruster_gain_range=(0.8, 1.2),
        position_noise=0.03,
        position_period=50,
        position_delay=15,
        position_missing=0.05,
        velocity_period=10,
        velocity_delay=5,
        velocity_noise=5e-3,
        tail_angle_noise=2e-3,
        joint_angle_noise=1e-3,
        rate_noise=2e-3,
        current_limit=0.15,
        current_variation=0.05,
        wave_limit=0.1,
        coefficient_range=(0.5, 2.0),
        coefficient_spread=0.25,
        filter_range=(4.0, 8.0),
        shift_gap_range=(4.0, 6.0),
    ),
}


# The same in space, for a robot of 86 kg. Its thrusters are those of a common small vehicle (40 N,
# assumed), its head moves more slowly and not as far; compass, inclinometer and gyro of "field" are
# not exact.
SPATIAL_FIELD = replace(
    PRESETS["field"],
    thruster_time_constant=0.1,
    thruster_limit=40.0,
    tail_angle_noise=2e-4,
    rate_noise=2e-4,
    deflection_range=(0.4, 1.0),
    filter_range=(3.0, 5.0),
)
SPATIAL_PRESETS: dict[str, Conditions] = {
    "ideal": replace(
        PRESETS["ideal"],
        thruster_limit=200.0,
        deflection_range=SPATIAL_FIELD.deflection_range,
        filter_range=SPATIAL_FIELD.filter_range,
    ),
    "field": SPATIAL_FIELD,
    "basin": replace(
        PRESETS["basin"],
        thruster_time_constant=0.2,
        thruster_limit=30.0,
        thruster_dead_band=0.5,
        deflection_range=SPATIAL_FIELD.deflection_range,
        filter_range=(2.5, 4.0),
        shift_gap_range=(5.0, 8.0),
    ),
    "sea": replace(
        PRESETS["sea"],
        thruster_time_constant=0.25,
        thruster_limit=40.0,
        thruster_dead_band=0.5,
        deflection_range=SPATIAL_FIELD.deflection_range,
        filter_range=(2.5, 4.0),
        shift_gap_range=(5.0, 8.0),
    ),
}


# Tells presets, and the suites and modes in space, from those in the plane.
IN_SPACE = "3d"


def conditions_of(
    value: str | Mapping[str, Any] | Conditions, presets: Mapping[str, Conditions] = PRESETS
) -> Conditions:
    """Give the conditions of a preset's name, or of fields that differ from the preset "field".

    Args:
        value: Either, or the conditions themselves.
        presets: The presets that are meant.

    Raises:
        ValueError: If the name or a field is unknown, or a value not allowed.
    """
    if isinstance(value, Conditions):
        return value
    if isinstance(value, str):
        require(value in presets, "conditions", value, ", ".join(presets))
        return presets[value]
    given = build(_ADAPTER, "conditions", value, "a preset's name or a dict of fields")
    return replace(presets["field"], **{name: getattr(given, name) for name in value})


def preset_of(conditions: Conditions | None) -> str:
    """The name of the preset that some conditions are, in space with `IN_SPACE` behind it.

    It is empty if they are none.
    """
    spatial = ((name + IN_SPACE, preset) for name, preset in SPATIAL_PRESETS.items())
    presets = (*PRESETS.items(), *spatial)
    return next((name for name, preset in presets if preset == conditions), "")


def require_whole_steps(duration: float, conditions: Conditions) -> None:
    """Refuse the duration of an episode of no whole number of control periods, or too many steps.

    Raises:
        ValueError: If it is such.
    """
    steps = duration / conditions.control_period
    require(
        round(steps) >= 1 and math.isclose(steps, round(steps), rel_tol=1e-9),
        "duration",
        duration,
        f"a multiple of control_period = {conditions.control_period}",
    )
    longest = MOST_PHYSICS_STEPS * conditions.physics_step
    allowed = f"up to {longest:g} s, {MOST_PHYSICS_STEPS} physics steps"
    require(duration <= longest, "duration", duration, allowed)


_ADAPTER = TypeAdapter(Conditions)
