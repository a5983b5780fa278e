"""Policies as a user names them: an id, an id with a file of gains, or a controller of one's own.

| name | meaning |
|---|---|
| `sta` | the registered policy of that id |
| `sta@gains.json` | the same with the gains of a file that `usm tune` has written |
| `my_package.my_module:MyController` | a class or factory of the user's own |
"""

from __future__ import annotations

import hashlib
import importlib
import inspect
import json
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any

from usm_baselines.gains import read_gains
from usm_baselines.registry import Registration, entry, tuned
from usm_gym.policy import Policy, is_privileged
from usm_gym.support.validation import UsageError, in_one_line, require
from usm_gym.task.nominal import Nominal

# For what code of ours is refused. Whatever else it raises is a bug of ours.
OUR_REFUSALS = (ValueError, ArithmeticError, TimeoutError)
PREDICT = "predict(observation, state=None, episode_start=None, deterministic=True)"


@dataclass(frozen=True)
class Contender:
    """A policy under the name by which it was asked for; it is made anew for every task.

    Attributes:
        name: That name.
        factory: Makes the policy from nominal knowledge.
        privileged: Whether it is given true state, and so is no competitor.
        told: What it is told besides the measured position and the reference; empty if unknown.
        note: What to bear in mind about its scores.
        identity: What its scores depend on besides scenarios and nominal knowledge; None where that
            is not known, as for the code of others.
        tuned_for: The preset of conditions for which it was tuned or trained; empty if for none.
    """

    name: str
    factory: Callable[[Nominal], Any]
    privileged: bool = False
    told: str = ""
    note: str = ""
    identity: str | None = None
    tuned_for: str = ""

    @property
    def refusals(self) -> tuple[type[BaseException], ...]:
        """For what the policy is refused; the code of others is, whatever it raises."""
        return (Exception, SystemExit) if self.identity is None else OUR_REFUSALS

    def make(self, nominal: Nominal) -> Policy:
        """Make the policy.

        Raises:
            ValueError: If it cannot be made, has no `predict` of the kind that is called, or is
                given true state although the contender does not say so.
        """
        try:
            policy: Policy = self.factory(nominal)
        except self.refusals as error:
            fault = f"{type(error).__name__}: {in_one_line(error)}"
            raise UsageError(f"policy {self.name} cannot be made: {fault}") from error
        predict = getattr(policy, "predict", None)
        require(
            callable(predict), f"policy {self.name}", type(policy).__name__, f"one with {PREDICT}"
        )
        require(
            is_privileged(policy) == self.privileged,
            f"privileged of policy {self.name}",
            is_privileged(policy),
            f"{self.privileged}, as its class or factory has it",
        )
        try:
            inspect.signature(policy.predict).bind(None, None, None, deterministic=True)
        except (TypeError, ValueError) as error:
            raise UsageError(f"policy {self.name} lacks {PREDICT}: {error}") from error
        return policy


def contender(name: str) -> Contender:
    """The policy of a name.

    Raises:
        ValueError: If there is none.
        OSError: If a file of gains cannot be read.
    """
    id, at, path = name.partition("@")
    if at:
        file = read_gains(path)
        require(file.policy == id, f"policy of {path}", file.policy, id)
        return registered(name, tuned(file))
    if ":" in name:
        factory = own(name)
        privileged = getattr(factory, "privileged", False) is True
        return Contender(name, partial(call, factory), privileged)
    return registered(name, entry(name))


def registered(name: str, entry: Registration) -> Contender:
    """A registered policy as a contender."""
    factory = entry.factory
    settings: list[Any] = []
    while isinstance(factory, partial):
        settings.append([factory.args, factory.keywords])
        factory = factory.func
    package = factory.__module__.partition(".")[0]
    identity = None
    if hasattr(sys.modules.get(package), "__path__"):
        sources = fingerprint("usm_gym", "usm_baselines", package)
        where = [factory.__module__, factory.__qualname__]
        identity = json.dumps([where, settings, sources], sort_keys=True)
    return Contender(
        name,
        entry.factory,
        entry.privileged,
        entry.told,
        entry.note,
        identity,
        entry.tuned_for,
    )


def own(name: str) -> Callable[..., Any]:
    """The factory `module:attribute`, which takes the nominal knowledge or nothing."""
    path, _, attribute = name.partition(":")
    module = imported(path, f"policy {name}")
    factory: Any = getattr(module, attribute, None)
    require(
        callable(factory),
        f"policy {name}",
        attribute,
        f"a class or factory in {path}{_made(module)}",
    )
    chosen: Callable[..., Any] = factory
    return chosen


def imported(path: str, what: str) -> ModuleType:
    """Import a module of the user's own.

    Modules are looked for in the current folder, too, but there last: a folder that is named like
    one of our packages hides none.

    Args:
        path: Name of the module.
        what: What it is for; begins the error.

    Raises:
        ValueError: If it cannot be imported.
    """
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    try:
        return importlib.import_module(path)
    except Exception as error:
        fault = f"{type(error).__name__}: {in_one_line(error)}"
        raise UsageError(f"{what}: module {path!r} cannot be imported ({fault})") from error


def call(factory: Callable[..., Any], nominal: Nominal) -> Any:
    """Call a factory, with the nominal knowledge if it needs an argument or has one `nominal`."""
    signature = inspect.signature(factory)
    try:
        signature.bind()
    except TypeError:
        return factory(nominal)
    return factory(nominal=nominal) if "nominal" in signature.parameters else factory()


@cache
def fingerprint(*packages: str) -> str:
    """A hash of all files of packages, and of the versions that numbers may depend on."""
    digest = hashlib.sha256()
    for package in ("numba", "numpy", "scipy"):
        digest.update(version(package).encode())
    for package in sorted(set(packages)):
        for folder in sys.modules[package].__path__:  # a namespace package has several
            for file in sorted(Path(folder).rglob("*")):
                if file.is_file() and "__pycache__" not in file.parts:
                    digest.update(file.relative_to(folder).as_posix().encode() + b"\0")
                    digest.update(file.read_bytes())
    return digest.hexdigest()


def _made(module: ModuleType) -> str:
    here = [
        name
        for name, value in vars(module).items()
        if callable(value) and getattr(value, "__module__", None) == module.__name__
    ]
    return f", which has {', '.join(here)}" if here else ", which has none"
