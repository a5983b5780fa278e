"""The water of an episode in space, which no controller is told, and how it is drawn."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar

from pydantic import Field

from usm_gym.support.validation import validated
from usm_gym.task.conditions import Coefficient
from usm_gym.task.water import WAVES, BaseWater, Period, Phase, Velocity

Velocities = tuple[Velocity, Velocity, Velocity]
Phases = tuple[Phase, Phase, Phase]


@validated
class SpatialWave:
    """One sinusoid of the waves.

    Attributes:
        amplitude: Amplitude of the velocity along x, y, z, global frame, -5 to 5 m/s.
        phase: Phase at the start, by axis, -100 to 100 rad.
        period: Its period, 0.1 to 1e6 s.
    """

    amplitude: Velocities
    phase: Phases
    period: Period


@validated
class SpatialWater(BaseWater):
    """The water of one episode in space, which no controller is told.

    Attributes:
        current: Constant part of the water's velocity, global frame, -5 to 5 m/s.
        amplitude: Amplitude of its slow sinusoidal part, by axis, -5 to 5 m/s.
        phase: Phase of that part at the start, by axis, -100 to 100 rad.
        period: Period of that part, 0.1 to 1e6 s.
        waves: What waves add, up to 4 of them.
        coefficients: True over nominal value of each of
            `SpatialRobot.hydrodynamic_coefficients`, the same for all links, 0.01 to 100.
        link_factors: All coefficients of each link over those common to all, from the tail, 0.01 to
            100; none: 1.
    """

    axes: ClassVar[int] = 3
    current: Velocities = (0.0, 0.0, 0.0)
    amplitude: Velocities = (0.0, 0.0, 0.0)
    phase: Phases = (0.0, 0.0, 0.0)
    period: Period = 20.0
    waves: Annotated[tuple[SpatialWave, ...], Field(max_length=WAVES)] = ()
    coefficients: tuple[
        Coefficient, Coefficient, Coefficient, Coefficient, Coefficient, Coefficient
    ] = (1.0,) * 6
    link_factors: tuple[Coefficient, ...] = ()

    @staticmethod
    def wave(amplitude: Any, phase: float, period: float) -> SpatialWave:
        """A wave, whose water goes round in the vertical plane, as in deep water."""
        return SpatialWave(amplitude, (phase, phase, phase + math.pi / 2), period)
