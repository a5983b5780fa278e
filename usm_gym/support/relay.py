"""Calls from other processes of this machine, by way of a file that one process reads."""

from __future__ import annotations

import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

# How often the file is read, s.
PERIOD = 0.2
_CALL = struct.Struct("=qd")


@dataclass(frozen=True)
class Relay:
    """Calls a function of another process; on another machine it does nothing.

    Attributes:
        path: The file.
    """

    path: str

    def __call__(self, index: int, value: float) -> None:
        """Send an index and a value."""
        with suppress(OSError), open(self.path, "ab", buffering=0) as file:
            file.write(_CALL.pack(index, value))


@contextmanager
def relayed(hear: Callable[[int, float], object]) -> Iterator[Relay]:
    """Give what other processes may call, and call `hear` in its place, in a thread of this one."""
    with TemporaryDirectory(prefix="usm-", ignore_cleanup_errors=True) as folder:
        path, ended = Path(folder) / "calls", threading.Event()
        path.touch()
        listener = threading.Thread(target=_listen, args=(path, hear, ended), daemon=True)
        listener.start()
        try:
            yield Relay(str(path))
        finally:
            ended.set()
            listener.join()


def _listen(path: Path, hear: Callable[[int, float], object], ended: threading.Event) -> None:
    rest, last = b"", False
    with path.open("rb") as file:
        while not last:
            last = ended.wait(PERIOD)
            data = rest + file.read()
            whole = len(data) - len(data) % _CALL.size
            for index, value in _CALL.iter_unpack(data[:whole]):
                hear(index, value)
            rest = data[whole:]
