"""Windows that show frames (needs the extra `render`)."""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import NDArray

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
import pygame


class Window:
    """A window that shows frames; once the user has closed it, `show` does nothing."""

    def __init__(self, size: tuple[int, int], title: str) -> None:
        """Open the window."""
        self._size, self._title = size, title
        self._clock = pygame.time.Clock()
        self._open()

    @property
    def closed(self) -> bool:
        """Whether the window has been closed."""
        return self._window not in _windows

    def show(self, frame: NDArray[np.uint8], fps: float) -> None:
        """Show a frame, (height, width, 3), no earlier than 1 / fps seconds after the last."""
        if not self.closed and _is_dead(self._window):
            _windows.remove(self._window)
            self._open()
        for event in pygame.event.get():
            if event.type == pygame.WINDOWCLOSE or (
                event.type == pygame.KEYDOWN and event.key in (pygame.K_ESCAPE, pygame.K_q)
            ):
                _close(event.window)
        if self.closed:
            return
        image = pygame.image.frombuffer(frame.data, frame.shape[1::-1], "RGB")
        self._window.get_surface().blit(image, (0, 0))
        self._window.flip()
        self._clock.tick(fps)

    def close(self) -> None:
        """Close the window, and the connection to the display with the last one."""
        _close(self._window)

    def _open(self) -> None:
        if not pygame.display.get_init():
            pygame.display.init()
        self._window = pygame.Window(self._title, self._size)
        _windows.add(self._window)


_windows: set[pygame.Window] = set()


def has_display() -> bool:
    """Whether there is a display; without one, windows are drawn into memory."""
    pygame.display.init()
    try:
        return pygame.display.get_driver() != "offscreen"
    finally:
        if not _windows:
            pygame.display.quit()


def _is_dead(window: pygame.Window) -> bool:
    """Whether somebody's `pygame.quit()` has destroyed the window."""
    try:
        return not window.id
    except pygame.error:
        return True


def _close(window: pygame.Window | None) -> None:
    if window not in _windows:
        return
    _windows.remove(window)
    window.destroy()
    if not _windows:
        pygame.display.quit()
