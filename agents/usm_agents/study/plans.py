"""Who is trained under how many seeds, beside whom, and where all are scored."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from usm_agents.learning.plan import Plan
from usm_gym.support.validation import require
from usm_gym.task.conditions import (
    FIELD,
    IN_SPACE,
    PRESETS,
    SPATIAL_PRESETS,
    Conditions,
    preset_of,
)
from usm_gym.task.modes import AnyMode, of_head, presets_of

FORESEEN = ("foreseen_error_2", "foreseen_error_5", "foreseen_error_10", "foreseen_rate")
# What an agent cannot tell from what is measured now.
HISTORY = (
    "base_rate",
    "base_disturbance",
    "base_integral",
    "base_alpha",
    "estimated_error",
    "estimated_rate",
    "estimated_disturbance",
    "estimated_thrust",
    *FORESEEN,
)
JOINT_REFERENCES = (
    "reference_deflection",
    "reference_deflection_rate",
    "reference_deflection_acceleration",
    "bending_joints",
)
BASIN, SEA, SPACE = PRESETS["basin"], PRESETS["sea"], SPATIAL_PRESETS["field"]
_RESIDUAL = Plan()
# A round of its learner takes 256 000 steps in `field`, and 384 000 in a tier of scans.
_ESTIMATOR = Plan(algorithm="estimator", action="estimates", steps=4_600_000, interval=380_000)

# The largest residual is as large as the limit of a thruster.
_RESIDUAL_IN_SPACE = replace(
    _RESIDUAL,
    algorithm="smooth-ppo",
    env="usm_agents:USM-Operation3DResidual-v0",
    residual_scale=40.0,
    conditions=SPACE,
    steps=2_000_000,
    interval=200_000,
)
_ESTIMATOR_IN_SPACE = replace(
    _ESTIMATOR,
    env=_RESIDUAL_IN_SPACE.env,
    base="lqg-joints-eely",
    conditions=SPACE,
    steps=3_000_000,
    interval=250_000,
)
_TORPEDO_IN_SPACE = "usm_agents:USM-Torpedo3DResidual-v0"
_HEAD = Plan(
    env="usm_agents:USM-HeadResidual-v0",
    base="rates-lqg-joints-tuned",
    action="head",
    steps=500_000,
)
_HEAD_IN_SPACE = replace(
    _HEAD, env="usm_agents:USM-Head3DResidual-v0", base="whole-lqg-joints-eely", conditions=SPACE
)

# The agents that are shipped, each as its seed 0. One whose base is another agent comes after it.
AGENTS: dict[str, Plan] = {
    "residual-ppo": _RESIDUAL,
    "residual-torpedo": replace(_RESIDUAL, env="usm_agents:USM-TorpedoResidual-v0"),
    "rl-only": replace(_RESIDUAL, base="heading"),
    "estimator-lqg-joints": replace(
        _ESTIMATOR, base="lqg-joints", steps=3_000_000, interval=250_000
    ),
    "estimator-lqg-joints-basin": replace(_ESTIMATOR, base="lqg-joints-basin", conditions=BASIN),
    "estimator-lqg-joints-sea": replace(_ESTIMATOR, base="lqg-joints-sea", conditions=SEA),
    "estimator-sta-navigator-basin": replace(
        _ESTIMATOR, base="sta-navigator-basin", conditions=BASIN
    ),
    "estimator-sta-navigator-sea": replace(_ESTIMATOR, base="sta-navigator-sea", conditions=SEA),
    "residual-sta-navigator-basin": replace(
        _RESIDUAL, base="estimator-sta-navigator-basin", conditions=BASIN
    ),
    "residual-eely": _RESIDUAL_IN_SPACE,
    "residual-torpedo-eely": replace(_RESIDUAL_IN_SPACE, env=_TORPEDO_IN_SPACE),
    "estimator-lqg-joints-eely": _ESTIMATOR_IN_SPACE,
    "estimator-torpedo-eely": replace(_ESTIMATOR_IN_SPACE, env=_TORPEDO_IN_SPACE),
    "residual-head": _HEAD,
    "residual-head-sta": replace(_HEAD, base="rates-sta-tuned"),
    "rl-joints": replace(_HEAD, action="joints", steps=2_000_000, interval=200_000),
    "residual-head-eely": _HEAD_IN_SPACE,
}


def exact(conditions: Conditions) -> Conditions:
    """The same where the nominal model is right: coefficients and gains of 1, still water."""
    return replace(
        conditions,
        coefficient_range=(1.0, 1.0),
        coefficient_spread=0.0,
        thruster_gain_range=(1.0, 1.0),
        current_limit=0.0,
        current_variation=0.0,
        wave_limit=0.0,
    )


# The agent that ablations are made of: each is trained as it is, but for one thing.
ABLATED = "residual-ppo"
_EXACT = replace(exact(FIELD), deflection_range=(1.2, 1.2), filter_range=(9.0, 9.0))
_CHANGES: dict[str, dict[str, Any]] = {
    "no-foresight": {"omit": FORESEEN},
    "no-history": {"omit": HISTORY},
    "no-joint-references": {"omit": JOINT_REFERENCES},
    "no-randomisation": {"conditions": _EXACT},
    "wrench": {"action": "wrench"},
    "scale-6": {"residual_scale": 6.0},
    # To be held against scale-6.
    "thrusters": {"action": "thrusters", "residual_scale": 6.0},
    "scale-40": {"residual_scale": 40.0},
}
ABLATIONS = {name: replace(AGENTS[ABLATED], **changes) for name, changes in _CHANGES.items()}
PLANS = AGENTS | ABLATIONS
# Trained with ten seeds, because headlines rest on them. All others have five, or `FEWER`.
HEADLINES = (
    "residual-ppo",
    "estimator-lqg-joints",
    "estimator-lqg-joints-basin",
    "residual-sta-navigator-basin",
    "residual-eely",
    "residual-head",
)
FEWER = {
    "estimator-lqg-joints-sea": 3,
    # They show that an estimator serves another law, too, and carry a residual agent.
    "estimator-sta-navigator-basin": 1,
    "estimator-sta-navigator-sea": 1,
    # No headline rests on these.
    "residual-torpedo-eely": 3,
    "estimator-torpedo-eely": 3,
    # It shows how far learning comes without a law for the head.
    "rl-joints": 1,
}
SEEDS = dict.fromkeys(PLANS, 5) | dict.fromkeys(HEADLINES, 10) | FEWER

# Policies beside which the agents of a tier stand, as `--policies` takes them, and those of a home
# that has others; besides them, the agents' bases.
_HEAD_LAWS = (
    *("rates-sta", "rates-pd", "rates-lqg-joints"),
    *("priority-lqg-joints", "whole-lqg-joints"),
)
RIVALS: dict[str, tuple[str, ...]] = {
    "field": (
        "sta",
        "sta-tuned",
        "pd-tuned",
        "lqg-joints",
        "lqg-joints-tuned",
        "mpc",
        "adaptive",
        "informed",
    ),
    "basin": (
        "sta-navigator-basin",
        "indi-basin",
        "lqg-joints-basin",
        "adaptive-basin",
        "informed-basin",
    ),
    "sea": ("sta-navigator-sea", "indi-sea", "lqg-joints-sea", "adaptive-sea", "informed-sea"),
    "field3d": (
        "sta",
        "sta-eely",
        "pd-eely",
        "lqg-joints-eely",
        "mpc-eely",
        "adaptive-eely",
        "informed-eely",
    ),
    "head-field": (*(f"{law}-tuned" for law in _HEAD_LAWS), "rates-oracle"),
    "head3d-field": (*(f"{law}-eely" for law in _HEAD_LAWS), "rates-oracle"),
}


# Where those of a tier are taken that they have not been made for.
ELSEWHERE: dict[str, dict[str, Conditions]] = {
    "field": {
        "ideal": PRESETS["ideal"],
        "still": replace(FIELD, motion=False),
        "exact": exact(FIELD),
        "coefficients": replace(FIELD, coefficient_range=(0.6, 1.4)),
        "delay": replace(FIELD, position_delay=1),
        "noise": replace(FIELD, position_noise=1e-3),
        "lag": replace(FIELD, thruster_time_constant=0.1),
    },
    "basin": {"sea": SEA, "exact": exact(BASIN)},
    "sea": {"basin": BASIN},
    "field3d": {
        "ideal": SPATIAL_PRESETS["ideal"],
        "exact": exact(SPACE),
        "delay": replace(SPACE, position_delay=1),
        "noise": replace(SPACE, position_noise=1e-3),
    },
}


@dataclass(frozen=True)
class Home:
    """Where an agent was trained, and is scored beside its rivals.

    Attributes:
        tier: Name of the preset of conditions.
        mode: The mode.
    """

    tier: str
    mode: AnyMode

    @property
    def name(self) -> str:
        """How it is called: the tier, and the mode if it is not that of a main suite."""
        main = self.mode in ("operation", "operation3d")
        return self.tier if main else f"{self.mode}-{self.tier.removesuffix(IN_SPACE)}"

    @property
    def sets(self) -> dict[str, Conditions]:
        """The conditions of all sets of scenarios there, by name; those of the tier first."""
        others = ELSEWHERE[self.tier]
        if of_head(self.mode):  # whose joints are never still
            others = {name: others[name] for name in others if name != "still"}
        return {self.tier: self.conditions, **others}

    @property
    def conditions(self) -> Conditions:
        """The conditions of the tier."""
        return presets_of(self.mode)[self.tier.removesuffix(IN_SPACE)]


def home_of(name: str) -> Home:
    """The home of an agent; ablations are at home where the ablated agent is.

    Raises:
        ValueError: If it was trained under conditions of no tier.
    """
    plan = AGENTS[ABLATED if name in ABLATIONS else name]
    tier = preset_of(plan.conditions)
    require(tier in RIVALS, f"conditions of {name}", plan.conditions, ", ".join(RIVALS))
    return Home(tier, plan.mode)


def rivals_of(home: Home, names: Iterable[str]) -> dict[str, str]:
    """The rivals of agents at a home: as `--policies` takes them, by the name that tables show."""
    bases = [PLANS[name].base for name in names if home_of(name) == home]
    rivals = RIVALS.get(home.name, RIVALS[home.tier])
    return {rival_name(rival): rival for rival in dict.fromkeys([*rivals, *bases])}


def rival_name(rival: str) -> str:
    """The name of a rival: without the folder of its gains; that of an agent says it is shipped."""
    id, at, path = rival.partition("@")
    return f"{rival}, shipped" if rival in AGENTS else f"{id}{at}{Path(path).name}"
