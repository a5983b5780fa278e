"""What an environment renders with: its render modes, and one robot under observation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from usm_gym.picture import Recorder
from usm_gym.simulation import Simulation
from usm_gym.validation import require

if TYPE_CHECKING:
    from usm_gym.window import Window

RENDER_MODES = ("human", "rgb_array")


class Viewer:
    """Shows one robot of a simulation: in a window of its own, or as images."""

    def __init__(self, render_mode: str, index: int = 0) -> None:
        """Follow the robot `index`.

        Raises:
            ValueError: If the render mode is unknown.
            gymnasium.error.DependencyNotInstalled: Without the extra `render`.
        """
        require(render_mode in RENDER_MODES, "render_mode", render_mode, "None, human, rgb_array")
        try:
            from usm_gym.rendering import Canvas
        except ImportError as error:
            raise gym.error.DependencyNotInstalled(
                f"render_mode={render_mode!r} needs {error.name}: pip install 'usm-gym[render]'"
            ) from error
        self._to_window = render_mode == "human"
        self._canvas: Canvas | None = Canvas()
        self._window: Window | None = None
        self._recorder = Recorder(index)
        self._index = index

    def follow(self, simulation: Simulation) -> None:
        """Take note of a control instant; a window shows it at once."""
        self._recorder.note(simulation)
        if self._to_window:
            self.render(simulation)

    def render(self, simulation: Simulation) -> NDArray[np.uint8] | None:
        """An image of the present, (height, width, 3); None where a window shows it."""
        from usm_gym.rendering import Canvas
        from usm_gym.window import Window

        self._canvas = self._canvas or Canvas()
        scenario = simulation.scenarios[self._index]
        title = f"{scenario.mode} mode"
        if not self._to_window:
            return self._canvas.draw(self._recorder.picture(simulation), title)
        self._window = self._window or Window(self._canvas.size, "usm-gym")
        if not self._window.closed:
            frame = self._canvas.draw(self._recorder.picture(simulation), title)
            self._window.show(frame, 1 / scenario.conditions.control_period)
        return None

    def close(self) -> None:
        """Close the window, if there is one; rendering opens it again."""
        if self._window is not None:
            self._window.close()
        self._window = self._canvas = None
