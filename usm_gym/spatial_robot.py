"""The spatial robot: a chain of cylinders that joints turn about any axis, with thrusters.

Axes are right-handed. Those of a link have x along it, from tail to head, y to the left and z up,
as the global ones have while the robot is straight.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter

from usm_gym.robot import Damping, Stiffness
from usm_gym.support.validation import Count, Number, build, require, validated

Array = NDArray[np.float64]
Vector = tuple[Number, Number, Number]
Component = Annotated[Number, Field(ge=-1, le=1)]
Direction = tuple[Component, Component, Component]
Coordinate = Annotated[Number, Field(ge=-50, le=50)]
Coefficient = Annotated[Number, Field(ge=0, le=100)]

MOST_LINKS = 64
# A unit vector may be this far from length 1.
UNIT_TOLERANCE = 1e-6
# Further than this from its link's axis no thruster sits, radii of the link.
LONGEST_ARM = 5.0
# Linear drag along a link and in roll over that across it (and the radius squared, in roll).
LINEAR_SHARE = 0.1
# A layout whose smallest singular value is below this cannot hold some direction.
SMALLEST_SINGULAR_VALUE = 1e-3


@validated
class Link:
    """A cylinder; its volume is centred in its middle.

    Attributes:
        length: Length, 0.01 to 10 m.
        radius: Radius, 0.001 to 10 m.
        mass: Mass, 0.001 to 100000 kg; None: that of the water it displaces.
        keel: How far its centre of mass lies below its axis, 0 to 10 m, at most its radius.
    """

    length: Annotated[Number, Field(ge=0.01, le=10)]
    radius: Annotated[Number, Field(ge=1e-3, le=10)] = 0.09
    mass: Annotated[Number, Field(ge=1e-3, le=1e5)] | None = None
    keel: Annotated[Number, Field(ge=0, le=10)] = 0.0

    def __post_init__(self) -> None:
        """Refuse a centre of mass outside the link."""
        allowed = f"0 to the radius, {self.radius}"
        require(self.keel <= self.radius, "keel", self.keel, allowed)


@validated
class SpatialThruster:
    """A thruster.

    Attributes:
        link: Number of the link that carries it, 1 (tail) to 64.
        position: Where it pushes, in link axes from the middle of the link's tail end, -50 to 50 m:
            x within the link, y and z up to 5 radii from its axis.
        direction: Where a positive force pushes the link, a unit vector in link axes, whose
            components are -1 to 1.
    """

    link: Annotated[Count, Field(le=MOST_LINKS)]
    position: tuple[Coordinate, Coordinate, Coordinate]
    direction: Direction

    def __post_init__(self) -> None:
        """Refuse a direction that is not a unit vector."""
        require_unit(f"direction of the thruster on link {self.link}", self.direction)


def require_unit(name: str, vector: Vector) -> None:
    """Refuse what is not a unit vector."""
    unit = abs(math.hypot(*vector) - 1.0) <= UNIT_TOLERANCE
    require(unit, name, vector, "a unit vector (x, y, z)")


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
EELY_LENGTHS = (0.62, 0.1, 0.59, 0.1, 0.8, 0.1, 0.59, 0.1, 0.37)
EELY_THRUSTERS = (
    SpatialThruster(3, (0.24, 0.0, 0.0), Z),
    SpatialThruster(3, (0.35, 0.0, 0.0), Y),
    SpatialThruster(5, (0.24, 0.0, 0.0), Z),
    SpatialThruster(5, (0.53, 0.15, 0.0), X),
    SpatialThruster(5, (0.53, -0.15, 0.0), X),
    SpatialThruster(7, (0.24, 0.1, 0.0), Y),
    SpatialThruster(7, (0.35, 0.1, 0.0), Z),
)


@validated
class SpatialRobot:
    """An underwater swimming manipulator whose links are joined end to end in space.

    The defaults are the robot "Eely" as `aiauv_config.yml` of the public simulator
    erlendbasso/aiauv_simulator has it, but for what is marked as assumed. Its file has z down; its
    numbers stand here in axes with z up, which turns the robot by half a turn about its own axis.
    Links 3 and 7 are alike, but the file puts the thrusters of link 3 on the axis and those of link
    7 at y = 0.10 m. Nothing says why. They stay there, and so the straight body can hold its roll,
    if weakly (1 N m takes 30 N); with y = 0 it could not.

    Hydrodynamic coefficients are dimensionless and the same for all links; docs/model_spatial.md
    has the formulas.

    Attributes:
        links: The 2 to 64 links, from the tail; a keel of 3 cm is assumed.
        joint_axes: Axis of joint i, about which link i + 1 turns against link i, right-handed: a
            unit vector in the axes of both, whose components are -1 to 1.
        thrusters: The 5 to 64 thrusters in the order of every thruster vector.
        water_density: Density of the water, 0.001 to 10000 kg/m^3.
        gravity: Acceleration of gravity, 0 to 100 m/s^2.
        added_mass_along: Added mass of a link along its axis over that of the displaced water, 0 to
            100.
        added_mass_across: The same across its axis, 0 to 100.
        linear_drag: Linear drag across a link over density, radius and length, 0 to 100 m/s; along
            it and in roll a tenth of that.
        surge_drag: Quadratic drag along a link, by its section, 0 to 100.
        roll_drag: Quadratic drag against rolling, 0 to 100.
        cross_flow_drag: Quadratic drag across a link, by the area that the flow meets, 0 to 100.
        joint_stiffness: Proportional gain of the joint controllers, 0 to 1e6 N m/rad; assumed.
        joint_damping: Derivative gain of the joint controllers, 0 to 1e6 N m s/rad; assumed.
    """

    links: Annotated[tuple[Link, ...], Field(min_length=2, max_length=MOST_LINKS)] = tuple(
        Link(length, keel=0.03) for length in EELY_LENGTHS
    )
    joint_axes: tuple[Direction, ...] = (Z, Y, Z, Y, Z, Y, Z, Y)
    thrusters: Annotated[tuple[SpatialThruster, ...], Field(min_length=5, max_length=64)] = (
        EELY_THRUSTERS
    )
    water_density: Annotated[Number, Field(ge=1e-3, le=1e4)] = 1000.0
    gravity: Annotated[Number, Field(ge=0, le=100)] = 9.81
    added_mass_along: Coefficient = 0.2
    added_mass_across: Coefficient = 1.0
    linear_drag: Coefficient = 0.1
    surge_drag: Coefficient = 0.2
    roll_drag: Coefficient = 0.1
    cross_flow_drag: Coefficient = 0.5
    joint_stiffness: Stiffness = 1000.0
    joint_damping: Damping = 200.0

    def __post_init__(self) -> None:
        """Refuse axes and thrusters that do not fit, and a layout that cannot hold the robot."""
        joints = len(self.links) - 1
        require(len(self.joint_axes) == joints, "joint_axes", self.joint_axes, f"{joints} axes")
        for number, axis in enumerate(self.joint_axes, 1):
            require_unit(f"joint_axes, joint {number}", axis)
        for number, thruster in enumerate(self.thrusters, 1):
            name, count = f"thrusters, number {number}", len(self.links)
            require(thruster.link <= count, name, thruster.link, f"links 1 to {count}")
            link, (x, y, z) = self.links[thruster.link - 1], thruster.position
            arm = LONGEST_ARM * link.radius
            within = 0.0 <= x <= link.length and math.hypot(y, z) <= arm
            allowed = f"x from 0 to {link.length}, up to {arm:.3g} from the axis: on its link"
            require(within, f"{name}, position", thruster.position, allowed)
        values = np.linalg.svd(self.straight_allocation()[:5], compute_uv=False)
        shown = ", ".join(f"{value:.3g}" for value in values)
        require(
            values[-1] >= SMALLEST_SINGULAR_VALUE,
            "thrusters",
            f"a layout with the singular values {shown}",
            "one that holds position, pitch and yaw of the straight body: "
            f"all singular values {SMALLEST_SINGULAR_VALUE} or more",
        )

    @property
    def lengths(self) -> Array:
        """Lengths of the links, m, (links,)."""
        return np.array([link.length for link in self.links])

    @property
    def radii(self) -> Array:
        """Radii of the links, m, (links,)."""
        return np.array([link.radius for link in self.links])

    @property
    def displaced_masses(self) -> Array:
        """Mass of the water that the links displace, kg, (links,)."""
        return np.asarray(self.water_density * math.pi * self.radii**2 * self.lengths)

    @property
    def masses(self) -> Array:
        """Masses of the links, kg, (links,)."""
        given = np.array([np.nan if link.mass is None else link.mass for link in self.links])
        return np.where(np.isnan(given), self.displaced_masses, given)

    @property
    def keels(self) -> Array:
        """How far the links' centres of mass lie below their axes, m, (links,)."""
        return np.array([link.keel for link in self.links])

    @property
    def total_mass(self) -> float:
        """Mass of the robot, kg."""
        return float(self.masses.sum())

    @property
    def hydrodynamic_coefficients(self) -> tuple[float, float, float, float, float, float]:
        """Coefficients that are uncertain in practice: two of added mass, four of drag.

        They are `added_mass_along`, `added_mass_across`, `linear_drag`, `surge_drag`, `roll_drag`,
        `cross_flow_drag`.
        """
        return (
            self.added_mass_along,
            self.added_mass_across,
            self.linear_drag,
            self.surge_drag,
            self.roll_drag,
            self.cross_flow_drag,
        )

    @property
    def straight_body(self) -> tuple[Array, Array]:
        """Of the straight body inertia with added mass, kg, and linear drag, N s/m, (3,) each.

        The axes are x, along it, y and z.
        """
        along, across = self.added_mass_along, self.added_mass_across
        added = np.array([along, across, across]) * self.displaced_masses.sum()
        strips = self.water_density * float(self.radii @ self.lengths)
        drag = self.linear_drag * strips * np.array([LINEAR_SHARE, 1.0, 1.0])
        return self.total_mass + added, drag

    @property
    def straight_centre(self) -> Array:
        """Centre of mass of the straight body, from the middle of its middle link, m, (3,)."""
        places = np.cumsum(self.lengths) - self.lengths / 2
        along = self.masses @ (places - places[len(self.links) // 2])
        return np.array([along, 0.0, -(self.masses @ self.keels)]) / self.total_mass

    def straight_allocation(self) -> Array:
        """What unit forces of the thrusters make of the straight body.

        Returns:
            The forces along x, y and z, N, and the moments about y, z and x through the centre of
            mass, N m, (6, thrusters).
        """
        root = len(self.links) // 2
        bases = np.cumsum(self.lengths) - self.lengths
        bases -= bases[root] + self.lengths[root] / 2
        centre = self.straight_centre
        columns = []
        for thruster in self.thrusters:
            at = np.array(thruster.position) - centre
            at[0] += bases[thruster.link - 1]
            moment = np.cross(at, thruster.direction)
            columns.append([*thruster.direction, moment[1], moment[2], moment[0]])
        return np.array(columns, np.float64).T


EELY = SpatialRobot()
# Its centres of mass on the axis: nothing but thrust holds its roll.
EELY_NEUTRAL = dataclasses.replace(EELY, links=tuple(Link(length) for length in EELY_LENGTHS))


def read_spatial_robot(fields: Mapping[str, Any]) -> SpatialRobot:
    """Make a robot from the fields that differ from Eely's.

    Raises:
        ValueError: If a field is unknown or its value not allowed.
    """
    return build(_ADAPTER, "robot", fields)


_ADAPTER = TypeAdapter(SpatialRobot)
