"""Starts and ends the console script `usm`; Ctrl-C ends it with one line and status 130."""

import os
import signal
import sys

from usm_cli import interrupts


def main() -> None:
    """Run the command that the arguments name."""
    interrupts.listen()
    open_closed_streams()
    from usm_cli.program import main as run  # which takes a second or more

    listening = signal.getsignal(signal.SIGINT) is interrupts.leave
    try:
        try:
            if listening:
                signal.signal(signal.SIGINT, interrupts.Raise())
            run()
        finally:
            if listening:
                # A second Ctrl-C neither breaks the clean-up at exit nor changes the status.
                signal.signal(signal.SIGINT, signal.SIG_IGN)
    except KeyboardInterrupt:
        sys.stderr.write(interrupts.LINE)
        sys.exit(interrupts.STATUS)
    finally:
        drop_unwritable_output()


def open_closed_streams() -> None:
    """Open the null device in place of a standard stream that `>&-` has closed.

    Otherwise the next file that is opened would take the place of the stream.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            handle = os.open(os.devnull, os.O_RDWR)  # takes the lowest free number
            os.set_inheritable(handle, True)
            setattr(sys, name, os.fdopen(handle, "w" if number else "r"))


def drop_unwritable_output() -> None:
    """Let the interpreter end silently if nobody reads the rest of its output."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
