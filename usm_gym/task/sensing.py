"""What the sensors of an episode make of the truth: when they measure, and how wrong they are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_gym.task.conditions import Conditions

# Spawn keys of the streams of the sensors under a noise seed; 1 is that of the water.
POSITION, VELOCITY, ANGLES, MISSING = 0, 2, 3, 4
# Stands for the instant of a measurement where there is none.
NONE = -1


class Sensing(NamedTuple):
    """The measurements of one episode, by control instant.

    A measurement is taken at one instant and arrives at another. Until the first one arrives, what
    the robot starts from is known.

    Attributes:
        taken: When the position and the velocity that are known at an instant were measured,
            int32, (instants, 2); `NONE` for a velocity that nothing measures.
        position: Errors of positions that are measured at an instant, m, (instants, axes).
        others: The same of velocities, m/s, then of angles and of their rates, rad and rad/s,
            float32, (instants, axes + angles); (instants, 0) if they are all measured exactly.
    """

    taken: NDArray[np.int32]
    position: NDArray[np.float64]
    others: NDArray[np.float32]

    @property
    def oldest(self) -> int:
        """The greatest age of a measurement, control periods."""
        age = np.arange(len(self.taken))[:, np.newaxis] - self.taken
        return int(age[self.taken >= 0].max())


def sensing(
    conditions: Conditions, steps: int, axes: int, angle_noise: list[float], noise_seed: int
) -> Sensing:
    """Draw the measurements of an episode.

    Every sensor has a stream of its own, from which every instant takes as many numbers as it would
    under any other conditions.

    Args:
        conditions: Periods, delays, noise.
        steps: Control periods of the episode.
        axes: Axes of the position.
        angle_noise: Standard deviations of the errors of angles and rates, rad and rad/s, one for
            each number that is measured of them.
        noise_seed: Seed of the episode.
    """
    instants = steps + 1
    taken = np.full((instants, 2), NONE, np.int32)
    missing = _stream(noise_seed, MISSING).random(instants) < conditions.position_missing
    taken[:, 0] = known(conditions.position_period, conditions.position_delay, missing)
    if conditions.velocity_period is not None:
        none = np.zeros(instants, bool)
        taken[:, 1] = known(conditions.velocity_period, conditions.velocity_delay, none)
    position = _stream(noise_seed, POSITION).standard_normal((instants, axes))
    measured = conditions.velocity_period is not None or any(angle_noise)
    others = np.zeros((instants, (axes + len(angle_noise)) if measured else 0), np.float32)
    if measured:
        velocity = _stream(noise_seed, VELOCITY).standard_normal((instants, axes), np.float32)
        others[:, :axes] = np.float32(conditions.velocity_noise) * velocity
        sizes = np.array(angle_noise, np.float32)
        angles = _stream(noise_seed, ANGLES).standard_normal((instants, sizes.size), np.float32)
        others[:, axes:] = sizes * angles
    return Sensing(taken, conditions.position_noise * position, others)


def known(period: int, delay: int, missing: NDArray[np.bool_]) -> NDArray[np.int64]:
    """When the measurement that is known at an instant was taken, (instants,).

    Args:
        period: Control periods between measurements.
        delay: Control periods until a measurement arrives.
        missing: Whether a measurement that is taken at an instant never arrives, (instants,).
    """
    instants = np.arange(len(missing))
    arrives = (instants % period == 0) & ~missing
    arrives[0] = True  # where the robot starts is known
    latest = np.maximum.accumulate(np.where(arrives, instants, 0))
    return latest[np.maximum(instants - delay, 0)]


def _stream(noise_seed: int, key: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(noise_seed, spawn_key=(key,)))
