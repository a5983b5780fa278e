"""The robot: a chain of equal links with thrusters, and the coefficients that follow from it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, Strict, TypeAdapter

from usm_gym.support.validation import Count, Number, build, require, validated

Direction = Literal["axial", "normal"]
# Of the joint controllers; a scenario may bring its own.
Stiffness = Annotated[Number, Field(ge=0, le=1e6)]
Damping = Annotated[Number, Field(ge=0, le=1e6)]
# Forms of the added mass, docs/model.md section 3.
Hydrodynamics = Literal["consistent", "kelasidi2014"]
# Which terms the drag has, ibidem.
Drag = Literal["linear and quadratic", "quadratic"]


@validated
class Thruster:
    """A thruster at the centre of a link, pushing along the link or across it.

    Attributes:
        link: Number of the link that carries it, 1 = tail, up to 256.
        direction: "axial" pushes along the link's tangent (towards the head for a positive
            force), "normal" along its normal, a quarter turn anticlockwise from the tangent.
    """

    link: Annotated[Count, Field(le=256)]
    direction: Direction


PAPER_THRUSTERS = (
    Thruster(1, "axial"),
    Thruster(3, "normal"),
    Thruster(6, "normal"),
    Thruster(11, "normal"),
    Thruster(14, "normal"),
)


@validated
class Robot:
    """An underwater swimming manipulator: `links` equal links, joined end to end in a plane.

    The defaults are the paper's robot (section 5.1). The hydrodynamic coefficients are
    properties, computed here and nowhere else with the formulas of Kelasidi et al. (ICRA 2014).
    That source uses `tangential_drag` and `normal_drag` for the linear and for the quadratic
    term alike, which implies a reference speed of 1 m/s, and prints units for `added_inertia`
    and `linear_yaw_drag` that do not match their formulas; the published values are kept.

    Attributes:
        links: Number of links, 2 to 256.
        link_length: Length of one link, 2l, 0.01 to 10 m.
        link_mass: Mass of one link, 0.001 to 10000 kg; the default makes it neutrally buoyant.
        half_height: Semi-axis a of the elliptic section, 0.001 to 10 m.
        half_width: Semi-axis b of the elliptic section, 0.001 to 10 m.
        water_density: Density of the water, 0.001 to 10000 kg/m^3.
        friction_coefficient: C_f, skin friction, dimensionless, 0 to 100.
        drag_coefficient: C_D, cross-flow drag, dimensionless, 0 to 100.
        added_mass_coefficient: C_A, dimensionless, 0 to 100.
        added_inertia_coefficient: C_M, dimensionless, 0 to 100.
        joint_stiffness: Proportional gain of the joint controllers, 0 to 1e6 N m/rad.
        joint_damping: Derivative gain of the joint controllers, 0 to 1e6 N m s/rad.
        thrusters: The 3 to 64 thrusters in the order of every thruster vector.
    """

    links: Annotated[int, Strict(), Field(ge=2, le=256)] = 16
    link_length: Annotated[Number, Field(ge=0.01, le=10)] = 0.14
    link_mass: Annotated[Number, Field(ge=1e-3, le=1e4)] = 0.6597
    half_height: Annotated[Number, Field(ge=1e-3, le=10)] = 0.03
    half_width: Annotated[Number, Field(ge=1e-3, le=10)] = 0.05
    water_density: Annotated[Number, Field(ge=1e-3, le=1e4)] = 1000.0
    friction_coefficient: Annotated[Number, Field(ge=0, le=100)] = 0.03
    drag_coefficient: Annotated[Number, Field(ge=0, le=100)] = 2.0
    added_mass_coefficient: Annotated[Number, Field(ge=0, le=100)] = 1.0
    added_inertia_coefficient: Annotated[Number, Field(ge=0, le=100)] = 1.0
    joint_stiffness: Stiffness = 20.0
    joint_damping: Damping = 5.0
    thrusters: Annotated[tuple[Thruster, ...], Field(min_length=3, max_length=64)] = PAPER_THRUSTERS

    def __post_init__(self) -> None:
        """Refuse a layout that leaves a planar wrench out of reach."""
        for thruster in self.thrusters:
            require(thruster.link <= self.links, "thrusters", thruster, f"links 1 to {self.links}")
        require(
            np.linalg.matrix_rank(self._straight_allocation()) == 3,
            "thrusters",
            self.thrusters,
            "a layout whose forces span surge, sway and yaw of the straight body",
        )

    @property
    def half_length(self) -> float:
        """Half the length of a link, l, m."""
        return self.link_length / 2

    @property
    def link_inertia(self) -> float:
        """Moment of inertia of a link about its centre, J = m l^2 / 3, kg m^2."""
        return self.link_mass * self.half_length**2 / 3

    @property
    def total_mass(self) -> float:
        """Mass of the robot, m_t, kg."""
        return self.links * self.link_mass

    @property
    def tangential_drag(self) -> float:
        """c_t, N s/m (linear term) and N s^2/m^2 (quadratic term)."""
        mean_radius = (self.half_height + self.half_width) / 2
        return (
            0.5
            * self.water_density
            * math.pi
            * self.friction_coefficient
            * mean_radius
            * self.link_length
        )

    @property
    def normal_drag(self) -> float:
        """c_n, N s/m (linear term) and N s^2/m^2 (quadratic term)."""
        return (
            0.5
            * self.water_density
            * self.drag_coefficient
            * 2
            * self.half_height
            * self.link_length
        )

    @property
    def added_mass(self) -> float:
        """Added mass of a link across its axis, mu_n, kg; there is none along it."""
        return (
            self.water_density
            * math.pi
            * self.added_mass_coefficient
            * self.half_height**2
            * self.link_length
        )

    @property
    def added_inertia(self) -> float:
        """Added moment of inertia of a link, lambda_1."""
        a, b, l = self.half_height, self.half_width, self.half_length
        return (
            self.water_density
            * math.pi
            * self.added_inertia_coefficient
            * (a**2 - b**2) ** 2
            * l**3
            / 12
        )

    @property
    def linear_yaw_drag(self) -> float:
        """Linear yaw drag of a link, lambda_2."""
        a, b, l = self.half_height, self.half_width, self.half_length
        return self.water_density * math.pi * self.friction_coefficient * (a + b) * l**3 / 6

    @property
    def quadratic_yaw_drag(self) -> float:
        """Quadratic yaw drag of a link, lambda_3."""
        a, b, l = self.half_height, self.half_width, self.half_length
        return self.water_density * math.pi * self.friction_coefficient * (a + b) * l**4 / 8

    @property
    def hydrodynamic_coefficients(self) -> tuple[float, float, float, float, float, float]:
        """(c_t, c_n, mu_n, lambda_1, lambda_2, lambda_3), which are uncertain in practice."""
        return (
            self.tangential_drag,
            self.normal_drag,
            self.added_mass,
            self.added_inertia,
            self.linear_yaw_drag,
            self.quadratic_yaw_drag,
        )

    @property
    def thruster_links(self) -> NDArray[np.int64]:
        """Zero-based link indices of the thrusters, int64, shape (thrusters,)."""
        return np.array([thruster.link - 1 for thruster in self.thrusters], dtype=np.int64)

    @property
    def thruster_is_normal(self) -> NDArray[np.bool_]:
        """Whether each thruster pushes across its link, bool, shape (thrusters,)."""
        return np.array(
            [thruster.direction == "normal" for thruster in self.thrusters], dtype=np.bool_
        )

    def link_centres(
        self, theta: NDArray[np.float64], position: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Centres of the links in the global frame (docs/model.md section 2).

        Args:
            theta: Link angles, rad, shape (links,).
            position: Centre of mass, m, shape (2,).

        Returns:
            Positions, m, shape (links, 2).
        """
        halves = self.half_length * np.stack([np.cos(theta), np.sin(theta)], axis=1)
        from_tail = 2 * np.cumsum(halves, axis=0) - halves
        return np.asarray(from_tail - from_tail.mean(axis=0) + position)

    def _straight_allocation(self) -> NDArray[np.float64]:
        normal = self.thruster_is_normal
        position = 2 * self.thruster_links - (self.links - 1)
        return np.stack([~normal, normal, normal * position]).astype(np.float64)


def read_robot(fields: Mapping[str, Any]) -> Robot:
    """Make a robot from the fields that differ from the paper's.

    Raises:
        ValueError: If a field is unknown or its value not allowed.
    """
    return build(_ADAPTER, "robot", fields)


_ADAPTER = TypeAdapter(Robot)
