"""What an agent does to its base: forces of both beside the force that was needed.

The needed force is that of the oracle in the same episode, which knows the true plant and the
future and holds the robot to some micrometres. What the base commands beyond it is chattering and
error; a residual that takes all of it back is `needed - base`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from usm_baselines.laws.oracle import Oracle

from usm_agents.artifact.folder import make_agent
from usm_agents.learning.plan import TEST_SEED
from usm_agents.residual.task import Memory, ResidualPolicy
from usm_agents.study.plans import AGENTS, Home
from usm_agents.study.results import Dissection, ForceShares
from usm_agents.study.trainings import StudyTraining
from usm_gym.evaluation import rollout
from usm_gym.policy import Policy, is_privileged
from usm_gym.suites import unseen
from usm_gym.task.conditions import IN_SPACE
from usm_gym.task.modes import AnyScenario, of_head
from usm_gym.task.nominal import Nominal, shared_nominal
from usm_gym.world import world_of

Array = NDArray[np.float64]

# Longest shift in time that is tried between two forces, control periods.
LONGEST_SHIFT = 10
# Episodes per agent.
EPISODES = 16
# Samples of a segment of Welch's method: 0.1 Hz apart at 50 Hz.
SEGMENT = 500


class ForceLog:
    """A policy that keeps the forces it commands along the axes of the task, N.

    Attributes:
        total: Commanded forces by step, before saturation, (batch, axes).
        base: The base's part of it, where the policy is a base and an agent that adds to its
            thrust.
    """

    def __init__(self, nominal: Nominal, policy: Policy, limit: float) -> None:
        """Watch a policy; `limit` is that of the thrusters, N."""
        self.nominal, self._limit = nominal, limit
        self.privileged = is_privileged(policy)
        self.total: list[Array] = []
        self.base: list[Array] = []
        self._policy = policy
        self._world = world_of(nominal.robot)

    def predict(
        self, observation: Any, state: Any, start: Any, deterministic: bool = True, **truth: Any
    ) -> tuple[Any, Any]:
        """Act as the policy does."""
        action, state = self._policy.predict(observation, state, start, deterministic, **truth)
        memory = state[0] if isinstance(state, tuple) else None
        world = self._world
        axes, angles = len(world.axes), len(world.attitude) + len(world.watched)
        allocation = np.empty((len(observation), axes + angles, world.thrusters))
        world.allocate(observation, allocation)
        forces = allocation[:, :axes]
        self.total.append(np.einsum("bwt,bt->bw", forces, action * self._limit))
        if isinstance(memory, Memory) and memory.base_action.size:
            self.base.append(np.einsum("bwt,bt->bw", forces, memory.base_action * self._limit))
        return action, state


def dissect(
    policy: ResidualPolicy, nominal: Nominal, scenarios: Sequence[AnyScenario]
) -> Dissection:
    """Forces of base, residual and both, beside the needed one.

    Args:
        policy: A base with an agent that adds to its thrust.
        nominal: What both were made from.
        scenarios: Episodes of one length and one thruster limit.

    Returns:
        Standard deviations and spectra of the forces, and how the residual is made up of what the
        base commands in excess and of the needed force, by least squares.
    """
    limit = scenarios[0].conditions.thruster_limit
    settled = round(scenarios[0].settle_time / nominal.control_period)
    watched = []
    for actor in (policy, policy.base, Oracle(nominal)):
        log = ForceLog(nominal, actor, limit)
        rollout(log, scenarios)
        watched.append(log)
    total, alone, needed = (np.stack(log.total)[settled:] for log in watched)
    base = np.stack(watched[0].base)[settled:]
    forces = {
        "needed": needed,
        "base alone": alone,
        "base": base,
        "residual": total - base,
        "both": total,
    }
    frequency = welch(needed, nominal.control_period)[0]
    return Dissection(
        frequency=tuple(frequency.tolist()),
        axes={
            axis: shares_of({name: force[..., k] for name, force in forces.items()}, nominal)
            for k, axis in enumerate(world_of(scenarios[0].body).axes)
        },
    )


def shares_of(forces: dict[str, Array], nominal: Nominal) -> ForceShares:
    """What an agent does to its base in one axis; forces as (steps, episodes)."""
    needed, residual = forces["needed"], forces["residual"]
    excess = forces["base"] - needed
    parts = np.stack([-excess.ravel(), needed.ravel()], axis=1)
    shares, *_ = np.linalg.lstsq(parts, residual.ravel(), rcond=None)
    left = residual.ravel() - parts @ shares
    spectra = {name: welch(force, nominal.control_period)[1] for name, force in forces.items()}
    return ForceShares(
        deviation={name: float(force.std()) for name, force in forces.items()},
        excess_taken_back=float(shares[0]),
        needed_added=float(shares[1]),
        explained=1.0 - float(left.var() / residual.var()),
        lateness=lateness(forces["both"], needed) * nominal.control_period,
        spectrum={name: tuple(density.mean(axis=1).tolist()) for name, density in spectra.items()},
    )


def lateness(force: Array, needed: Array) -> int:
    """By how many steps a force has to be moved back to match the needed one best."""
    span = range(-LONGEST_SHIFT, LONGEST_SHIFT + 1)
    inner = needed[LONGEST_SHIFT:-LONGEST_SHIFT]
    length = len(inner)
    return max(
        span,
        key=lambda shift: float(
            np.corrcoef(force[LONGEST_SHIFT + shift :][:length].ravel(), inner.ravel())[0, 1]
        ),
    )


def welch(force: Array, period: float) -> tuple[Array, Array]:
    """Welch's power spectral density over the first axis."""
    from scipy import signal

    frequency, density = signal.welch(force, 1.0 / period, nperseg=SEGMENT, axis=0)
    return frequency, density


def dissected(home: Home, chosen: Sequence[StudyTraining]) -> dict[str, Dissection]:
    """What the agents that add to the thrust in `field` do to it, as their seed 0; see `dissect`.

    In the other tiers the oracle, behind lag, dead-bands and gains, does not tell what was needed;
    and nothing can be taken from a base that asks for no force. Agents of the head add to no force.
    """
    made: dict[str, Dissection] = {}
    if home.tier.removesuffix(IN_SPACE) != "field" or of_head(home.mode):
        return made
    for training in chosen:
        plan = training.plan
        adds = plan.action != "estimates" and plan.base != "heading"
        if training.name in AGENTS and plan.seed == 0 and adds:
            episodes = unseen(home.mode, home.conditions, TEST_SEED, EPISODES)
            nominal = shared_nominal(episodes)
            policy = make_agent(nominal, str(training.folder))
            made[training.name] = dissect(policy, nominal, episodes)
    return made
