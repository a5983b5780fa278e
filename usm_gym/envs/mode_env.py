"""The environments of this package's modes, as its classes for one world complete them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from gymnasium.vector import AutoresetMode

from usm_gym.envs.env import TrackingEnv
from usm_gym.envs.vector_env import TrackingVectorEnv
from usm_gym.rendering.viewer import RENDER_MODES
from usm_gym.robots import AnyRobot
from usm_gym.task.conditions import Conditions
from usm_gym.task.modes import AnyMode
from usm_gym.task.sampler import sampler_of
from usm_gym.task.scenario import require_mode


class ModeEnv(TrackingEnv):
    """The environment of a mode; the class of its world says what is asked there.

    Attributes:
        modes: The modes of that world.
        mode: The one of this environment.
        conditions: The conditions of the scenarios that are drawn.
        robot: The robot.
    """

    # One frame per control period; an instance corrects the rate if it has another period.
    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 50}  # noqa: RUF012 (Gymnasium's)
    modes: ClassVar[tuple[AnyMode, ...]]

    def __init__(
        self,
        mode: AnyMode,
        conditions: str | Mapping[str, Any] | Conditions = "field",
        robot: str | Mapping[str, Any] | AnyRobot | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Make the environment; no random number is drawn before `reset`.

        Raises:
            ValueError: If a condition, a field of the robot or the render mode is not allowed.
        """
        require_mode(mode, self.modes)
        sampler = sampler_of(mode, conditions, robot)
        self.mode, self.conditions, self.robot = mode, sampler.conditions, sampler.robot
        super().__init__(sampler, render_mode)


class ModeVectorEnv(TrackingVectorEnv):
    """`num_envs` robots, each as in `ModeEnv`, with the same bits."""

    metadata = {"render_modes": list(RENDER_MODES)}  # noqa: RUF012 (Gymnasium's)
    modes: ClassVar[tuple[AnyMode, ...]]

    def __init__(
        self,
        num_envs: int,
        mode: AnyMode,
        conditions: str | Mapping[str, Any] | Conditions = "field",
        robot: str | Mapping[str, Any] | AnyRobot | None = None,
        render_mode: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int = 1,
        render_index: int = 0,
    ) -> None:
        """Make the environment.

        Args:
            num_envs: How many robots.
            mode: As of the environment of one robot.
            conditions: As of the environment of one robot.
            robot: As of the environment of one robot.
            render_mode: "rgb_array" gives images of all robots, "human" shows one robot in a
                window.
            autoreset_mode: What happens to a robot whose episode has ended.
            threads: How many threads share a step, at most one per core; without effect on its
                result.
            render_index: Which robot the window shows.

        Raises:
            ValueError: If an argument is not allowed.
        """
        require_mode(mode, self.modes)
        sampler = sampler_of(mode, conditions, robot)
        self.mode, self.conditions, self.robot = mode, sampler.conditions, sampler.robot
        super().__init__(num_envs, sampler, autoreset_mode, threads, render_mode, render_index)
