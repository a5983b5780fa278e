"""Shows policies, one above the other, as a film or in a window (needs the extra `render`)."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import numpy as np

from usm_cli.take import Take
from usm_gym.rendering.chart import error_scale
from usm_gym.rendering.comparison import Caption, Comparison
from usm_gym.rendering.depiction import AnyCanvas, depiction_of
from usm_gym.rendering.look import Frame
from usm_gym.rendering.window import Window
from usm_gym.support.files import replacing

# It warns of films that Ctrl-C ends before their first frame, but those are removed anyway.
logging.getLogger("imageio_ffmpeg").setLevel(logging.ERROR)

# Frames per second of a medium, and the width of a frame with one policy and with several.
# The times of a GIF are multiples of 0.01 s, and GIFs become large quickly.
FPS = {".mp4": 25.0, ".gif": 12.5, "window": 50.0}
WIDTHS = {".mp4": (960, 720), ".gif": (640, 560), "window": (960, 480)}
# A GIF has one palette, so that a frame holds only its differences from the one before. The palette
# comes from a few frames that are sent ahead; otherwise the encoder would keep the whole film.
AHEAD = 8
GIF = (
    f"split[a][b];[a]trim=end_frame={AHEAD},palettegen=max_colors=64[p];"
    f"[b]trim=start_frame={AHEAD},setpts=PTS-STARTPTS[c];"
    "[c][p]paletteuse=dither=none:diff_mode=rectangle"
)


class Film:
    """Takes of the same scenario, one above the other, with one scale for their errors.

    Attributes:
        size: Width and height of a frame.
        length: Number of frames.
    """

    def __init__(
        self,
        takes: Sequence[Take],
        names: Sequence[str],
        length: int,
        width: int,
        speed: float = 1.0,
    ) -> None:
        """Cut a film.

        Args:
            takes: One to three takes.
            names: What to call them.
            length: Number of frames.
            width: Of a frame, pixels.
            speed: Of the film, times real time.
        """
        self._takes, self._name = takes, names[0]
        self._canvas: AnyCanvas | Comparison
        last = [take.pictures[-1] for take in takes]
        scenario = takes[0].trajectory.scenario
        if len(takes) == 1:
            self._canvas = depiction_of(scenario.body).canvas(width)
            self._scale = error_scale(last[0].errors)
        else:
            captions = [Caption(name, take.told) for name, take in zip(names, takes, strict=True)]
            self._canvas = Comparison(width, captions, scenario, last, speed)
        self.size = self._canvas.size
        self.length = length

    def frame(self, index: int) -> Frame:
        """Draw a frame."""
        pictures = [take.pictures[min(index, len(take.pictures) - 1)] for take in self._takes]
        if isinstance(self._canvas, Comparison):
            return self._canvas.draw(pictures)
        return self._canvas.draw(pictures[0], self._name, self._scale)


def write(
    film: Film, path: Path, fps: float, progress: Callable[[int], object] = lambda frames: None
) -> None:
    """Write a film to an .mp4 or .gif file, in one move.

    Raises:
        OSError: If it cannot be written.
    """
    options: dict[str, Any]
    ahead: list[int] = []
    if path.suffix == ".gif":
        options = {"codec": "gif", "pix_fmt_out": "pal8", "output_params": ["-vf", GIF]}
        options |= {"quality": None, "macro_block_size": 1}
        ahead = np.linspace(0, film.length - 1, AHEAD).astype(int).tolist()
    else:
        options = {"codec": "libx264", "quality": 6, "macro_block_size": 2}
        options |= {"output_params": ["-preset", "veryfast", "-movflags", "+faststart"]}
    with replacing(path) as part:
        try:
            with closing(
                imageio_ffmpeg.write_frames(
                    part, film.size, fps=fps, ffmpeg_log_level="quiet", **options
                )
            ) as writer:
                writer.send(None)
                for index in ahead:
                    writer.send(film.frame(index))
                for index in range(film.length):
                    writer.send(film.frame(index))
                    progress(1)
            # The encoder does not report a full disk, so count the frames.
            written, _ = imageio_ffmpeg.count_frames_and_secs(part)
        except (OSError, RuntimeError) as error:
            raise OSError(f"cannot write {path}: the encoder stopped; is the disk full?") from error
        if written != film.length:
            raise OSError(f"cannot write {path}: {written} of {film.length} frames fit")


def play(film: Film, fps: float) -> None:
    """Show a film in a window until it ends or the window is closed, and skip late frames.

    Escape and Q also close the window.
    """
    window = Window(film.size, "usm watch")
    begin = time.perf_counter()
    try:
        index = 0
        while index < film.length and not window.closed:
            window.show(film.frame(index), fps)
            index = max(index + 1, round((time.perf_counter() - begin) * fps))
        if not window.closed:
            window.show(film.frame(film.length - 1), fps)
    finally:
        window.close()
