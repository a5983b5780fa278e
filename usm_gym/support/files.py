"""Files: read only if they are regular, and written completely or not at all."""

from __future__ import annotations

import glob
import json
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout, lock_descriptor

from usm_gym.support.validation import UsageError, clipped, require

# The packages read no larger file, bytes.
LARGEST = 512 * 2**20


def read_bytes(path: str | Path, largest: int = LARGEST, links: bool = True) -> bytes:
    """Read a regular file; refuse a pipe or a device instead of waiting for it.

    Args:
        path: The file.
        largest: The largest size allowed, bytes.
        links: Whether it may be a symbolic link.

    Raises:
        ValueError: If it is not a regular file, is too large, or is a link where none is allowed.
        OSError: If it cannot be read.
    """
    name = f"file {path}"
    require(links or not Path(path).is_symlink(), name, "a symbolic link", "a regular file")
    # Without O_NONBLOCK, opening a pipe would wait for a writer.
    flags = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    flags |= 0 if links else getattr(os, "O_NOFOLLOW", 0)
    with open(os.open(path, os.O_RDONLY | flags), "rb") as file:
        status = os.fstat(file.fileno())
        require(stat.S_ISREG(status.st_mode), name, stat.filemode(status.st_mode), "a regular file")
        require(
            status.st_size <= largest, name, f"{status.st_size} bytes", f"up to {largest} bytes"
        )
        return file.read(largest)


def read_text(path: str | Path) -> str:
    """Read a text file in UTF-8.

    Raises:
        ValueError: If it is not UTF-8, or `read_bytes` refuses it.
        OSError: If it cannot be read.
    """
    try:
        return read_bytes(path).decode()
    except UnicodeDecodeError as error:
        raise UsageError(f"file {path} is no text in UTF-8: {error}") from error


def read_json(path: str | Path, links: bool = True) -> Any:
    """Read a JSON file.

    Raises:
        ValueError: If it is not JSON, or `read_bytes` refuses it.
        OSError: If it cannot be read.
    """
    return parse_json(read_bytes(path, links=links), f"file {path}")


def parse_json(text: str | bytes, name: str) -> Any:
    """Parse JSON; `name` stands for it in errors.

    Raises:
        ValueError: If it is not JSON, or is nested too deeply.
    """
    try:
        return json.loads(text)
    except RecursionError as error:
        raise UsageError(f"{clipped(name)} is nested too deeply") from error
    except ValueError as error:  # of JSON, Unicode or an integer of too many digits
        raise UsageError(f"{clipped(name)} is no JSON: {clipped(str(error))}") from error


def check_writable(path: str | Path) -> None:
    """Raise `OSError` at once if a file cannot be written later."""
    target = Path(path)
    if target.is_dir():
        raise IsADirectoryError(f"cannot write {target}: it is a directory")
    if not target.parent.is_dir():
        raise FileNotFoundError(f"cannot write {target}: there is no directory {target.parent}")
    # Otherwise the file would replace a device.
    if target.exists() and not target.is_file():
        raise OSError(f"cannot write {target}: it is there, and no regular file")
    try:
        with tempfile.NamedTemporaryFile(dir=target.parent):
            pass
    except OSError as error:
        raise type(error)(f"cannot write {target}: {error.strerror}") from error


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a new file, with the suffix of `path`, that replaces `path` in one move at the end.

    After an interruption or a power cut, `path` is either the old file or the new one. Parts left
    by killed writers of `path` are removed, but never one that is still being written: its writer
    has locked it, and the system unlocks it only when the writer ends.
    """
    target = Path(path)
    _remove_dead_parts(target)
    handle, part = _new_part(target)
    try:
        with naming(target):
            yield part
            os.chmod(part, 0o666 & ~_umask())
            sync(part)
            os.replace(part, target)
            sync_folder(target.parent)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    finally:
        if handle is not None:
            os.close(handle)


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Add a file's name to system errors without one, such as that of a full disk."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno is not None:
            error.filename = str(path)
        raise


@contextmanager
def holding(path: str | Path) -> Iterator[None]:
    """Reserve an output, a file or a folder, for this process.

    The system locks a file, `.lock` in the folder or `.NAME.lock` beside the file. It unlocks it
    when the process ends, however it ends, so a killed process keeps nobody out.

    Raises:
        BlockingIOError: If another process holds the output.
        OSError: If nothing can be written there.
    """
    target = Path(path)
    file = target / ".lock" if target.is_dir() else target.with_name(f".{target.name}.lock")
    file.parent.stat()  # FileLock would make the folder
    lock = FileLock(file)
    try:
        lock.acquire(timeout=0)
    except Timeout as error:
        raise BlockingIOError(f"{target} is in use by another command") from error
    try:
        yield
    finally:
        # Unlinked while it is locked: a process that has opened it meanwhile sees its name gone.
        # Windows does not remove an open file.
        with suppress(PermissionError):
            file.unlink(missing_ok=True)
        lock.release()


def sync(file: Path) -> None:
    """Wait until the content of a file would survive a power cut."""
    with open(file, "rb") as written:
        os.fsync(written.fileno())


def sync_folder(folder: Path) -> None:
    """Wait until the names in a folder would survive a power cut, if the system supports that."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def move_folder(part: Path, target: Path) -> None:
    """Rename a finished folder in one move that survives a power cut."""
    for file in part.iterdir():
        sync(file)
    sync_folder(part)
    os.rename(part, target)
    sync_folder(target.parent)


def remove_folder(folder: Path) -> None:
    """Remove a folder and its content, if it exists."""
    with suppress(FileNotFoundError):
        shutil.rmtree(folder)


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


def _new_part(target: Path) -> tuple[int | None, Path]:
    """Make an empty part of a file, locked until the handle is closed.

    It has no lock on Windows, where nobody else can move or write an open file.
    """
    while True:
        handle, name = tempfile.mkstemp(
            dir=target.parent, prefix=f"{target.stem}.part", suffix=target.suffix
        )
        if os.name == "nt":
            os.close(handle)
            return None, Path(name)
        if _locked(handle) and os.fstat(handle).st_nlink > 0:
            return handle, Path(name)
        os.close(handle)  # another writer removed it as dead before it was locked


def _locked(handle: int) -> bool:
    try:
        return lock_descriptor(handle, blocking=False)
    except OSError:  # the file system has no locks, so nobody removes it as dead
        return True


def _remove_dead_parts(target: Path) -> None:
    if os.name == "nt":
        return  # a dead part looks like one that is being written
    pattern = f"{glob.escape(target.stem)}.part????????{glob.escape(target.suffix)}"
    for part in target.parent.glob(pattern):
        with suppress(OSError):
            handle = os.open(part, os.O_RDWR | os.O_NONBLOCK | os.O_NOFOLLOW)
            try:
                if lock_descriptor(handle, blocking=False):
                    part.unlink()  # while it is locked, so that nobody starts to write it
            finally:
                os.close(handle)
