"""What Ctrl-C does: it ends the process while the packages are imported, later it raises.

Nothing is imported here that takes time: until `listen` is called, Python answers with a traceback.
"""

import os
import signal
import sys
import time
from types import FrameType

STATUS = 130
LINE = "usm: interrupted\n"

# Code through which no exception passes: modules that are being imported and LLVM's callbacks
# swallow it, turn it into another one, or abort.
DEAF = ("<frozen importlib._bootstrap>", f"{os.sep}llvmlite{os.sep}")
# How long such code is waited for, and the time between two attempts, s.
PATIENCE, PAUSE = 10.0, 0.05


def listen() -> None:
    """Let Ctrl-C end the process, unless it was started to ignore that, as by `nohup usm &`."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, leave)


def leave(number: int, frame: FrameType | None) -> None:
    """End the process at once: there is nothing to lose yet."""
    os.write(2, LINE.encode())
    os._exit(STATUS)


class Raise:
    """A handler that raises `KeyboardInterrupt`, as soon as it is sure to arrive."""

    def __init__(self) -> None:
        """Wait for nothing yet."""
        self._since: float | None = None

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal."""
        import threading  # as the packages have done by now

        now = time.monotonic()
        self._since = self._since or now
        if _passes(frame) or now - self._since > PATIENCE:
            # Once is enough: another one would interrupt the clean-up.
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            # Threads that are stopped in the midst of their work may fail, joblib's for one.
            threading.excepthook = lambda failure: None
            raise KeyboardInterrupt
        again = threading.Timer(PAUSE, _interrupt, (threading.get_ident(),))
        again.daemon = True
        again.start()


def _passes(frame: FrameType | None) -> bool:
    """Whether an exception that is raised in a frame reaches the outermost one."""
    while frame is not None:
        if any(name in frame.f_code.co_filename for name in DEAF):
            return False
        frame = frame.f_back
    return True


def _interrupt(thread: int) -> None:
    """Send the signal again, to the thread that handles it, lest that sleep on."""
    if sys.platform == "win32":
        signal.raise_signal(signal.SIGINT)
    else:
        signal.pthread_kill(thread, signal.SIGINT)
