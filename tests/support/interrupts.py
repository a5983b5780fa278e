"""Commands that Ctrl-C reaches, whatever the tests were started with."""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

# What a background job of a shell, or `nohup`, has started ignores SIGINT and hands that on.
LISTENING = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
os.execvp(sys.argv[1], sys.argv[1:])
"""


def listening(*command: Any) -> list[str]:
    """Return the same command, started so that SIGINT is not ignored."""
    return [sys.executable, "-c", LISTENING, *map(str, command)]


@contextmanager
def listening_here() -> Iterator[None]:
    """Let SIGINT raise KeyboardInterrupt in this process."""
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)
