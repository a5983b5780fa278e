"""What a control law of one's own needs of the robot: named signals, allocation, a linear model."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from numpy.typing import ArrayLike

from usm_gym.base_vehicle import Array, BaseVehicle
from usm_gym.linear_model import LinearModel, Variable
from usm_gym.robot import Robot
from usm_gym.support.validation import real_array, require
from usm_gym.task.nominal import Nominal


class Vehicle(BaseVehicle):
    """The nominal robot as a controller deals with it.

    It knows what may be known beforehand, and nothing that is drawn for an episode. All arrays may
    have axes in front of the last one; a single observation has none, a batch has one.

    ```python
    vehicle = usm_gym.Vehicle(nominal)
    seen, memory = vehicle.read(observation)
    action = vehicle.allocate(-300.0 * seen.position_error, -100.0 * seen.heading_error, seen)
    ```

    `read` gives the entries of the observation (docs/tasks.md), and

    | attribute | size | unit | meaning |
    |---|---|---|---|
    | `velocity_error` | 2 | m/s | velocity minus that of the reference, global frame |
    | `link_angles` | links | rad | from the tail, against the x axis |
    | `heading_rate` | 1 | rad/s | rate of the mean link angle |
    | `thruster_forces` | thrusters | N | by the commands, and the nominal lag and dead-band |
    | `wrench` | 3 | N, N, N m | force (x, y) and moment of these, global frame |
    | `allocation` | (3, thrusters) | 1, 1, m | from forces of the thrusters to that wrench |
    | `state` | 9, or 6 | | the states of `linear_model`, as deviations from the reference |

    `velocity_error` is the difference of two measured positions over their distance in time,
    filtered with a time constant of 0.02 s; where something measures the velocity, it is taken
    from that instead. It is as late as the measurements are.

    Attributes:
        nominal: The nominal knowledge.
        robot: The robot with its nominal coefficients.
        period: Control period, s.
        mass: Mass, without that of the water which moves along, kg.
    """

    def __init__(self, nominal: Nominal) -> None:
        """Take what is known of the robot: what a controller is made with, or that of environments.

        Args:
            nominal: `env.unwrapped.nominal`.

        Raises:
            ValueError: If it is none, or that of a robot that is not the planar one.
        """
        super().__init__(nominal, Robot, "the planar robot")
        self.robot: Robot = nominal.robot

    def _complete(self, seen: SimpleNamespace) -> None:
        bends = np.cumsum(seen.joint_angles, axis=-1)
        seen.link_angles = np.concatenate([seen.tail_angle, seen.tail_angle - bends], axis=-1)
        # Joint i turns the links between it and the head.
        turned = np.arange(self.robot.links - 1, 0, -1) / self.robot.links
        turning = (seen.joint_rates * turned).sum(axis=-1, keepdims=True)
        seen.heading_rate = seen.tail_rate - turning
        state = [seen.position_error, seen.heading_error, seen.velocity_error, seen.heading_rate]
        lagging = [seen.wrench] if self.nominal.thruster_time_constant > 0.0 else []
        seen.state = np.concatenate([*state, *lagging], axis=-1)

    def inertia(self, link_angles: ArrayLike | None = None) -> Array:
        """Inertia of the robot with the water that moves along, its joints held.

        Args:
            link_angles: Link angles from the tail, against the x axis, rad, (..., links); without
                them the body lies straight along x.

        Returns:
            From the accelerations of the centre of mass (x, y) and of the heading to force and
            moment, (..., 3, 3), in kg, kg m and kg m^2.
        """
        return self._inertia_and_drag(link_angles)[0]

    def linear_model(self, link_angles: ArrayLike | None = None) -> LinearModel:
        """Linear model of the robot about rest in still water, its joints held.

        In continuous time, x' = A x + B u, with the states

        | state | size | unit | meaning |
        |---|---|---|---|
        | `position` | 2 | m | centre of mass, global frame (x, y) |
        | `heading` | 1 | rad | mean link angle |
        | `velocity` | 2 | m/s | of the centre of mass, global frame |
        | `heading_rate` | 1 | rad/s | |
        | `wrench` | 3 | N, N, N m | in effect; only if the thrusters have a lag |

        The input is the `wrench` that is asked for: force (x, y), N, and moment, N m. `allocate`
        makes an action of it, and `read` has the states as `state`.

        The drag is that at rest: the quadratic one, which counts from some 0.1 m/s on, is
        left out. `usm_gym.linearise` gives a model in which the joints give way.

        Args:
            link_angles: The body's shape, as of `inertia`, (links,).

        Returns:
            The model, with a period of 0.

        Raises:
            ValueError: If the shape is wrong.
        """
        inertia, drag = self._inertia_and_drag(link_angles)
        require(inertia.ndim == 2, "link_angles", link_angles, f"shape ({self.robot.links},)")
        lag = self.nominal.thruster_time_constant
        states: tuple[Variable, ...] = (
            Variable("position", 2, "m"),
            Variable("heading", 1, "rad"),
            Variable("velocity", 2, "m/s"),
            Variable("heading_rate", 1, "rad/s"),
        )
        A, B = np.zeros((6, 6)), np.zeros((6, 3))
        A[:3, 3:] = np.eye(3)
        A[3:, 3:], B[3:] = -np.linalg.solve(inertia, drag), np.linalg.inv(inertia)
        wrench = Variable("wrench", 3, "N, N, N m")
        if lag > 0.0:
            states = (*states, wrench)
            A = np.block([[A, B], [np.zeros((3, 6)), -np.eye(3) / lag]])
            B = np.concatenate([np.zeros((6, 3)), np.eye(3) / lag])
        return LinearModel(A, B, states, (wrench,), period=0.0)

    def _inertia_and_drag(self, link_angles: ArrayLike | None) -> tuple[Array, Array]:
        """Inertia, and linear drag over velocities instead of accelerations, (..., 3, 3)."""
        robot = self.robot
        given = np.zeros(robot.links) if link_angles is None else link_angles
        theta = real_array("link_angles", given)
        allowed = f"({robot.links},) or (batch, {robot.links})"
        require(theta.shape[-1:] == (robot.links,), "link_angles' shape", theta.shape, allowed)
        require(np.isfinite(theta).all(), "link_angles", link_angles, "finite numbers")
        along = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
        place = robot.link_length * (np.cumsum(along, axis=-2) - 0.5 * along)
        place -= place.mean(axis=-2, keepdims=True)
        across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
        # Velocities of the links along and across themselves, over those of the whole.
        lever = np.stack([-place[..., 1], place[..., 0]], axis=-1)
        rows = [
            np.concatenate([axis, (axis * lever).sum(axis=-1, keepdims=True)], axis=-1)
            for axis in (along, across)
        ]
        squares = [np.swapaxes(row, -1, -2) @ row for row in rows]
        turning = robot.links * np.diag([0.0, 0.0, 1.0])
        mass, added = robot.link_mass, robot.added_mass
        inertia = mass * squares[0] + (mass + added) * squares[1]
        inertia = inertia + (robot.link_inertia + robot.added_inertia) * turning
        drag = robot.tangential_drag * squares[0] + robot.normal_drag * squares[1]
        return inertia, drag + robot.linear_yaw_drag * turning
