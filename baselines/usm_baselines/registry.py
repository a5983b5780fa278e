"""Policies by name."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import partial
from typing import Any

from usm_baselines.families import Family
from usm_baselines.gains import FOLDERS, TUNED, GainsFile, read_gains
from usm_baselines.laws.adaptive_lqg import AdaptiveLQG
from usm_baselines.laws.disturbance_observer import DisturbanceObserver
from usm_baselines.laws.generalised_super_twisting import (
    AdaptiveGeneralisedSuperTwisting,
    GeneralisedSuperTwisting,
)
from usm_baselines.laws.heading import Heading
from usm_baselines.laws.incremental import Incremental
from usm_baselines.laws.informed_lqg import InformedLQG
from usm_baselines.laws.joint_lqg import JointLQG
from usm_baselines.laws.ladrc import LADRC
from usm_baselines.laws.limited_mpc import LimitedMPC
from usm_baselines.laws.lqg import LQG
from usm_baselines.laws.mpc import MPC
from usm_baselines.laws.oracle import Oracle
from usm_baselines.laws.pd import PD, SPACES
from usm_baselines.laws.pid import PID
from usm_baselines.laws.sliding_mode import SlidingMode
from usm_baselines.laws.super_twisting import SuperTwisting
from usm_baselines.laws.zero import Zero
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

    Raises:
        ValueError: If the name is taken.
    """
    require(id not in _entries, "id", id, "a name that is not taken")
    chosen = _declared_space(factory) if space is None else space
    about = (told, on_request, privileged, note, tuned_for, family)
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


# What laws are told besides the measured position and the reference.
LAG = "lag"
NAVIGATED = "lag, noise, delays, nominal plant"
BODY, FORESIGHT = "lag, noise, straight body", "lag, noise, nominal plant, joint references"

register(
    "sta",
    SuperTwisting,
    "the paper's adaptive super-twisting law with its gains, made stable at this control rate",
    family=Family.SLIDING_MODE,
)
register(
    "sta-explicit",
    partial(SuperTwisting, implicit=False),
    "the same law stepped as the paper has it, which needs a far higher control rate",
    space={},
    family=Family.SLIDING_MODE,
)
register(
    "sta-shtessel",
    partial(SuperTwisting, fall=1.0),
    "super-twisting whose gains also fall again (Shtessel et al.)",
    family=Family.SLIDING_MODE,
)
register("pd", PD, "the paper's PD with its gains, as a force", family=Family.PD)
register(
    "pd-mass",
    partial(PD, reading="mass"),
    "the same PD read as an acceleration: times the mass, with feedforward",
    space=SPACES["mass"],
    family=Family.PD,
)
register(
    "pd-observer",
    partial(PD, reading="observer"),
    "the same PD in place of super-twisting, on the paper's observer",
    space=SPACES["observer"],
    family=Family.PD,
)
register("pid", PID, "PID with filtered derivative and anti-windup", family=Family.PD)
register(
    "ladrc",
    LADRC,
    "linear active-disturbance rejection: extended-state observer and pole placement",
    family=Family.OBSERVER,
)
register(
    "smc",
    SlidingMode,
    "sliding mode with boundary layer and integral action",
    family=Family.SLIDING_MODE,
)
register(
    "gsta",
    GeneralisedSuperTwisting,
    "generalised super-twisting with constant gains, on the paper's observer",
    family=Family.SLIDING_MODE,
)
register(
    "agsta",
    AdaptiveGeneralisedSuperTwisting,
    "generalised super-twisting whose gains adapt as the paper's do",
    family=Family.SLIDING_MODE,
)
# Laws that estimate the disturbance from the applied force, once more with the lagging force.
for _id in ("sta", "sta-shtessel", "pd", "pd-mass", "pd-observer", "ladrc", "smc", "gsta", "agsta"):
    _law = _entries[_id]
    register(
        f"{_id}-lag",
        partial(_law.factory, lag=True),
        f"{_id}, told the thrusters' lag",
        told=LAG,
        space=_law.space,
        on_request=True,
        family=_law.family,
    )
# The paper's first case (9), and others with it: position and velocity from the navigator.
for _id in ("sta", "pd", "pid", "smc"):
    _law = _entries[_id]
    register(
        f"{_id}-navigator",
        partial(_law.factory, navigated=True),
        f"{_id} on the navigator's position and velocity",
        told=NAVIGATED,
        space={name: span for name, span in _law.space.items() if name != "observer_gain"},
        on_request=True,
        family=_law.family,
    )
register(
    "dob",
    DisturbanceObserver,
    "disturbance observer: inverse of the nominal model behind a filter, pole placement",
    told=NAVIGATED,
    family=Family.OBSERVER,
)
register(
    "indi",
    Incremental,
    "incremental nonlinear dynamic inversion: the acceleration's error corrects the force",
    told=NAVIGATED,
    family=Family.OBSERVER,
)
register(
    "lqg",
    LQG,
    "Kalman filter with disturbance, linear-quadratic regulator; joints taken as still",
    told=BODY,
    family=Family.OPTIMAL,
)
register(
    "lqg-joints",
    JointLQG,
    "lqg that foresees what the joint motion will do",
    told=FORESIGHT,
    family=Family.OPTIMAL,
)
register(
    "adaptive",
    AdaptiveLQG,
    "lqg-joints that identifies coefficients, current and thruster gains on the way",
    told=FORESIGHT,
    on_request=True,
    family=Family.ADAPTIVE,
)
register(
    "informed",
    InformedLQG,
    "lqg-joints, told every constant of the episode: all that identification could bring",
    told="all constants of the episode",
    privileged=True,
    family=Family.REFERENCE,
)
register(
    "mpc",
    MPC,
    "model-predictive control that foresees the joint motion",
    told=FORESIGHT,
    family=Family.OPTIMAL,
)
register(
    "mpc-limits",
    LimitedMPC,
    "mpc that also plans with the thrusters' limits",
    told=FORESIGHT,
    on_request=True,
    family=Family.OPTIMAL,
)
register(
    "oracle",
    Oracle,
    "true state, exact plant, the future: the limit",
    told="everything",
    privileged=True,
    family=Family.REFERENCE,
)
register("zero", Zero, "no thrust", family=Family.REFERENCE)
register(
    "heading",
    Heading,
    "the heading controller that all laws share, alone",
    space={},
    on_request=True,
    family=Family.REFERENCE,
)
