"""The water of an episode, which no controller is told, and how it is drawn."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import Field

from usm_gym.plant.water import MAX_SINUSOIDS
from usm_gym.support.validation import Number, validated
from usm_gym.task.conditions import LARGEST_CURRENT, Coefficient, Conditions

Velocity = Annotated[Number, Field(ge=-LARGEST_CURRENT, le=LARGEST_CURRENT)]
Phase = Annotated[Number, Field(ge=-100, le=100)]
Period = Annotated[Number, Field(ge=0.1, le=1e6)]

# Spawn key of the stream of the water under a noise seed.
WATER = 1
# Waves that are drawn, and from where to where their periods lie, s.
WAVES = MAX_SINUSOIDS - 1
WAVE_PERIODS = (4.0, 10.0)


class BaseWater(ABC):
    """What the water of plane and space has in common: how it is drawn.

    Attributes:
        axes: Axes of its velocity.
    """

    axes: ClassVar[int]
    amplitude: tuple[float, ...]
    waves: tuple[Any, ...]

    @property
    def sinusoids(self) -> int:
        """How many sinusoids the water's velocity has, waves included."""
        return 1 + len(self.waves) if self.waves or any(self.amplitude) else 0

    @staticmethod
    @abstractmethod
    def wave(amplitude: Any, phase: float, period: float) -> Any:
        """A wave.

        Args:
            amplitude: Amplitude of its velocity, by axis, m/s; the water rises as far as it swings.
            phase: Its phase at the start, rad.
            period: Its period, s.
        """

    @classmethod
    def draw(
        cls, conditions: Conditions, noise_seed: int, links: int, thrusters: int
    ) -> tuple[Self, tuple[float, ...]]:
        """Draw the water of an episode, and what its thrusters make of a command.

        Every number comes from the same place of the same stream whatever the conditions, so that
        a change of conditions stretches an episode's water rather than replace it.

        Args:
            conditions: Conditions, whose ranges are used.
            noise_seed: Seed of the episode.
            links: Links of the robot.
            thrusters: Thrusters of the robot.

        Returns:
            The water, and the gains of the thrusters, none if they are all 1.
        """
        stream = np.random.default_rng(np.random.SeedSequence(noise_seed, spawn_key=(WATER,)))
        current, amplitude = stream.uniform(-1.0, 1.0, (2, cls.axes))
        phase = stream.uniform(0.0, 2 * math.pi, cls.axes)
        period = stream.uniform(10.0, 40.0)
        low, high = conditions.coefficient_range
        coefficients = low + (high - low) * stream.random(6)
        waves = cls._draw_waves(conditions.wave_limit, stream)
        low, high = conditions.thruster_gain_range
        gains = low + (high - low) * stream.random(thrusters)
        factors = 1.0 + conditions.coefficient_spread * stream.uniform(-1.0, 1.0, links)
        fields = {
            "current": tuple((conditions.current_limit * current).tolist()),
            "amplitude": tuple((conditions.current_variation * amplitude).tolist()),
            "phase": tuple(phase.tolist()),
            "period": period,
            "waves": waves,
            "coefficients": tuple(coefficients.tolist()),
            "link_factors": tuple(factors.tolist()) if conditions.coefficient_spread > 0.0 else (),
        }
        return cls(**fields), tuple(gains.tolist()) if (low, high) != (1.0, 1.0) else ()

    @classmethod
    def _draw_waves(cls, limit: float, stream: np.random.Generator) -> tuple[Any, ...]:
        """Draw waves on any course whose amplitudes add up to `limit` at most, m/s."""
        share, course, phase, period = stream.random((4, WAVES))
        speed, course, phase = limit * share / WAVES, 2 * math.pi * course, 2 * math.pi * phase
        period = WAVE_PERIODS[0] + (WAVE_PERIODS[1] - WAVE_PERIODS[0]) * period
        if limit == 0.0:
            return ()
        along = np.stack([np.cos(course), np.sin(course), np.ones(WAVES)], axis=1)[:, : cls.axes]
        amplitude = map(tuple, (speed[:, np.newaxis] * along).tolist())
        waves = zip(amplitude, phase.tolist(), period.tolist(), strict=True)
        return tuple(cls.wave(*wave) for wave in waves)


@validated
class Wave:
    """One sinusoid of the waves; the water moves along its direction.

    Attributes:
        amplitude: Amplitude of the velocity, global frame, -5 to 5 m/s.
        phase: Phase at the start, -100 to 100 rad.
        period: Its period, 0.1 to 1e6 s.
    """

    amplitude: tuple[Velocity, Velocity]
    phase: Phase
    period: Period


@validated
class Water(BaseWater):
    """The water of one episode, which no controller is told.

    Attributes:
        current: Constant part of the water's velocity, global frame, -5 to 5 m/s.
        amplitude: Amplitude of its slow sinusoidal part, by axis, -5 to 5 m/s.
        phase: Phase of that part at the start, -100 to 100 rad.
        period: Period of that part, 0.1 to 1e6 s.
        waves: What waves add, up to 4 of them.
        coefficients: True over nominal value of (c_t, c_n, mu_n, lambda_1, lambda_2, lambda_3), the
            same for all links, 0.01 to 100.
        link_factors: All coefficients of each link over those common to all, from the tail, 0.01 to
            100; none: 1.
    """

    axes: ClassVar[int] = 2
    current: tuple[Velocity, Velocity] = (0.0, 0.0)
    amplitude: tuple[Velocity, Velocity] = (0.0, 0.0)
    phase: tuple[Phase, Phase] = (0.0, 0.0)
    period: Period = 20.0
    waves: Annotated[tuple[Wave, ...], Field(max_length=WAVES)] = ()
    coefficients: tuple[
        Coefficient, Coefficient, Coefficient, Coefficient, Coefficient, Coefficient
    ] = (1.0,) * 6
    link_factors: tuple[Coefficient, ...] = ()

    @staticmethod
    def wave(amplitude: Any, phase: float, period: float) -> Wave:
        """A wave, whose water moves along its course; see `BaseWater.wave`."""
        return Wave(amplitude, phase, period)
