"""The water of an episode in space, which no controller is told, and how it is drawn."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from usm_gym.support.validation import validated
from usm_gym.task.conditions import Coefficient, Conditions
from usm_gym.task.water import WATER, WAVE_PERIODS, WAVES, Period, Phase, Velocity

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
class SpatialWater:
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

    current: Velocities = (0.0, 0.0, 0.0)
    amplitude: Velocities = (0.0, 0.0, 0.0)
    phase: Phases = (0.0, 0.0, 0.0)
    period: Period = 20.0
    waves: Annotated[tuple[SpatialWave, ...], Field(max_length=WAVES)] = ()
    coefficients: tuple[
        Coefficient, Coefficient, Coefficient, Coefficient, Coefficient, Coefficient
    ] = (1.0,) * 6
    link_factors: tuple[Coefficient, ...] = ()

    @property
    def sinusoids(self) -> int:
        """How many sinusoids the water's velocity has, waves included."""
        return 1 + len(self.waves) if self.waves or any(self.amplitude) else 0


def draw_spatial_water(
    conditions: Conditions, noise_seed: int, links: int, thrusters: int
) -> tuple[SpatialWater, tuple[float, ...]]:
    """Draw the water of an episode in space, and what its thrusters make of a command.

    As in the plane, every number comes from the same place of the same stream whatever the
    conditions.

    Args:
        conditions: Conditions, whose ranges are used.
        noise_seed: Seed of the episode.
        links: Links of the robot.
        thrusters: Thrusters of the robot.

    Returns:
        The water, and the gains of the thrusters, none if they are all 1.
    """
    stream = np.random.default_rng(np.random.SeedSequence(noise_seed, spawn_key=(WATER,)))
    unit = stream.uniform(-1.0, 1.0, 6)
    phase = stream.uniform(0.0, 2 * math.pi, 3)
    period = stream.uniform(10.0, 40.0)
    low, high = conditions.coefficient_range
    coefficients = low + (high - low) * stream.random(6)
    waves = _draw_waves(conditions.wave_limit, stream)
    low, high = conditions.thruster_gain_range
    gains = low + (high - low) * stream.random(thrusters)
    factors = 1.0 + conditions.coefficient_spread * stream.uniform(-1.0, 1.0, links)
    water = SpatialWater(
        current=tuple((conditions.current_limit * unit[:3]).tolist()),
        amplitude=tuple((conditions.current_variation * unit[3:]).tolist()),
        phase=tuple(phase.tolist()),
        period=period,
        waves=waves,
        coefficients=tuple(coefficients.tolist()),
        link_factors=tuple(factors.tolist()) if conditions.coefficient_spread > 0.0 else (),
    )
    return water, tuple(gains.tolist()) if (low, high) != (1.0, 1.0) else ()


def _draw_waves(limit: float, stream: np.random.Generator) -> tuple[SpatialWave, ...]:
    """Draw sinusoids whose amplitudes add up to `limit` at most, m/s.

    The water goes round in the vertical plane of the wave's course, as in deep water.
    """
    share, course, phase, period = stream.random((4, WAVES))
    amplitude, course, phase = limit * share / WAVES, 2 * math.pi * course, 2 * math.pi * phase
    period = WAVE_PERIODS[0] + (WAVE_PERIODS[1] - WAVE_PERIODS[0]) * period
    if limit == 0.0:
        return ()
    along = np.stack([amplitude * np.cos(course), amplitude * np.sin(course), amplitude], axis=1)
    return tuple(
        SpatialWave(
            amplitude=tuple(velocity.tolist()),
            phase=(float(at), float(at), float(at) + math.pi / 2),
            period=float(length),
        )
        for velocity, at, length in zip(along, phase, period, strict=True)
    )
