"""The console script `usm`: Ctrl-C ends a command with status 130 and one line.

Imports take a second or more, so only the standard library is imported before that holds.
"""

from __future__ import annotations

import os
import signal
import sys
from typing import NoReturn

INTERRUPTED = 130
SAID = "usm: interrupted\n"


def main() -> None:
    """Run the command that the arguments name."""
    listen()
    open_closed_streams()
    from agents.main import main as run

    listening = signal.getsignal(signal.SIGINT) is leave
    try:
        try:
            if listening:
                signal.signal(signal.SIGINT, signal.default_int_handler)
            run()
        finally:
            if listening:
                # A second Ctrl-C neither breaks the clean-up at exit nor changes the status.
                signal.signal(signal.SIGINT, signal.SIG_IGN)
    except KeyboardInterrupt:
        sys.stderr.write(SAID)
        sys.exit(INTERRUPTED)
    finally:
        drop_unwritable_output()


def listen() -> None:
    """Let Ctrl-C end the process, unless it was started to ignore that, as by `nohup usm &`."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, leave)


def leave(number: int, frame: object) -> NoReturn:
    """End the process at once: there is nothing to lose yet.

    An exception would not do, since extension modules that are being imported may swallow it.
    """
    os.write(2, SAID.encode())
    os._exit(INTERRUPTED)


def open_closed_streams() -> None:
    """Put the null device where `>&-` has closed a standard stream.

    Otherwise the next file to be opened would take the stream's place.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            handle = os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
            os.set_inheritable(handle, True)
            setattr(sys, name, os.fdopen(handle, "w" if number else "r"))


def drop_unwritable_output() -> None:
    """Let the interpreter end in silence if nobody takes what it still has to print."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
