"""Where the robot is, from fixes that come late, rarely, or not at all.

The filter is that of `late_filter`. What predicts is up to the law: the linear model, here, or the
nominal plant (`prediction`, `identification`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from usm_baselines.estimation import kalman
from usm_baselines.estimation.kalman import DISTURBANCE, ERROR, RATE, THRUST
from usm_baselines.estimation.late_filter import (
    COUNT,
    INNOVATION,
    STATES,
    Navigation,
    covariance,
    memory_size,
    navigate,
    slot,
)
from usm_baselines.signals import Signals
from usm_gym.kernels.compile import compiled
from usm_gym.task.nominal import Nominal
from usm_gym.world import world_of

Array = NDArray[np.float64]

# Spectral densities of what drives v (m/s^2 / sqrt(Hz)) and d (m/s^3 / sqrt(Hz)), for laws that do
# not have them among their gains.
ACCELERATION_NOISE, DISTURBANCE_NOISE = 1e-2, 0.02
# For how long the disturbance of the start has had to grow, s.
UNKNOWN_FOR = 10.0


def is_needed(nominal: Nominal) -> bool:
    """Whether positions come late or rarely, or something measures the velocity.

    Where a position comes at once in every period, the stationary filter of `kalman` will do.
    """
    late = nominal.position_delay > 0 or nominal.position_period > 1
    return late or nominal.velocity_period is not None


@compiled
def estimate_all(signals, mass, linear, nav, transition, thrust, memory):
    """One period of the filter on the linear model, for a batch; fills in the signals.

    Args:
        signals: Signals, whose error, rate, disturbance and thrust become the estimates.
        mass: Total mass m_t, kg.
        linear: The linear model.
        nav: The filter.
        transition: As of `navigate`, on the linear model.
        thrust: Thrust over the inertia, m/s^2, (batch, axes), moved on in place.
        memory: What is kept, (batch, numbers).
    """
    estimate, own = np.empty(nav.size), np.empty(kalman.STATES)
    for b in range(signals.y.shape[0]):
        started, now = signals.started[b], slot(nav, int(memory[b, COUNT]))
        for axis in range(nav.axes):
            first = STATES * axis
            last, known = kalman.inputs(signals, mass, linear, b, axis)
            if started == 0.0:
                kalman.start(signals.y[b, axis], signals.velocity[b, axis], own)
            else:
                for i in range(STATES):
                    own[i] = memory[b, now.post + first + i]
                own[THRUST] = thrust[b, axis]
                kalman.predict(linear.transition[axis], last, known, own)
            thrust[b, axis] = own[THRUST]
            for i in range(STATES):
                estimate[first + i] = own[i]
        navigate(signals.observation[b], nav, started, transition, estimate, memory[b])
        for axis in range(nav.axes):
            first = STATES * axis
            signals.y[b, axis] = estimate[first + ERROR]
            signals.rate[b, axis] = estimate[first + RATE]
            signals.disturbance[b, axis] = estimate[first + DISTURBANCE]
            signals.thrust[b, axis] = thrust[b, axis]


class Navigator:
    """Estimates error, rate and disturbance of a batch of robots on the linear model.

    Like a policy it keeps nothing itself: its memory, an array of numbers for each robot, travels
    with the caller.

    Attributes:
        size: How many numbers that is.
        constants: The filter, for kernels.
    """

    def __init__(
        self, nominal: Nominal, acceleration_noise: float, disturbance_noise: float
    ) -> None:
        """Set up the filter.

        Args:
            nominal: Nominal knowledge.
            acceleration_noise: Spectral density of what drives v, m/s^2 / sqrt(Hz).
            disturbance_noise: Spectral density of what drives d, m/s^3 / sqrt(Hz).

        Raises:
            ValueError: If a density is not above 0.
        """
        self._linear = kalman.linear_model(nominal, acceleration_noise, disturbance_noise)
        self.constants = navigation(nominal, acceleration_noise, disturbance_noise)
        self._transition = transition_of(self._linear, self.constants.size)
        self.size = self.constants.axes + memory_size(self.constants)

    def estimate(self, signals: Signals, mass: float, memory: Array) -> None:
        """Predict by the linear model and take in what has arrived, in place.

        Args:
            signals: What was measured and applied; error, rate, disturbance and thrust are filled
                in.
            mass: Total mass, kg.
            memory: Memory of the batch, (batch, size); zero at the start.
        """
        nav, thrust, kept = self.constants, *self._parts(memory)
        estimate_all(signals, mass, self._linear, nav, self._transition, thrust, kept)

    def innovation(self, memory: Array) -> tuple[Array, Array]:
        """Innovation of the fixes that have arrived, m, and its variance, m^2, (batch, axes).

        The variance is 0 where none has.
        """
        axes, (_, kept) = self.constants.axes, self._parts(memory)
        pairs = kept[:, INNOVATION : INNOVATION + 2 * axes].reshape(-1, axes, 2).copy()
        return pairs[:, :, 0], pairs[:, :, 1]

    def covariance(self, memory: Array) -> Array:
        """Covariance of the estimates of (e, v, d), axis by axis, (batch, 3 axes, 3 axes)."""
        return covariance(self.constants, self._parts(memory)[1])

    def _parts(self, memory: Array) -> tuple[Array, Array]:
        """Thrust over the inertia, and the memory of `navigate`."""
        return memory[:, : self.constants.axes], memory[:, self.constants.axes :]


def transition_of(linear: kalman.Linear, size: int) -> Array:
    """(e, v, d) of all axes over a period on the linear model, (3 axes, size)."""
    axes = len(linear.transition)
    transition = np.zeros((STATES * axes, size))
    for axis in range(axes):
        own = slice(STATES * axis, STATES * (axis + 1))
        transition[own, own] = linear.transition[axis, :STATES, :STATES]
    return transition


def navigation(
    nominal: Nominal,
    acceleration_noise: float,
    disturbance_noise: float,
    more: Sequence[tuple[float, float]] = (),
) -> Navigation:
    """The filter for kernels; arguments as of `Navigator`.

    Args:
        nominal: Nominal knowledge.
        acceleration_noise: Spectral density of what drives v, m/s^2 / sqrt(Hz).
        disturbance_noise: Spectral density of what drives d, m/s^3 / sqrt(Hz).
        more: Standard deviation at the start and spectral density, in the unit over sqrt(s), of
            what else is estimated.
    """
    world, h = world_of(nominal.robot), nominal.control_period
    layout = world.layout
    first = {name: place.start for name, place in layout.slices.items()}
    measures = nominal.velocity_period is not None
    velocity_delay = nominal.velocity_delay if measures else -1
    fix = max(nominal.position_noise, kalman.SMALLEST_NOISE) ** 2
    inertia, drag = world.straight_body
    size = STATES * len(inertia) + len(more)
    noise, start = np.zeros((size, size)), np.zeros((size, size))
    for axis, damping in enumerate(drag / inertia):
        own = slice(STATES * axis, STATES * (axis + 1))
        noise[own, own] = kalman.process_noise(damping, h, acceleration_noise, disturbance_noise)
        start[own, own] = np.diag([fix, 0.0, disturbance_noise**2 * UNKNOWN_FOR])
    for k, (deviation, density) in enumerate(more, STATES * len(inertia)):
        start[k, k], noise[k, k] = deviation**2, h * density**2
    return Navigation(
        axes=len(inertia),
        size=size,
        slots=1 + max(nominal.position_delay, velocity_delay, 1),
        noise=noise,
        start=start,
        position_variance=fix,
        velocity_variance=max(nominal.velocity_noise, kalman.SMALLEST_NOISE) ** 2,
        h=h,
        position_delay=nominal.position_delay,
        velocity_delay=velocity_delay,
        scale=layout.scale,
        position_error=first["position_error"],
        position_age=first["position_age"],
        velocity=first["velocity"],
        velocity_age=first["velocity_age"],
        reference_velocity=first["reference_velocity"],
    )
