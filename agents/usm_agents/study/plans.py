"""Who is trained under how many seeds, beside whom, and where all are scored."""

from __future__ import annotations

from dataclasses import replace

from usm_agents.learning.plan import Plan
from usm_gym.task.conditions import FIELD, PRESETS, Conditions

OBSERVER_STATES = ("base_rate", "base_disturbance", "base_integral", "base_alpha")
KALMAN_STATES = (
    "estimated_error",
    "estimated_rate",
    "estimated_disturbance",
    "estimated_thrust",
    "innovation",
)
JOINT_REFERENCES = (
    "reference_deflection",
    "reference_deflection_rate",
    "reference_deflection_acceleration",
    "bending_joints",
)

# The agents that are shipped, each as its seed 0.
AGENTS: dict[str, Plan] = {
    "residual-ppo": Plan(steps=2_000_000),
    "residual-sta-tuned": Plan(base="sta-tuned", steps=1_000_000),
    "residual-pd": Plan(base="pd", steps=1_500_000),
    "residual-lqg": Plan(base="lqg-tuned", steps=1_500_000),
    "residual-lqg-joints": Plan(base="lqg-joints-tuned", steps=1_500_000),
    "residual-torpedo": Plan(env="usm_agents:USM-TorpedoResidual-v0", steps=1_000_000),
    "rl-only": Plan(base="zero", steps=2_000_000),
    "residual-sac": Plan(algorithm="sac", steps=400_000),
}

_SHORT = Plan(steps=1_000_000)
_EXACT = replace(
    FIELD,
    coefficient_range=(1.0, 1.0),
    current_limit=0.0,
    deflection_range=(1.2, 1.2),
    filter_range=(9.0, 9.0),
)
# What an agent owes to one decision or another: `residual-ppo` with a shorter training, less one.
ABLATIONS: dict[str, Plan] = {
    "reference": _SHORT,
    "scale-3": replace(_SHORT, residual_scale=3.0),
    "scale-6": replace(_SHORT, residual_scale=6.0),
    # To be held against scale-6.
    "thrusters": replace(_SHORT, action="thrusters", residual_scale=6.0),
    "scale-12": replace(_SHORT, residual_scale=12.0),
    "scale-40": replace(_SHORT, residual_scale=40.0),
    "no-observer-states": replace(_SHORT, omit=OBSERVER_STATES),
    "no-kalman-states": replace(_SHORT, omit=KALMAN_STATES),
    "frames-not-kalman": replace(_SHORT, omit=KALMAN_STATES, frames=4),
    "recurrent": replace(_SHORT, algorithm="recurrent-ppo"),
    "recurrent-not-kalman": replace(_SHORT, algorithm="recurrent-ppo", omit=KALMAN_STATES),
    "no-joint-references": replace(_SHORT, omit=JOINT_REFERENCES),
    "no-randomisation": replace(_SHORT, conditions=_EXACT),
    # To compare with residual-sac.
    "td3": Plan(algorithm="td3", steps=400_000),
    "tqc": Plan(algorithm="tqc", steps=400_000),
}
PLANS = AGENTS | ABLATIONS
# Most seeds per training: more where a small difference has to be told from chance.
SEEDS = dict.fromkeys(AGENTS, 5) | dict.fromkeys(ABLATIONS, 1)
SEEDS |= dict.fromkeys(("reference", "no-joint-references"), 3)

# Classical policies beside which the agents stand.
RIVALS = ("sta", "sta-tuned", "pd", "pd-tuned", "lqg", "lqg-tuned", "lqg-joints-tuned", "mpc-tuned")
# Where agents are taken that they have not been trained for.
TRANSFER: dict[str, Conditions] = {
    "ideal": PRESETS["ideal"],
    # The preset of this name in 0.1.0.
    "rough": Conditions(
        thruster_time_constant=0.1,
        thruster_limit=15.0,
        position_noise=2e-4,
        current_limit=0.1,
        current_variation=0.05,
        coefficient_range=(0.6, 1.5),
        deflection_range=(0.9, 2.1),
        filter_range=(8.0, 14.0),
    ),
    "still": replace(FIELD, motion=False),
    "coefficients": replace(FIELD, coefficient_range=(0.6, 1.4)),
}
HOME = "field"
