"""The policies of this package, each registered under its name."""

from __future__ import annotations

from functools import partial
from typing import Any

from usm_baselines.families import Family
from usm_baselines.head import HEADING_LEAD, HeadLaw, station_of
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
from usm_baselines.laws.resolved_rates import ResolvedRates
from usm_baselines.laws.sliding_mode import SlidingMode
from usm_baselines.laws.super_twisting import SuperTwisting
from usm_baselines.laws.task_priority import TaskPriority
from usm_baselines.laws.whole_body import WholeBody
from usm_baselines.laws.zero import Zero
from usm_baselines.policy import ScriptedPolicy
from usm_baselines.registry import entry, ids, make, register
from usm_baselines.space import OF_BODY, space_of
from usm_gym.spatial_robot import SpatialRobot
from usm_gym.task.conditions import PRESETS, SPATIAL_PRESETS
from usm_gym.task.nominal import Nominal, nominal_under

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
    _law = entry(_id)
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
    _law = entry(_id)
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

# Laws for the head, by what stands before the law for the body in the names of policies, and the
# laws for the body that are combined with each.
HEAD_LAWS: dict[str, tuple[type[HeadLaw], str, tuple[str, ...]]] = {
    "rates": (
        ResolvedRates,
        "resolved rates for the head",
        ("sta", "pd", "lqg-joints", "adaptive", "informed", "oracle"),
    ),
    "priority": (TaskPriority, "task priority for the head", ("lqg-joints",)),
    "whole": (
        WholeBody,
        "whole-body control by a quadratic program",
        ("lqg-joints", "adaptive", "informed"),
    ),
}


def steered(law: str, body: str, nominal: Nominal, **gains: Any) -> HeadLaw:
    """A law for the head over one that holds the body, by default with shipped gains.

    Args:
        law: One of `HEAD_LAWS`.
        body: The law for the body: a name without what it says of its gains.
        nominal: Nominal knowledge of a robot whose joints are the policy's.
        gains: Gains of the law for the head, and with `OF_BODY` before their names those of the law
            for the body.
    """
    station = station_of(nominal)
    own = {name: gain for name, gain in gains.items() if not name.startswith(OF_BODY)}
    held = {name.removeprefix(OF_BODY): gains[name] for name in gains if name not in own}
    # The oracle acts on the true heading, not on the one that looks ahead in what is observed.
    ahead = {"heading_lead": float(HEADING_LEAD)} if body == "oracle" else {}
    holding: Any = make(shipped(body, station), station, **{**ahead, **held})
    assert isinstance(holding, ScriptedPolicy)
    return HEAD_LAWS[law][0](nominal, holding, **own)


def shipped(law: str, nominal: Nominal) -> str:
    """The law with the gains that are shipped for what is known of sensors and thrusters.

    It is the one on the navigator where there are no gains for the plain one, the one for "field"
    where nothing is shipped for the conditions, and the law with its own gains where nothing is.
    """
    spatial = isinstance(nominal.robot, SpatialRobot)
    presets, usual = (SPATIAL_PRESETS, "eely") if spatial else (PRESETS, "tuned")
    lag = nominal.joint_time_constant
    fitting = (
        name
        for name, preset in presets.items()
        if nominal_under(nominal.robot, preset, lag) == nominal
    )
    tier = next(fitting, "field")
    own = f"{usual}-{tier}" if spatial else tier
    wanted = [f"{law}-{own}", f"{law}-navigator-{own}", f"{law}-{usual}", law]
    return next(id for id in wanted if id in ids())


for _name, (_kind, _summary, _bodies) in HEAD_LAWS.items():
    for _body in _bodies:
        _law = entry(_body)
        register(
            f"{_name}-{_body}",
            partial(steered, _name, _body),
            f"{_summary}, the body held by {_body}",
            space={
                **space_of(_kind.Gains),
                **{f"{OF_BODY}{name}": span for name, span in _law.space.items()},
            },
            told=_law.told,
            on_request=_law.on_request,
            privileged=_law.privileged,
            moves_joints=True,
            family=Family.HEAD,
        )
