"""Renders an environment: its render modes, and the robots that it shows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from usm_gym.rendering.picture import Recorder
from usm_gym.simulation import Simulation
from usm_gym.support.validation import require

if TYPE_CHECKING:
    from usm_gym.rendering.canvas import Canvas
    from usm_gym.rendering.window import Window

RENDER_MODES = ("human", "rgb_array")


class Viewer:
    """Shows one robot of a simulation in a window, or all robots as images.

    Nothing is drawn, and pygame is not imported, before the first `render`. A pickle or a copy of
    an environment has no canvas and no window; it makes its own.

    Attributes:
        mode: The render mode, "human" or "rgb_array".
    """

    def __init__(self, render_mode: str, robots: int = 1, in_window: int = 0) -> None:
        """Follow all of `robots` robots for images, or the robot `in_window` for a window.

        Raises:
            ValueError: If the render mode is unknown.
        """
        require(render_mode in RENDER_MODES, "render_mode", render_mode, "None, human, rgb_array")
        self.mode = render_mode
        indices = [in_window] if render_mode == "human" else range(robots)
        self._recorders = [Recorder(index) for index in indices]
        self._canvas: Canvas | None = None
        self._window: Window | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_canvas": None, "_window": None}

    def follow(self, simulation: Simulation) -> None:
        """Record a control instant; a window shows it at once."""
        for recorder in self._recorders:
            recorder.note(simulation)
        if self.mode == "human":
            self.render(simulation)

    def render(self, simulation: Simulation) -> tuple[NDArray[np.uint8], ...] | None:
        """Draw the present: one image per robot, (height, width, 3); None with a window.

        Raises:
            gymnasium.error.DependencyNotInstalled: Without the extra `render`.
        """
        if self._canvas is None:
            self._canvas = self._open()
        if self._window is not None and self._window.closed:
            return None
        pictures = [recorder.picture(simulation) for recorder in self._recorders]
        images = tuple(
            self._canvas.draw(picture, f"{picture.scenario.mode} mode") for picture in pictures
        )
        if self._window is None:
            return images
        self._window.show(images[0], 1 / pictures[0].scenario.conditions.control_period)
        return None

    def close(self) -> None:
        """Close the window, if there is one; rendering opens it again."""
        if self._window is not None:
            self._window.close()
        self._window = self._canvas = None

    def _open(self) -> Canvas:
        try:
            from usm_gym.rendering.canvas import Canvas
            from usm_gym.rendering.window import Window
        except ImportError as error:
            raise gym.error.DependencyNotInstalled(
                f"render_mode={self.mode!r} needs {error.name}: pip install 'usm-gym[render]'"
            ) from error
        canvas = Canvas()
        if self.mode == "human":
            self._window = Window(canvas.size, "usm-gym")
        return canvas
