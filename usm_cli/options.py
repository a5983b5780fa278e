"""Options that commands share: conditions, workers, output."""

from __future__ import annotations

import argparse
import logging
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import joblib

from usm_gym.support.files import check_writable, parse_json
from usm_gym.support.validation import UsageError, require
from usm_gym.task.conditions import Conditions, conditions_of
from usm_gym.task.modes import ALL_MODES, presets_of

# How long a cluster may take to accept a connection, s.
CONNECTION_TIME = 10.0
# The largest count that an option takes; more is a typing mistake.
MOST, MOST_WORKERS = 1_000_000_000, 1000


def check_installed(what: str, extra: str, *modules: str) -> None:
    """Refuse to go on without the modules of an extra.

    Args:
        what: What needs them.
        extra: The extra that they come with.
        modules: The names under which they are imported.

    Raises:
        UsageError: If one is not installed.
    """
    for module in modules:
        if find_spec(module) is None:
            package = module.replace("_", "-")
            raise UsageError(f"{what} needs {package}: pip install 'usm-gym[{extra}]'")


def add_mode(parser: argparse.ArgumentParser, default: str | None = "operation") -> None:
    """Add the option for the mode of sampled scenarios."""
    words = f"{', '.join(ALL_MODES)} (default: operation)"
    parser.add_argument("--mode", choices=ALL_MODES, default=default, metavar="M", help=words)


def add_computing(parser: argparse.ArgumentParser, default: str = "1") -> None:
    """Add the options for processes and clusters; `default` says how many processes there are."""
    add = parser.add_argument
    said = f"processes (default: {default}; on a cluster: all)"
    add("--workers", type=int, metavar="N", help=said)
    add(
        "--cluster",
        metavar="ADDRESS",
        help="compute on your own Ray cluster (extra `cluster`); Ray runs the code of whoever "
        "can reach it",
    )


@contextmanager
def computing(arguments: argparse.Namespace, default: int = 1) -> Iterator[int]:
    """Make the chosen cluster joblib's backend, and give the number of workers.

    Without the option it is `default`, and on a cluster as many as it has.
    """
    workers = arguments.workers
    allowed = f"1 to {MOST_WORKERS}"
    require(workers is None or 1 <= workers <= MOST_WORKERS, "--workers", workers, allowed)
    if arguments.cluster is None:
        yield workers or default
        return
    check_installed("--cluster", "cluster", "ray")
    import ray
    from ray.util.joblib import register_ray

    check_reachable(arguments.cluster)
    try:
        ray.init(address=arguments.cluster, logging_level=logging.ERROR, log_to_driver=False)
    except RuntimeError as error:
        raise ConnectionError(f"no Ray cluster at {arguments.cluster}: {error}") from error
    try:
        register_ray()
        with joblib.parallel_config(backend="ray"):
            yield workers or int(ray.cluster_resources().get("CPU", 1))
    finally:
        ray.shutdown()


def check_reachable(address: str) -> None:
    """Raise `ConnectionError` at once if nobody listens; Ray itself would wait for minutes."""
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if not colon:
        return  # a word that Ray knows, such as "auto"
    known = port.isdecimal() and len(port) <= 5 and int(port) < 2**16
    require(known, "--cluster", address, "HOST:PORT")
    try:
        socket.create_connection((host, int(port)), CONNECTION_TIME).close()
    except (OSError, UnicodeError) as error:  # the latter for an invalid host name
        raise ConnectionError(f"no Ray cluster at {address}: {error}") from error


def parse_conditions(text: str, mode: str = "operation") -> Conditions:
    """Read the conditions of a mode from a preset's name or a JSON object."""
    presets = presets_of(mode)
    if text.lstrip()[:1] not in ("{", "["):
        return conditions_of(text, presets)
    return conditions_of(parse_json(text, f"--conditions {text}"), presets)


def count(arguments: Any, option: str, default: int, least: int = 1) -> int:
    """Get an integer option or its default.

    Raises:
        ValueError: If it is too small or too large.
    """
    value = getattr(arguments, option)
    allowed = f"{least} to {MOST}"
    require(value is None or least <= value <= MOST, f"--{option}", value, allowed)
    return default if value is None else int(value)


def output_folder(name: str) -> Path:
    """Get an output folder for figures, and make it if necessary.

    Raises:
        ValueError: If figures cannot be drawn.
        OSError: If nothing can be written there.
    """
    check_installed("drawing figures", "render", "matplotlib")
    folder = Path(name)
    folder.mkdir(parents=True, exist_ok=True)
    check_writable(folder / "table")
    return folder
