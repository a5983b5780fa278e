"""Where a block of spatial robots keeps its numbers; `plant.layout` has the scheme.

Units are SI. Vectors of the base are in the global frame, those of links in the axes of their link.
A quantity that has several numbers takes as many quantities of the layout as it has numbers.
"""

from __future__ import annotations

from usm_gym.kernels.compile import shared
from usm_gym.kernels.lanes import padded
from usm_gym.plant.references import MAX_SHIFTS, ReferenceRows
from usm_gym.plant.thrusters import ThrusterRows
from usm_gym.plant.water import MAX_SINUSOIDS, WaterRows, sinusoid_rows

AXES = 3
# Physics steps since the start, as a float. The root link: position, velocity and acceleration of
# its middle, attitude (w, x, y, z), angular velocity and acceleration in its own axes.
CLOCK, P, V, A, Q, W, DW = 0, 1, 4, 7, 10, 14, 17
# True hydrodynamic coefficients, as in `SpatialRobot.hydrodynamic_coefficients`.
ADDED_ALONG, ADDED_ACROSS, LINEAR, SURGE, ROLL, CROSS_FLOW = range(20, 26)
# Velocity and acceleration of the water now, and what they are made of.
WATER, WATER_A, MEAN, SINUSOID = 26, 29, 32, 35
WATER_ROWS = WaterRows(AXES, CLOCK, WATER, WATER_A, MEAN, SINUSOID)
# Joint controllers: gains, and the joint-space inertia that their implicit treatment adds.
SINUSOID_ROWS = sinusoid_rows(AXES)
_JOINTS = SINUSOID + MAX_SINUSOIDS * SINUSOID_ROWS
STIFFNESS, DAMPING, JOINT_INERTIA = range(_JOINTS, _JOINTS + 3)
# Joint references: the two deflections that joints have shares of, to the side and up, each with
# its rate and acceleration; the filter of both.
PAN = _JOINTS + 3
TILT = PAN + 3
FILTER = TILT + 3
LAG, MEAN_LAG, LIMIT, DEAD_BAND = range(FILTER + 6, FILTER + 10)
# When the deflections change, and by how much.
SHIFT_STEP = FILTER + 10
PAN_SHIFT = SHIFT_STEP + MAX_SHIFTS
TILT_SHIFT = PAN_SHIFT + MAX_SHIFTS
HEADER = TILT_SHIFT + MAX_SHIFTS
PAN_ROWS = ReferenceRows(CLOCK, STIFFNESS, PAN, FILTER, SHIFT_STEP, PAN_SHIFT)
TILT_ROWS = ReferenceRows(CLOCK, STIFFNESS, TILT, FILTER, SHIFT_STEP, TILT_SHIFT)

# Quantities of the joints, which stand where those of the link before them would. State: angle,
# rate, and the acceleration of the step before. Fixed in an episode: the shares of the deflections.
PHI, PHI_DOT, PHI_DDOT, PAN_SHARE, TILT_SHARE = range(5)
# Where forces are taken: sine and cosine of the outward angle, outward rate, torque.
SIN, COS, RATE, TORQUE = range(5, 9)
# What back substitution needs, see `chain.eliminate`.
SUB = 9
# Quantities of the links. Fixed in an episode: hydrodynamic coefficients over the common ones.
# Thrust, force and moment about the middle.
FACTOR = SUB + 7
PUSH = FACTOR + 1
# Where forces are taken: angular velocity, velocity of the middle relative to the water, effective
# gravity, and the accelerations that go with no acceleration of root and joints.
OMEGA, VELOCITY, GRAVITY, BIAS_ALPHA, BIAS = (PUSH + 6 + 3 * k for k in range(5))
# Angular acceleration and that of the middle relative to the water, by components in link axes;
# those of the step before until `accelerate` has found those of this one.
ALPHA, LINK_A = BIAS + 3, BIAS + 6
# The link's own answer, see `links`.
OWN = LINK_A + 3
QUANTITIES = OWN + 12

# What all robots have in common, by link: half its length; the way along it from its middle to the
# joint towards the root; mass; mass less that of displaced water; mass times height of the centre
# of mass; moments of inertia about the middle; then what coefficients are multiplied with: added
# mass and added moment of inertia, drag across a strip of the link, along it and in roll, and what
# linear drag across it is multiplied with for that along it and in roll; on which side of the root
# the joint is that stands here (1.0 head, -1.0 tail).
HALF, REACH, MASS, EXCESS, FIRST_MOMENT, INERTIA_X, INERTIA_Y, INERTIA_Z = range(8)
ADDED_MASS, ADDED_INERTIA, STRIP, SURGE_AREA, ROLL_VOLUME, LINEAR_X, LINEAR_ROLL = range(8, 15)
SIDE, CONSTANTS = 15, 16
# Which way the axis of a joint points.
ALONG_Z, ALONG_Y, ANYWHERE = range(3)

# Quantities of the thrusters.
COMMAND, FORCE, GAIN, TARGET = range(4)
THRUSTER_QUANTITIES = 4


@shared
def stride_of(links: int) -> int:
    """Rows that each quantity of the links takes: one too many for them to share cache lines."""
    return padded(links) + 1


@shared
def row_of(quantity: int, links: int) -> int:
    """Row of a quantity of the first link, or of the first joint."""
    return HEADER + quantity * stride_of(links)


@shared
def thruster_row(quantity: int, links: int, thrusters: int) -> int:
    """Row of a quantity of the first thruster."""
    return row_of(QUANTITIES, links) + quantity * thrusters


@shared
def thruster_rows(links: int, thrusters: int) -> ThrusterRows:
    """Where a block keeps its thrusters."""
    return ThrusterRows(
        LAG,
        MEAN_LAG,
        LIMIT,
        DEAD_BAND,
        thruster_row(COMMAND, links, thrusters),
        thruster_row(FORCE, links, thrusters),
        thruster_row(GAIN, links, thrusters),
        thruster_row(TARGET, links, thrusters),
    )


@shared
def body_rows(links: int, thrusters: int) -> int:
    """Rows of a robot; a world adds its own."""
    return thruster_row(THRUSTER_QUANTITIES, links, thrusters)
