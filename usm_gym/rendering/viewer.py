"""Renders an environment: its render modes, and the robots that it shows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium as gym

from usm_gym.rendering.depiction import AnyCanvas, depiction_of
from usm_gym.rendering.look import Frame
from usm_gym.simulation import Simulation
from usm_gym.support.validation import require

if TYPE_CHECKING:
    from usm_gym.rendering.window import Window

RENDER_MODES = ("human", "rgb_array")


class Viewer:
    """Shows one robot of a simulation in a window, or all robots as images.

    Nothing is drawn, and pygame is not imported, before the first `render`. A pickle or a copy of
    an environment has no canvas and no window; it makes its own.

    Attributes:
        mode: The render mode, "human" or "rgb_array".
    """

    def __init__(self, robot: Any, render_mode: str, robots: int = 1, in_window: int = 0) -> None:
        """Follow all of `robots` robots for images, or the robot `in_window` for a window.

        Args:
            robot: The robot that all of them are.
            render_mode: "human" or "rgb_array".
            robots: How many there are.
            in_window: The one that a window shows.

        Raises:
            ValueError: If the render mode is unknown.
        """
        require(render_mode in RENDER_MODES, "render_mode", render_mode, "None, human, rgb_array")
        self.mode = render_mode
        indices = [in_window] if render_mode == "human" else range(robots)
        self._depiction = depiction_of(robot)
        self._recorders = [self._depiction.recorder(index) for index in indices]
        self._canvas: AnyCanvas | None = None
        self._window: Window | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_canvas": None, "_window": None}

    def follow(self, simulation: Simulation) -> None:
        """Record a control instant; a window shows it at once."""
        for recorder in self._recorders:
            recorder.note(simulation)
        if self.mode == "human":
            self.render(simulation)

    def render(self, simulation: Simulation) -> tuple[Frame, ...] | None:
        """Draw the present: one image per robot, (height, width, 3); None with a window.

        Raises:
            gymnasium.error.DependencyNotInstalled: Without the extra `render`.
        """
        if self._canvas is None:
            self._canvas = self._open()
        if self._window is not None and self._window.closed:
            return None
        images = []
        for recorder in self._recorders:
            mode = simulation.scenarios[recorder.index].mode
            images.append(self._canvas.draw(recorder.picture(simulation), f"{mode} mode"))
        if self._window is None:
            return tuple(images)
        self._window.show(images[0], 1 / simulation.scenarios[0].conditions.control_period)
        return None

    def close(self) -> None:
        """Close the window, if there is one; rendering opens it again."""
        if self._window is not None:
            self._window.close()
        self._window = self._canvas = None

    def _open(self) -> AnyCanvas:
        try:
            canvas = self._depiction.canvas()
            from usm_gym.rendering.window import Window
        except ImportError as error:
            raise gym.error.DependencyNotInstalled(
                f"render_mode={self.mode!r} needs {error.name}: pip install 'usm-gym[render]'"
            ) from error
        if self.mode == "human":
            self._window = Window(canvas.size, "usm-gym")
        return canvas
