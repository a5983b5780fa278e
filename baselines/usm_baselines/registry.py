"""Policies by name: the mechanism; `usm_baselines.policies` registers those of this package."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import partial
from typing import Any

from usm_baselines.families import Family
from usm_baselines.gains import FOLDERS, TUNED, GainsFile, read_gains
from usm_baselines.policy import ScriptedPolicy
from usm_baselines.space import Space, space_of
from usm_gym.policy import Policy
from usm_gym.support.validation import UsageError, brief, require
from usm_gym.task.nominal import Nominal

# What a policy is told that is told no more than the measured position and the reference.
POSITION_ONLY = "position only"


@dataclass(frozen=True)
class Registration:
    """A registered policy.

    Attributes:
        factory: Makes the policy from nominal knowledge; keyword arguments are its gains.
        summary: What it is, in a line.
        space: The gains that are tuned, by name, and where.
        told: What it is told besides the measured position and the reference.
        on_request: Whether to leave it out of evaluations unless it is asked for.
        privileged: Whether it is given true state, and so is no competitor.
        note: What to bear in mind about its scores; empty if nothing.
        tuned_for: The preset of conditions for which its gains are tuned; empty if for none.
        family: The family under which it is listed; None for a policy of the user's own.
        moves_joints: Whether it moves the joints, too, and so is one for the head.
    """

    factory: Callable[..., Policy]
    summary: str
    space: Space = field(default_factory=dict)
    told: str = POSITION_ONLY
    on_request: bool = False
    privileged: bool = False
    note: str = ""
    tuned_for: str = ""
    family: Family | None = None
    moves_joints: bool = False


_entries: dict[str, Registration] = {}


def register(
    id: str,
    factory: Callable[..., Policy],
    summary: str,
    *,
    space: Space | None = None,
    told: str = POSITION_ONLY,
    on_request: bool = False,
    privileged: bool = False,
    note: str = "",
    tuned_for: str = "",
    family: Family | None = None,
    moves_joints: bool = False,
) -> None:
    """Register a policy, and the same with shipped gains, as `ID-tuned` or another of `FOLDERS`.

    Args:
        id: Its name.
        factory: `factory(nominal, **gains)` returns an object with `predict`; it is given
            `env.unwrapped.nominal` and no more of the environment.
        summary: What it is, in a line.
        space: The gains that are tuned, by name, and where; without it, as the `Gains` of a
            `ScriptedPolicy` declare, and none of another factory.
        told: What it is told besides the measured position and the reference.
        on_request: Whether to leave it out of evaluations unless it is asked for; its tuned forms
            are not left out.
        privileged: Whether it is given true state.
        note: What to bear in mind about its scores.
        tuned_for: The preset of conditions that it was trained or tuned for.
        family: The family under which it is listed.
        moves_joints: Whether it moves the joints, too.

    Raises:
        ValueError: If the name is taken.
    """
    require(id not in _entries, "id", id, "a name that is not taken")
    chosen = _declared_space(factory) if space is None else space
    about = (told, on_request, privileged, note, tuned_for, family, moves_joints)
    _entries[id] = Registration(factory, summary, chosen, *about)
    for suffix, folder in FOLDERS.items():
        shipped = TUNED / folder / f"{id}.json"
        if shipped.is_file():
            _entries[f"{id}-{suffix}"] = tuned(read_gains(shipped))


def _declared_space(factory: Any) -> Space:
    law = _law_of(factory)
    return {} if law is None else space_of(law.Gains)


def _law_of(factory: Any) -> type[ScriptedPolicy] | None:
    while isinstance(factory, partial):
        factory = factory.func
    law = isinstance(factory, type) and issubclass(factory, ScriptedPolicy)
    return factory if law else None


def _require_gains(file: GainsFile, factory: Callable[..., Policy]) -> None:
    """Refuse a file with gains that its policy does not have."""
    law = _law_of(factory)
    if law is not None:
        names = law.Gains._fields
        unknown = ", ".join(name for name in file.gains if name not in names)
        require(not unknown, f"gains of {file.policy}", unknown, ", ".join(names))
    try:
        inspect.signature(factory).bind(None, **file.gains)
    except TypeError as error:
        raise UsageError(f"gains of {file.policy}: {error}") from error


def tuned(file: GainsFile) -> Registration:
    """The registered policy that a file of gains is for, with these gains.

    Raises:
        ValueError: If there is no such policy, or it does not have one of the gains.
    """
    base, budget = entry(file.policy), file.budget
    _require_gains(file, base.factory)
    tier = f" for {file.tuned_for}" if file.tuned_for else ""
    return Registration(
        partial(base.factory, **file.gains),
        f"{file.policy}, tuned{tier} in {budget.trials} trials of {budget.episodes} episodes",
        told=base.told,
        privileged=base.privileged,
        note=base.note,
        tuned_for=file.tuned_for,
        family=base.family,
        moves_joints=base.moves_joints,
    )


def law_of(id: str) -> str:
    """The id of a policy without what its name says of its gains."""
    forms = [suffix for suffix in FOLDERS if id.endswith(f"-{suffix}")]
    return id.removesuffix(f"-{max(forms, key=len)}") if forms else id


def base_of(id: str) -> str:
    """The policy of which another is a form, with other gains or estimates; itself if of none."""
    law = law_of(id)
    if law == id:
        for estimates in ("lag", "navigator"):
            law = law.removesuffix(f"-{estimates}")
    return base_of(law) if law != id and law in _entries else id


def ids() -> list[str]:
    """Names of all registered policies, in the order of registration."""
    return list(_entries)


def entry(id: str) -> Registration:
    """The registered policy of a name.

    Raises:
        ValueError: If there is none.
    """
    if id not in _entries:
        near = get_close_matches(str(id), _entries, n=3)
        meant = f"; did you mean {' or '.join(near)}?" if near else ""
        raise UsageError(f"policy is {brief(id)}; allowed: those that `usm policies` lists{meant}")
    return _entries[id]


def make(id: str, env: Any, **gains: Any) -> Policy:
    """Make a policy for an environment.

    Args:
        id: Name of the policy.
        env: Environment, single or vector, or the `Nominal` knowledge itself.
        gains: Gains other than the defaults, by name.

    Raises:
        ValueError: If the policy or a gain is unknown, or the environment is none of this package.
    """
    policy = entry(id)
    try:
        return policy.factory(nominal_knowledge(env), **gains)
    except TypeError as error:
        require(not gains, "gains", gains, f"those of the policy ({error})")
        raise


def nominal_knowledge(env: Any) -> Nominal:
    """The nominal knowledge of an environment, whatever it is wrapped in.

    Raises:
        ValueError: If it is not one of this package, or its robots do not share their knowledge.
    """
    if isinstance(env, Nominal):
        return env
    inner = getattr(env, "unwrapped", env)
    if hasattr(inner, "nominal"):
        known = [inner.nominal]
    else:
        require(hasattr(inner, "get_attr"), "env", env, "an environment of this package")
        known = list(inner.get_attr("nominal"))
    valid = all(isinstance(nominal, Nominal) for nominal in known)
    require(valid, "env", env, "an environment of this package")
    kinds = f"{len(set(known))} kinds"
    require(len(set(known)) == 1, "nominal knowledge", kinds, "one of all robots")
    nominal: Nominal = known[0]
    return nominal
