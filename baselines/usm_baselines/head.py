"""What all laws for the head share: they move the joints, and a law for the body moves thrusters.

The law for the body is given the beginning of the observation, in which the centre of mass is to
hold its station, and a heading error that looks ahead; so it acts as in the other tasks. The law
for the head answers with rates of the joints.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_baselines.policy import Percept, ScriptedPolicy, as_batch
from usm_baselines.signals import Array
from usm_baselines.space import Gain, chosen_gains
from usm_gym.dynamics import accelerations
from usm_gym.head_world import HeadWorld
from usm_gym.kernels.compile import compiled
from usm_gym.manipulator import Manipulator
from usm_gym.robot import Robot
from usm_gym.robots import AnyRobot
from usm_gym.sensors import Layout
from usm_gym.spatial_dynamics import spatial_accelerations
from usm_gym.support.validation import require
from usm_gym.task.head_sampling import posture_of
from usm_gym.task.nominal import Nominal
from usm_gym.world import world_of

# Gains that laws for the head share, each tuned for every law.
HEAD_GAIN = Gain(10.0, "1/s", "rate of the head over its error", tuned=(0.3, 30.0), positive=True)
LEAD = Gain(0.1, "s", "how far ahead the reference's velocity is taken", tuned=(0.01, 1.0))
POSTURE_GAIN = Gain(
    0.3, "1/s", "rate at which the posture returns", tuned=(0.02, 3.0), positive=True
)
DAMPING = Gain(0.02, "m/rad", "singular value at which least squares are damped", tuned=(1e-3, 0.3))
HEADING_LEAD = Gain(
    1.0, "s", "how far ahead the heading error is taken, in the plane", tuned=(0.05, 5.0)
)


class HeadModel(NamedTuple):
    """Nominal knowledge in the form that kernels take.

    Attributes:
        axes: Axes of the position.
        channels: What follows the path: the axes, in the plane also the direction.
        joints: Number of joints.
        mass: Mass of the robot, kg.
        rate_limit: Largest commanded rate of a joint, rad/s.
        angle_limit: Largest commanded angle of a joint, rad.
        scale: Physical value over observed value, by number of the observation.
        position_error: Index of the first number of an entry of the observation.
        head_error: The same.
        reference_velocity: The same of the head's reference.
        reference_acceleration: The same.
        direction_error: The same; -1 in space.
        direction_rate: The same of the direction's reference; -1 in space.
        joint_angles: The same.
        joint_rates: The same.
        tail_rate: The same; -1 in space.
        heading_error: The same; -1 in space.
    """

    axes: int
    channels: int
    joints: int
    mass: float
    rate_limit: float
    angle_limit: float
    scale: Array
    position_error: int
    head_error: int
    reference_velocity: int
    reference_acceleration: int
    direction_error: int
    direction_rate: int
    joint_angles: int
    joint_rates: int
    tail_rate: int
    heading_error: int


def head_model_of(nominal: Nominal) -> HeadModel:
    """The nominal knowledge for kernels."""
    world, body = world_of(nominal.robot), nominal.robot
    first = {name: place.start for name, place in world.layout.slices.items()}
    return HeadModel(
        axes=len(world.axes),
        channels=len(world.axes) + len(world.attitude),
        joints=body.joints,
        mass=world.mass,
        rate_limit=body.joint_rate_limit,
        angle_limit=body.joint_angle_limit,
        scale=world.layout.scale,
        position_error=first["position_error"],
        head_error=first["head_error"],
        reference_velocity=first["head_reference_velocity"],
        reference_acceleration=first["head_reference_acceleration"],
        direction_error=first.get("direction_error", -1),
        direction_rate=first.get("direction_reference_rate", -1),
        joint_angles=first["joint_angles"],
        joint_rates=first["joint_rates"],
        tail_rate=first.get("tail_rate", -1),
        heading_error=first.get("heading_error", -1),
    )


def station_of(nominal: Nominal) -> Nominal:
    """What is known of the same robot that holds its station: what its law is made from.

    Raises:
        ValueError: If the joints are not the policy's.
    """
    steered = isinstance(nominal.robot, Manipulator)
    require(steered, "robot", nominal.robot, "one whose joints the policy moves")
    return dataclasses.replace(nominal, robot=nominal.robot.robot)


class HeadPercept(NamedTuple):
    """What a law for the head knows of a batch before it acts.

    Attributes:
        seen: Observations, (batch, numbers).
        body: What the law for the body knows.
        jacobians: How the head moves with the joints, see `HeadWorld.jacobians`.
        offsets: By how much the centres of mass are further than measured, m, (batch, axes).
    """

    seen: NDArray[np.float32]
    body: Percept
    jacobians: Array
    offsets: Array

    @property
    def state(self) -> Array:
        """State of the law for the body, which is that of the law for the head."""
        return self.body.state


class HeadLaw:
    """A law for the head behind `predict`; subclasses give `Gains` and `act`.

    Attributes:
        nominal: What the policy knows of the robot.
        gains: The law's gains, one of its `Gains`.
        body: The law that holds the body.
        privileged: Whether it has to be given true state, as that law has.
    """

    # The law's gains: a `NamedTuple` of `Gain`, with the field `heading_lead`.
    Gains: type[Any]

    def __init__(self, nominal: Nominal, body: ScriptedPolicy, **gains: float) -> None:
        """Take gains other than the defaults by name.

        Args:
            nominal: What the policy knows of the robot.
            body: The law that holds the body, made from `station_of(nominal)`.
            gains: Gains other than the defaults, by name.

        Raises:
            ValueError: If a gain is unknown or not allowed.
        """
        names = self.Gains._fields
        unknown = ", ".join(name for name in gains if name not in names)
        require(not unknown, "gains", unknown, ", ".join(names))
        self.nominal, self.body = nominal, body
        self.gains = chosen_gains(self.Gains, gains)
        self.privileged = body.privileged
        world = world_of(nominal.robot)
        assert isinstance(world, HeadWorld)
        self._world, self._model = world, head_model_of(nominal)
        self._robot = nominal.robot.robot
        self._home = posture_of(self._robot)

    @property
    def channels(self) -> int:
        """What follows the path: the axes, in the plane also the direction."""
        return self._model.channels

    def act(self, known: HeadPercept, thrust: Array, correction: Array) -> tuple[Array, Array]:
        """Decide on thrusters and joints.

        Args:
            known: What is known.
            thrust: What the law for the body commands of the thrusters over their limit, (batch,
                thrusters).
            correction: What to add to the velocities wanted of the head, m/s and rad/s, (batch,
                channels).

        Returns:
            Commands of the thrusters over their limit, (batch, thrusters), and rates of the joints,
            rad/s, (batch, joints).
        """
        raise NotImplementedError

    def predict(
        self,
        observation: ArrayLike,
        state: Array | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
        **truth: Any,
    ) -> tuple[NDArray[np.float32], Array]:
        """Act on one observation or on a batch.

        Args:
            observation: Observation, (numbers,) or (batch, numbers).
            state: What the last call returned; None at the start.
            episode_start: Where an episode starts and the state is dropped, bool, a scalar
                or (batch,).
            deterministic: Without effect: the laws are deterministic.
            truth: What a privileged law for the body is given.

        Returns:
            Commands of thrusters and joints over their limits, not clipped, (numbers,) or (batch,
            numbers), and the state for the next call, which is that of the law for the body.

        Raises:
            ValueError: If the shape of the observation or the state is wrong.
        """
        seen, single = as_batch(observation, self._model.scale.size)
        if self.privileged:
            self.body.take_in(truth["snapshot"])  # type: ignore[attr-defined]
        action, new_state = self.decide(self.perceive(seen, state, episode_start))
        return (action[0] if single else action), new_state

    def perceive(
        self, observation: NDArray[np.float32], state: Array | None, start: ArrayLike | None
    ) -> HeadPercept:
        """The first half of `predict`, as of `ScriptedPolicy`."""
        model = self._model
        station = observation[:, : self._world.station.layout.size].copy()
        if model.heading_error >= 0:
            look_ahead(station, model, self.gains.heading_lead)
        body = self.body.perceive(station, state, start)
        jacobians = np.empty((len(observation), model.channels, model.joints))
        self._world.jacobians(observation, jacobians)
        place = slice(model.position_error, model.position_error + model.axes)
        offsets = body.signals.y - observation[:, place] * model.scale[place]
        return HeadPercept(observation, body, jacobians, offsets)

    def decide(
        self, known: HeadPercept, correction: Array | None = None
    ) -> tuple[NDArray[np.float32], Array]:
        """The second half: act on what is known, which stays as it is.

        Args:
            known: What `perceive` returned.
            correction: As of `act`; None: 0.

        Returns:
            Commands, (batch, thrusters and joints), and the state for the next call.
        """
        asked, new_state = self.body.decide(known.body)
        if correction is None:
            correction = np.zeros((len(asked), self.channels))
        thrust, rates = self.act(known, asked.astype(np.float64), correction)
        rates /= self._model.rate_limit
        return np.concatenate([thrust, rates], axis=1, dtype=np.float32), new_state


def reactions(robot: AnyRobot, seen: NDArray[np.float32], layout: Layout) -> Array:
    """How the body turns with the joints when nothing else acts, by the nominal plant.

    Args:
        robot: The nominal robot.
        seen: Observations, (batch, numbers).
        layout: Their table.

    Returns:
        Rates of the heading, in space of the middle link about its axes, that unit rates of the
        joints make from rest, (batch, angles, joints).
    """

    def read(entry: str) -> Array:
        place = layout.slices[entry]
        return np.asarray(seen[:, np.newaxis, place] * layout.scale[place])

    phi = read("joint_angles")
    joints = phi.shape[-1]
    # A torque on one joint after the other, and on none.
    torques = np.eye(joints + 1)[:, :joints]
    if isinstance(robot, Robot):
        theta = np.cumsum(np.concatenate([read("tail_angle"), -phi], axis=-1), axis=-1)
        still = np.zeros(joints + 1), np.zeros(2)
        thrust = np.zeros(len(robot.thrusters))
        angular, _ = accelerations(robot, theta, *still, torques, thrust)
        joint, turning = -np.diff(angular), angular.mean(axis=-1, keepdims=True)
    else:
        attitude = read("attitude")
        attitude /= np.linalg.norm(attitude, axis=-1, keepdims=True)
        still = np.zeros(3), np.zeros(3)
        thrust = np.zeros(len(robot.thrusters))
        _, turning, joint = spatial_accelerations(
            robot, attitude, *still, phi, np.zeros(joints), torques, thrust
        )
    joint, turning = joint[:, :-1] - joint[:, -1:], turning[:, :-1] - turning[:, -1:]
    return np.linalg.solve(joint, turning).swapaxes(1, 2)


@compiled
def look_ahead(station, model, lead):
    """Replace heading errors by what they will be a lead, s, ahead, by the rates of all links.

    The thrusters turn the body slowly, and every motion of the joints turns it, too.
    """
    for b in range(station.shape[0]):
        seen = station[b]
        rate = seen[model.tail_rate] * model.scale[model.tail_rate]
        mean = rate
        for j in range(model.joints):
            k = model.joint_rates + j
            rate -= seen[k] * model.scale[k]
            mean += rate
        k = model.heading_error
        seen[k] += lead * mean / (model.joints + 1) / model.scale[k]
