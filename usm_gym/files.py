"""Files: read only if they are what we expect, written whole or not at all."""

from __future__ import annotations

import json
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from usm_gym.validation import clipped, require

# Nothing that the packages read is larger, bytes.
LARGEST = 512 * 2**20


def read_bytes(path: str | Path, largest: int = LARGEST, links: bool = True) -> bytes:
    """Read a regular file; a pipe or a device is refused, and never waited for.

    Args:
        path: The file.
        largest: How many bytes it may have.
        links: Whether it may be a symbolic link.

    Raises:
        ValueError: If it is no regular file, too large, or a symbolic link where none is allowed.
        OSError: If it cannot be read.
    """
    name = f"file {path}"
    require(links or not Path(path).is_symlink(), name, "a symbolic link", "a regular file")
    # Without O_NONBLOCK the opening of a pipe would wait for somebody to write.
    flags = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    flags |= 0 if links else getattr(os, "O_NOFOLLOW", 0)
    with open(os.open(path, os.O_RDONLY | flags), "rb") as file:
        found = os.fstat(file.fileno())
        require(stat.S_ISREG(found.st_mode), name, stat.filemode(found.st_mode), "a regular file")
        require(found.st_size <= largest, name, f"{found.st_size} bytes", f"up to {largest} bytes")
        return file.read(largest)


def read_json(path: str | Path, links: bool = True) -> Any:
    """Read a file of JSON.

    Raises:
        ValueError: If it holds no JSON, or is no file as `read_bytes` takes it.
        OSError: If it cannot be read.
    """
    return parse_json(read_bytes(path, links=links), f"file {path}")


def parse_json(text: str | bytes, name: str) -> Any:
    """Parse JSON; `name` says in errors what it is.

    Raises:
        ValueError: If it is no JSON, or nested too deeply to be read.
    """
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError(f"{clipped(name)} is nested too deeply") from error
    except ValueError as error:
        raise ValueError(f"{clipped(name)} is no JSON: {clipped(str(error))}") from error


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


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a new file to write instead of `path`, whose place it takes at the end, in one move.

    Readers, and an interruption, see the old or the new one. The new one has the same suffix.
    """
    target = Path(path)
    handle, name = tempfile.mkstemp(
        dir=target.parent, prefix=f"{target.stem}.part", suffix=target.suffix
    )
    os.close(handle)
    try:
        yield Path(name)
        with open(name, "rb") as written:
            os.fsync(written.fileno())
        os.chmod(name, 0o666 & ~_umask())
        os.replace(name, target)
    except BaseException:
        os.unlink(name)
        raise


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write a file in one move."""
    with replacing(path) as part:
        part.write_bytes(data)


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
