"""What a control law of one's own needs of the robot in space: named signals and allocation."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from usm_gym.base_vehicle import BaseVehicle
from usm_gym.spatial_robot import SpatialRobot
from usm_gym.task.nominal import Nominal


class SpatialVehicle(BaseVehicle):
    """The nominal robot in space as a controller deals with it; see `usm_gym.Vehicle`.

    ```python
    vehicle = usm_gym.SpatialVehicle(nominal)
    seen, memory = vehicle.read(observation)
    force = -300.0 * seen.position_error - 600.0 * seen.velocity_error
    moment = -100.0 * seen.attitude_error - 170.0 * seen.attitude_rate
    action = vehicle.allocate(force, moment, seen)
    ```

    `read` gives the entries of the observation (docs/tasks_in_space.md), and

    | attribute | size | unit | meaning |
    |---|---|---|---|
    | `velocity_error` | 3 | m/s | velocity minus that of the reference, global frame |
    | `attitude_error` | 2 | rad | errors of pitch and yaw: about y and z of the middle link |
    | `attitude_rate` | 2 | rad/s | their rates: angular velocity minus that of the reference |
    | `thruster_forces` | thrusters | N | by the commands, and the nominal lag and dead-band |
    | `wrench` | 5 | N, N m | force (x, y, z), global frame, and moments (y, z) of these |
    | `allocation` | (5, thrusters) | 1, m | from forces of the thrusters to that wrench |

    Roll is measured, too (`roll_error`, `angular_velocity`), but thrusters hardly act on it.
    `velocity_error` is found as by `Vehicle`.

    Attributes:
        nominal: The nominal knowledge.
        robot: The robot with its nominal coefficients.
        period: Control period, s.
        mass: Mass, without that of the water which moves along, kg.
        inertia: Mass of the straight body along x, y and z with the water that moves along, kg,
            (3,).
        drag: Its linear drag, N s/m, (3,).
    """

    def __init__(self, nominal: Nominal) -> None:
        """Take what is known of the robot: what a controller is made with, or that of environments.

        Args:
            nominal: `env.unwrapped.nominal`.

        Raises:
            ValueError: If it is none, or that of a robot that is not a spatial one.
        """
        super().__init__(nominal, SpatialRobot, "a robot in space")
        self.robot: SpatialRobot = nominal.robot
        self.inertia, self.drag = self._world.straight_body

    def _complete(self, seen: SimpleNamespace) -> None:
        seen.attitude_error = np.concatenate([seen.pitch_error, seen.yaw_error], axis=-1)
        seen.attitude_rate = seen.angular_velocity[..., 1:] - seen.reference_rates
