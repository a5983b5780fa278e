"""Where a block keeps its numbers: one flat array of rows.

A block is one robot, a row being one number, or `lanes.WIDTH` robots side by side, a row being one
number for each. First comes a header of `HEADER` rows, then `padded(links)` rows for each quantity
of the links, tail first, then the thrusters' rows. The rows of a quantity lie together, so that a
block of one robot can be worked on several links at a time; the padding lets the last of them be
read and written whole.

Units are SI throughout; vectors are in the global frame.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.compile import shared
from usm_gym.kernels.lanes import padded
from usm_gym.plant.references import MAX_SHIFTS, ReferenceRows
from usm_gym.plant.thrusters import ThrusterRows
from usm_gym.plant.water import MAX_SINUSOIDS, WaterRows, sinusoid_rows

# Physics steps since the start, as a float. Position, velocity, acceleration of the centre of mass.
CLOCK, P_X, P_Y, V_X, V_Y, A_X, A_Y = range(7)
# True hydrodynamic coefficients common to the links, as in `Robot.hydrodynamic_coefficients`.
C_T, C_N, MU, LAMBDA_1, LAMBDA_2, LAMBDA_3 = range(7, 13)
# Velocity and acceleration of the water now, and what they are made of: in each axis a mean and a
# number of sinusoids, a slow current and then the waves.
WATER_X, WATER_Y, WATER_AX, WATER_AY, MEAN_X, MEAN_Y = range(13, 19)
SINUSOID = 19
SINUSOID_ROWS = sinusoid_rows(2)
WATER_ROWS = WaterRows(2, CLOCK, WATER_X, WATER_AX, MEAN_X, SINUSOID)
# Joint controllers: gains, and the joint-space inertia that their implicit treatment adds.
_JOINTS = SINUSOID + MAX_SINUSOIDS * SINUSOID_ROWS
STIFFNESS, DAMPING, JOINT_INERTIA = range(_JOINTS, _JOINTS + 3)
# Joint references: the deflection that the bending joints share, its rate and acceleration; the
# filter over one physics step (deflection and rate, from either) and what gives the acceleration.
_REFERENCES = _JOINTS + 3
DEFLECTION, DEFLECTION_RATE, DEFLECTION_ACCELERATION = range(_REFERENCES, _REFERENCES + 3)
_FILTER = _REFERENCES + 3
FILTER_DD, FILTER_DR, FILTER_RD, FILTER_RR = range(_FILTER, _FILTER + 4)
FILTER_STIFFNESS, FILTER_DAMPING = range(_FILTER + 4, _FILTER + 6)
# Thrusters: share of the way to its target that a physics step covers by its end and in its mean,
# the limit, and the smallest force that they make.
_THRUSTERS = _FILTER + 6
LAG, MEAN_LAG, LIMIT, DEAD_BAND = range(_THRUSTERS, _THRUSTERS + 4)
# When the deflection changes, and by how much.
SHIFT_STEP = _THRUSTERS + 4
SHIFT_SIZE = SHIFT_STEP + MAX_SHIFTS
HEADER = SHIFT_SIZE + MAX_SHIFTS
REFERENCES = ReferenceRows(CLOCK, STIFFNESS, DEFLECTION, FILTER_DD, SHIFT_STEP, SHIFT_SIZE)

# Quantities of the links. State: angle and rate. Fixed in an episode: the share of the deflection
# that is the reference of the joint to the next link, on which side of the root the link is
# (1.0 tail, 0.0 the root itself, -1.0 head), and its hydrodynamic coefficients over the common
# ones. Thrust along and across.
THETA, OMEGA, SHARE, SIDE, FACTOR, PUSH_T, PUSH_N = range(7)
# Where forces are taken: sine and cosine of the angle, its rate, velocity of the centre, torque of
# the joint to the next link.
SIN, COS, RATE, U_X, U_Y, TORQUE = range(7, 13)
# Angular acceleration, and acceleration of the centre relative to the water; those of the step
# before until `accelerate` has found those of this one.
ALPHA, LINK_AX, LINK_AY = range(13, 16)
# The link's own answer, see `chain`; once it is eliminated, its back substitution.
OWN = 16
SUB_0, SUB_G, SUB_X, SUB_Y = range(OWN, OWN + 4)
QUANTITIES = OWN + 9


@shared
def row_of(quantity: int, links: int) -> int:
    """Row of a quantity of the first link."""
    return HEADER + quantity * padded(links)


# Quantities of the thrusters: command, force, gain, and the force that the command leads to.
COMMAND, FORCE, GAIN, TARGET = range(4)
THRUSTER_QUANTITIES = 4


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


def sides(links: int) -> NDArray[np.float64]:
    """The quantity SIDE of every link, (links,); the root is link `links // 2`, from 0."""
    return np.sign(links // 2 - np.arange(links)).astype(np.float64)


@shared
def body_rows(links: int, thrusters: int) -> int:
    """Rows of a robot of `links` links and `thrusters` thrusters; a world adds its own."""
    return thruster_row(THRUSTER_QUANTITIES, links, thrusters)
