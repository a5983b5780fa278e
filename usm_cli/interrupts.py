"""Handles Ctrl-C: it ends the process during the imports of the packages, and raises after them.

This module imports nothing slow: until `listen` is called, Python answers with a traceback.
"""

import os
import signal
import sys
import time
from types import FrameType

STATUS = 130
LINE = "usm: interrupted\n"

# Code that lets no exception pass: modules that are being imported and LLVM's callbacks swallow it,
# turn it into another one, or abort.
DEAF = ("<frozen importlib._bootstrap>", f"{os.sep}llvmlite{os.sep}")
# How long to wait for such code, and the time between two attempts, s.
PATIENCE, PAUSE = 10.0, 0.05


def listen() -> None:
    """Let Ctrl-C end the process, unless it was started to ignore it, as `nohup usm &` does."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, leave)


def leave(number: int, frame: FrameType | None) -> None:
    """End the process at once, since there is nothing to lose yet."""
    os.write(2, LINE.encode())
    os._exit(STATUS)


class Raise:
    """A handler that raises `KeyboardInterrupt` as soon as it is certain to arrive."""

    def __init__(self) -> None:
        """Start without a signal to handle."""
        self._since: float | None = None

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal."""
        import threading  # which the packages have imported by now

        now = time.monotonic()
        self._since = self._since or now
        if _passes(frame) or now - self._since > PATIENCE:
            # Once is enough: a second one would interrupt the clean-up.
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            # Threads that are stopped in the middle of their work, such as joblib's, may fail.
            threading.excepthook = lambda failure: None
            raise KeyboardInterrupt
        again = threading.Timer(PAUSE, _interrupt, (threading.get_ident(),))
        again.daemon = True
        again.start()


def _passes(frame: FrameType | None) -> bool:
    """Whether an exception raised in a frame reaches the outermost frame."""
    while frame is not None:
        if any(name in frame.f_code.co_filename for name in DEAF):
            return False
        frame = frame.f_back
    return True


def _interrupt(thread: int) -> None:
    """Send the signal again to the thread that handles it, which might be asleep."""
    if sys.platform == "win32":
        signal.raise_signal(signal.SIGINT)
    else:
        signal.pthread_kill(thread, signal.SIGINT)
