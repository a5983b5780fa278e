"""What control laws work with: from the observation to signals, from a wrench to the action.

A law sees the tracking error, the applied force and the reference, and answers with a force on the
centre of mass; attitude control and thruster allocation are the same for all.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.compile import compiled, piece, shared
from usm_gym.plant.thrusters import allocate, delivered, lag_shares, saturated
from usm_gym.task.nominal import Nominal
from usm_gym.world import World, world_of

Array = NDArray[np.float64]


# The controller of the attitude in space: it looks so far ahead, by the rates, s, as is fit for a
# pole pair at 1.2 rad/s; it damps roll, N m s/rad, with so much moment at most, N m; and the moment
# in roll is soft, N m/N, because thrusters that hardly have an arm about that axis would need much
# force for it.
ATTITUDE_LEAD, ROLL_DAMPING, ROLL_LIMIT, ROLL_SOFTNESS = 5.0 / 3.0, 3.0, 0.5, 0.05


class Model(NamedTuple):
    """Nominal knowledge in the form that kernels take.

    Attributes:
        axes: Axes in which the position is controlled.
        angles: Angles of the attitude that are controlled.
        thrusters: Number of thrusters.
        mass: Mass of the robot, kg.
        h: Control period, s.
        lag: Share of the way to its command that a thruster is taken to cover in a period.
        mean_lag: The mean of that share over a period.
        scale: Physical value over observed value, by number of the observation.
        position_error: Index of the first number of an entry of the observation.
        reference_velocity: The same.
        reference_acceleration: The same.
        attitude_error: The same.
        watched: Whether roll is to be damped, softly.
        attitude_rate: Index of the rates of roll, pitch and yaw; -1 if no rate is observed.
        reference_rate: The same of the references of pitch and yaw.
        thruster_command: The same.
        thruster_limit: The same.
        position_age: The same; -1 if positions have no age.
        dead_band: Commands below this make no force, N.
    """

    axes: int
    angles: int
    thrusters: int
    mass: float
    h: float
    lag: float
    mean_lag: float
    scale: Array
    position_error: int
    reference_velocity: int
    reference_acceleration: int
    attitude_error: int
    watched: bool
    attitude_rate: int
    reference_rate: int
    thruster_command: int
    thruster_limit: int
    position_age: int
    dead_band: float


class Signals(NamedTuple):
    """What a control law works with, for a batch of robots.

    Attributes:
        started: 0.0 at the first call of an episode, else 1.0, (batch,).
        fresh: Whether the position has just been measured, (batch,).
        navigated: Whether a navigator estimates what follows.
        y: Measured position error, m, (batch, axes); with a navigator, its estimate.
        rate: The navigator's estimate of the error's rate, m/s, (batch, axes).
        disturbance: That of what the nominal model leaves out, m/s^2, (batch, axes).
        thrust: That of the thrust over the inertia, m/s^2, (batch, axes).
        u: Applied force over the mass less the reference's acceleration, m/s^2, (batch, axes).
        velocity: Velocity of the reference, m/s, (batch, axes).
        acceleration: Acceleration of the reference, m/s^2, (batch, axes).
        allocation: Allocation matrices, (batch, `rows_of`, thrusters).
        observation: All that is measured, (batch, numbers).
    """

    started: Array
    fresh: NDArray[np.bool_]
    navigated: bool
    y: Array
    rate: Array
    disturbance: Array
    thrust: Array
    u: Array
    velocity: Array
    acceleration: Array
    allocation: Array
    observation: NDArray[np.float32]


def model_of(nominal: Nominal, lag: bool = False) -> Model:
    """The nominal knowledge for kernels.

    Args:
        nominal: Nominal knowledge.
        lag: Whether the applied force is to lag behind the commands as it nominally does.
    """
    time_constant = nominal.thruster_time_constant if lag else 0.0
    share, mean_share = lag_shares(time_constant, nominal.control_period)
    world = world_of(nominal.robot)
    layout = world.layout
    first = {name: place.start for name, place in layout.slices.items()}
    angles = [f"{angle}_error" for angle in world.attitude]
    return Model(
        axes=len(world.axes),
        angles=len(angles),
        thrusters=world.thrusters,
        mass=world.mass,
        h=nominal.control_period,
        lag=share,
        mean_lag=mean_share,
        scale=layout.scale,
        position_error=first["position_error"],
        reference_velocity=first["reference_velocity"],
        reference_acceleration=first["reference_acceleration"],
        attitude_error=first[angles[0]] if angles else layout.size,
        watched=len(world.watched) > 0,
        attitude_rate=first.get("angular_velocity", -1),
        reference_rate=first.get("reference_rates", -1),
        thruster_command=first["thruster_command"],
        thruster_limit=first["thruster_limit"],
        position_age=first.get("position_age", -1),
        dead_band=nominal.thruster_dead_band,
    )


@piece
def physical(observation, model, index):
    """One number of an observation in its physical unit."""
    return observation[index] * model.scale[index]


@piece
def commanded(observation, model, thruster):
    """Force that the command of a thruster in effect nominally leads to, N."""
    limit = physical(observation, model, model.thruster_limit)
    command = physical(observation, model, model.thruster_command + thruster) * limit
    return delivered(command, 1.0, model.dead_band)


@compiled
def sense(state, model, signals):
    """Fill in the signals from the observations among them and the shared part of the state.

    The applied force is the mean over the past period of the command in effect, after saturation
    and what is known of the lag, projected with the link angles at the beginning of the period.
    These and the thrusters' forces at its end are what the state keeps.
    """
    mean = np.empty(model.thrusters)
    forces = 1 + model.axes * model.thrusters
    for b in range(signals.observation.shape[0]):
        seen = signals.observation[b]
        signals.started[b] = state[b, 0]
        age = model.position_age
        signals.fresh[b] = age < 0 or physical(seen, model, age) == 0.0
        for j in range(model.thrusters):
            last = state[b, forces + j]
            way = commanded(seen, model, j) - last
            mean[j] = last + model.mean_lag * way
            state[b, forces + j] = last + model.lag * way
        for axis in range(model.axes):
            force = 0.0
            for j in range(model.thrusters):
                force += state[b, 1 + axis * model.thrusters + j] * mean[j]
            acceleration = physical(seen, model, model.reference_acceleration + axis)
            signals.y[b, axis] = physical(seen, model, model.position_error + axis)
            signals.velocity[b, axis] = physical(seen, model, model.reference_velocity + axis)
            signals.acceleration[b, axis] = acceleration
            signals.u[b, axis] = force / model.mass - acceleration


@piece
def wanted_moments(seen, model, attitude_gain, moments):
    """Fill in the moments that turn the attitude back and damp roll, N m, (moments,).

    A moment is proportional to the error of an angle, in space as it will be a lead ahead.
    """
    for i in range(model.angles):
        angle_error = physical(seen, model, model.attitude_error + i)
        if model.attitude_rate >= 0:
            rate = physical(seen, model, model.attitude_rate + 1 + i)
            rate -= physical(seen, model, model.reference_rate + i)
            angle_error += ATTITUDE_LEAD * rate
        moments[i] = -attitude_gain * angle_error
    if model.watched:
        rate = physical(seen, model, model.attitude_rate)
        moments[model.angles] = saturated(-ROLL_DAMPING * rate, ROLL_LIMIT)


@compiled
def act(observation, state, model, allocation, force, attitude_gain, action):
    """Fill in the actions that make the forces (N) and the moments of `wanted_moments`."""
    rows = rows_of(model)
    forces, wrench, work = np.empty(model.thrusters), np.empty(rows), np.empty((2 * rows + 1, rows))
    for b in range(observation.shape[0]):
        seen, T = observation[b], allocation[b]
        for axis in range(model.axes):
            wrench[axis] = force[b, axis]
        wanted_moments(seen, model, attitude_gain, wrench[model.axes :])
        # Of three rows the compiler unrolls the loops.
        if rows == 3:
            allocate(T, wrench, 3, 0.0, work, forces)
        else:
            allocate(T, wrench, rows, softness_of(model), work, forces)
        limit = physical(seen, model, model.thruster_limit)
        state[b, 0] = 1.0
        for j in range(model.thrusters):
            action[b, j] = forces[j] / limit
        for axis in range(model.axes):
            for j in range(model.thrusters):
                state[b, 1 + axis * model.thrusters + j] = T[axis, j]


@shared
def rows_of(model: Model) -> int:
    """Rows of an allocation matrix: forces, moments on the attitude, one that damps roll."""
    return model.axes + model.angles + (1 if model.watched else 0)


@shared
def softness_of(model: Model) -> float:
    """How soft the last row of an allocation is, as `allocate` takes it."""
    return ROLL_SOFTNESS * ROLL_SOFTNESS if model.watched else 0.0


@shared
def shared_size(model: Model) -> int:
    """How many numbers of a policy's state `sense` and `act` keep, before the law's own."""
    return 1 + (model.axes + 1) * model.thrusters


def signals_of(
    observation: NDArray[np.float32], model: Model, world: World, navigated: bool = False
) -> Signals:
    """Signals of a batch; the allocation is in, `sense` and a navigator fill in the rest."""
    size = observation.shape[0]
    y, u, velocity, acceleration, rate, disturbance, thrust = np.empty((7, size, model.axes))
    allocation = np.empty((size, rows_of(model), model.thrusters))
    world.allocate(observation, allocation)
    return Signals(
        started=np.empty(size),
        fresh=np.empty(size, np.bool_),
        navigated=navigated,
        y=y,
        rate=rate,
        disturbance=disturbance,
        thrust=thrust,
        u=u,
        velocity=velocity,
        acceleration=acceleration,
        allocation=allocation,
        observation=observation,
    )
