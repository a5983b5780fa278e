"""The control laws in plain Python, one robot at a time: what the compiled ones are held to."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from support import oracle

from usm_gym import Robot
from usm_gym.task.observation import ObservationLayout

Array = NDArray[np.float64]


class Gains(NamedTuple):
    """(k1, k2, k3) of the observer (15)-(16)."""

    k1: float
    k2: float
    k3: float


def observer_gains(L: float, exponent: float) -> Gains:
    return Gains(6.0 * L ** (1 / 3), 11.0 * L**exponent, 6.0 * L)


def implicit_root(b: float, terms: Iterable[tuple[float, float]], floor: float) -> float:
    """Solve s + sum of a |s|^power sgn(s) + floor sgn(s) = b for s, sgn(0) being all of [-1, 1]."""
    if abs(b) <= floor:
        return 0.0
    terms = list(terms)

    def excess(size: float) -> float:
        return size + sum(a * size**power for a, power in terms) + floor - abs(b)

    return float(np.sign(b) * brentq(excess, 0.0, abs(b), xtol=1e-300, rtol=1e-15, maxiter=500))


@dataclass
class Observer:
    """The third-order observer by an implicit step, for the tracking error of one axis."""

    gains: Gains
    h: float
    p: Array = field(default_factory=lambda: np.zeros(3))

    def step(self, y: float, u: float) -> tuple[float, float]:
        """Take in a measurement and return the corrections (z1, z2)."""
        k1, k2, k3 = self.gains
        h = self.h
        p1, p2, p3 = self.p
        b = y - p1 - h * p2 - h * h * (p3 + u)
        e = implicit_root(b, [(h * k1, 2 / 3), (h * h * k2, 1 / 3)], h**3 * k3)
        xi = np.sign(e) if e else b / (h**3 * k3)
        z1, z2 = k1 * abs(e) ** (2 / 3) * xi, k2 * abs(e) ** (1 / 3) * xi
        p3 = p3 + h * k3 * xi
        p2 = p2 + h * (p3 + z2 + u)
        self.p = np.array([y - e, p2, p3])
        return z1, z2


@dataclass
class Twisting:
    """The adaptive super-twisting controller (11)-(14) by an implicit step."""

    h: float
    epsilon: float = 1.0
    offset: float = 1.0
    gamma: float = 1.0
    omega: float = 8.0
    dead_zone: float = 0.05
    alpha: float = 0.0
    v: float = 0.0

    def step(self, sigma: float) -> float:
        """Return u_STA."""
        h, alpha = self.h, self.alpha
        beta = 2.0 * self.epsilon * alpha + self.offset + 4.0 * self.epsilon**2
        b = sigma + h * self.v
        s = implicit_root(b, [(h * alpha, 0.5)], h * h * beta)
        xi = np.sign(s) if s else b / (h * h * beta)
        self.v -= h * beta * xi
        if abs(sigma) > self.dead_zone:
            self.alpha += h * self.omega * np.sqrt(self.gamma / 2.0)
        return float(-alpha * np.sqrt(abs(s)) * xi + self.v)


class Seen(NamedTuple):
    """An observation in SI units, as far as policies look at it."""

    y: Array  # (2,) m
    velocity: Array  # (2,) m/s
    acceleration: Array  # (2,) m/s^2
    T: Array  # (3, thrusters) allocation matrix now
    command: Array  # (thrusters,) N
    limit: float  # N
    heading_error: float  # rad


def look(robot: Robot, observation: NDArray[np.float32]) -> Seen:
    layout = ObservationLayout(robot.links, len(robot.thrusters))
    values = observation.astype(np.float64) * layout.scale
    part = {name: values[place] for name, place in layout.slices.items()}
    theta = part["tail_angle"][0] - np.concatenate([[0.0], np.cumsum(part["joint_angles"])])
    G = oracle.input_matrix(robot, theta)[:, robot.links - 1 :]
    limit = float(part["thruster_limit"][0])
    return Seen(
        y=part["position_error"],
        velocity=part["reference_velocity"],
        acceleration=part["reference_acceleration"],
        T=np.vstack([G[robot.links :], G[: robot.links].sum(axis=0)]),
        command=part["thruster_command"] * limit,
        limit=limit,
        heading_error=float(part["heading_error"][0]),
    )


def share_out(seen: Seen, force: Array, heading_gain: float) -> Array:
    """Return the action that makes a force (N) and the moment of the heading controller."""
    wrench = np.append(force, -heading_gain * seen.heading_error)
    return np.asarray(np.linalg.pinv(seen.T) @ wrench / seen.limit)
