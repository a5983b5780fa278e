"""Files that are either whole or not there."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import Any


def check_writable(path: str | Path) -> None:
    """Raise `OSError` now if a file could not be written later."""
    target = Path(path)
    if target.is_dir():
        raise IsADirectoryError(f"cannot write {target}: it is a directory")
    if not target.parent.is_dir():
        raise FileNotFoundError(f"cannot write {target}: there is no directory {target.parent}")
    try:
        with tempfile.NamedTemporaryFile(dir=target.parent):
            pass
    except OSError as error:
        raise type(error)(f"cannot write {target}: {error.strerror}") from error


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write a file in one move: readers, and an interruption, see the old or the new one."""
    target = Path(path)
    with tempfile.NamedTemporaryFile(
        dir=target.parent, prefix=target.name, suffix=".part", delete=False
    ) as part:
        try:
            part.write(data)
            part.flush()
            os.fsync(part.fileno())
            os.chmod(part.name, 0o666 & ~_umask())
            os.replace(part.name, target)
        except BaseException:
            os.unlink(part.name)
            raise


def write_text(path: str | Path, text: str) -> None:
    """Write text in one move, as `write_bytes` does."""
    write_bytes(path, text.encode())


def write_json(path: str | Path, data: Any) -> None:
    """Write data as JSON in one move; a NaN is refused."""
    write_text(path, json.dumps(data, indent=1, allow_nan=False) + "\n")


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
