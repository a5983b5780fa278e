"""What an agent's action is, and which bases it fits."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Literal, get_args

from pydantic import Field
from usm_baselines.estimation.foresight import NAMES
from usm_baselines.head import HeadLaw
from usm_baselines.policy import ScriptedPolicy

from usm_gym.manipulator import Manipulator, bare
from usm_gym.policy import Policy
from usm_gym.support.validation import Count, Number, is_whole, require
from usm_gym.task.nominal import Nominal
from usm_gym.world import world_of

ActionKind = Literal["force", "wrench", "thrusters", "estimates", "head", "joints"]
# With these the base acts after the agent.
BEFORE_BASE = ("estimates", "head", "joints")
# The limit of a thruster: less slows learning down, more buys error with chattering.
RESIDUAL_SCALE = 20.0
# The largest corrections of error, rate and disturbance over the standard deviation of a measured
# position (1, 1/s, 1/s^2), which is taken to be no less than so many metres.
LARGEST_CORRECTION, LEAST_DEVIATION = (10.0, 80.0, 400.0), 5e-5
# The largest corrections of the velocities wanted of the head, m/s, and of its direction, rad/s.
LARGEST_VELOCITY, LARGEST_TURN = 0.03, 0.1
# The largest rate of a joint that an agent moves alone, over its limit: many joints share a motion.
LARGEST_RATE = 0.2
# N and N m: the limit of the strongest thruster that conditions allow.
LEAST_RESIDUAL, LARGEST_RESIDUAL = 1e-6, 1000.0
MOST_FRAMES = 100

ResidualScale = Annotated[Number, Field(ge=LEAST_RESIDUAL, le=LARGEST_RESIDUAL)]
Frames = Annotated[Count, Field(le=MOST_FRAMES)]


def usual_base(nominal: Nominal) -> str:
    """The base of an agent that does not say on which it stands."""
    return "rates-sta" if isinstance(nominal.robot, Manipulator) else "sta"


def usual_action(nominal: Nominal) -> ActionKind:
    """What an action is where nothing is said."""
    return "head" if isinstance(nominal.robot, Manipulator) else "force"


def body_of(nominal: Nominal) -> Nominal:
    """What is known of the robot as one that holds its station, whoever moves the joints."""
    return replace(nominal, robot=bare(nominal.robot))


def numbers_of(nominal: Nominal, action: ActionKind) -> int:
    """How many numbers an action has."""
    world, held = world_of(nominal.robot), world_of(body_of(nominal).robot)
    axes = len(world.axes)
    return {
        "force": axes,
        "wrench": axes + len(held.attitude),
        "thrusters": world.thrusters,
        "estimates": len(NAMES) * axes,
        "head": axes + len(world.attitude),
        "joints": world.actions - world.thrusters,
    }[action]


def check_arguments(residual_scale: float, action: str, frames: int) -> None:
    """Refuse arguments of a residual task that are not allowed."""
    kinds = get_args(ActionKind)
    require(action in kinds, "action", action, " or ".join(kinds))
    require(
        isinstance(residual_scale, (int, float))
        and LEAST_RESIDUAL <= residual_scale <= LARGEST_RESIDUAL,
        "residual_scale",
        residual_scale,
        f"{LEAST_RESIDUAL:g} to {LARGEST_RESIDUAL:g} N",
    )
    require(is_whole(frames, 1, MOST_FRAMES), "frames", frames, f"1 to {MOST_FRAMES}")


def deciding_of(base: Policy, action: str) -> ScriptedPolicy | HeadLaw | None:
    """The base, if it acts after the agent."""
    if action not in BEFORE_BASE:
        return None
    if action == "estimates":
        estimating = isinstance(base, ScriptedPolicy) and base.predictor is not None
        require(estimating, "base", base, "a law that estimates by the plant, to be corrected")
        assert isinstance(base, ScriptedPolicy)
        return base
    require(isinstance(base, HeadLaw), "base", base, "a law for the head, which moves the joints")
    assert isinstance(base, HeadLaw)
    return base
