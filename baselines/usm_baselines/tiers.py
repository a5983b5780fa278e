"""Which policies are meant for which conditions."""

from __future__ import annotations

from usm_baselines.registry import Registration, entry, ids
from usm_gym.task.conditions import IN_SPACE, Conditions, preset_of
from usm_gym.task.modes import AnyMode, in_space, of_head

# Presets for which laws are tuned anew. To all other conditions go the policies that are meant for
# `field`, in space those for `field` there.
TIERS = ("basin", "sea", "field3d", "basin3d", "sea3d")
# The policies with the paper's gains, which meet all conditions.
PAPER = ("sta", "pd")
# Of the policies that are meant for `field`, one for every answer to the question which controller
# to take: learned (what the law believes, and what is added to a law), foreseeing the joints, not
# foreseeing them, the paper's law with tuned gains, the textbook's, the calmest, and the paper's.
# The first takes longest to compile.
SHORT_LIST = (
    "estimator-lqg-joints",
    "residual-ppo",
    "lqg-joints",
    "mpc",
    "lqg",
    "ladrc-lag-tuned",
    "sta-lag-tuned",
    "pid",
    "smc-navigator",
    *PAPER,
)


def tier_of(conditions: Conditions, mode: AnyMode = "operation") -> str:
    """The preset whose policies meet some conditions in a mode: one of `TIERS`, or "field"."""
    preset = preset_of(conditions)
    usual = "field" + IN_SPACE if in_space(mode) else "field"
    return preset if preset in TIERS else usual


def meant_for(conditions: Conditions, mode: AnyMode = "operation") -> list[str]:
    """Names of the policies that are meant for some conditions in a mode.

    For a tier they are those that are tuned or trained for it, the paper's two, and those that are
    given true state and have no gains to tune; for all other conditions all but those that are
    tuned for a tier. Laws for the head are meant for all: their laws for the body have the gains
    that fit.
    """
    tier = tier_of(conditions, mode)

    def meant(id: str, policy: Registration) -> bool:
        if policy.moves_joints or of_head(mode):
            return policy.moves_joints and of_head(mode) and policy.tuned_for in ("", tier)
        if tier not in TIERS:
            return policy.tuned_for not in TIERS
        limit = policy.privileged and not policy.space and not policy.tuned_for
        return policy.tuned_for == tier or id in PAPER or limit

    return [id for id in ids() if meant(id, entry(id))]


def short_list(conditions: Conditions, mode: AnyMode = "operation") -> list[str]:
    """Names of the competitors that answer which controller to take under some conditions.

    For a tier they are all that are meant for it, as every law has only one set of gains there.
    """
    if tier_of(conditions, mode) not in TIERS and not of_head(mode):
        return list(SHORT_LIST)
    return competitors(conditions, mode)


def competitors(conditions: Conditions, mode: AnyMode = "operation") -> list[str]:
    """Names of the competitors that are meant for some conditions.

    Those on request are left out, unless the short list has them.
    """
    policies = {id: entry(id) for id in meant_for(conditions, mode) if not entry(id).privileged}
    return [id for id, each in policies.items() if id in SHORT_LIST or not each.on_request]
