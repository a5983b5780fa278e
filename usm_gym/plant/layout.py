"""Where a block of robots keeps its numbers: one flat array of rows, a row one number per lane.

A block holds `lanes` robots side by side, so that one loop over the lanes of a row is one vector
instruction or a few. First comes a header of `HEADER` rows, then a record of `RECORD` rows for each
link, tail first, then `THRUSTER` rows for each thruster. Everything is in one array because a
compiler that sees two arrays has to fear that they overlap, and gives up vectorising.

Units are SI throughout; vectors are in the global frame.
"""

from __future__ import annotations

# Physics steps since the start, as a float. Position, velocity, acceleration of the centre of mass.
CLOCK, P_X, P_Y, V_X, V_Y, A_X, A_Y = range(7)
# True hydrodynamic coefficients of a link, as in `Robot.hydrodynamic_coefficients`.
C_T, C_N, MU, LAMBDA_1, LAMBDA_2, LAMBDA_3 = range(7, 13)
# Velocity and acceleration of the water now, and what they are made of:
# mean + amplitude * sin(frequency * t + phase) in each axis.
WATER_X, WATER_Y, WATER_AX, WATER_AY = range(13, 17)
MEAN_X, MEAN_Y, AMPLITUDE_X, AMPLITUDE_Y, PHASE_X, PHASE_Y, WATER_FREQUENCY = range(17, 24)
# Joint controller: gains, and the joint-space inertia that its implicit treatment adds.
STIFFNESS, DAMPING, JOINT_INERTIA = range(24, 27)
# Joint references: how many joints bend, the deflection they share, its rate and acceleration; the
# filter over one physics step (deflection and rate, from either) and what gives the acceleration.
BENDING_JOINTS, DEFLECTION, DEFLECTION_RATE, DEFLECTION_ACCELERATION = range(27, 31)
FILTER_DD, FILTER_DR, FILTER_RD, FILTER_RR, FILTER_STIFFNESS, FILTER_DAMPING = range(31, 37)
# Thrusters: share of the way to the command that one physics step covers, and the limit.
LAG, LIMIT = range(37, 39)
# The path, and guidance: what the heading is, what the line of sight aims at.
SPEED, SWAY, FREQUENCY, RAMP, LOOK_AHEAD, CROSS_TRACK, HEAD_HEADING = range(39, 46)
# Times of the changes of the deflection (infinite where there is none), then their sizes.
MAX_SHIFTS = 8
SHIFT_TIME = 46
SHIFT_SIZE = SHIFT_TIME + MAX_SHIFTS
HEADER = SHIFT_SIZE + MAX_SHIFTS

# Record of a link: angle and rate, sine and cosine, velocity of its centre relative to the water,
# torque of the joint to the next link, thrust on it along and across, coefficients of the back
# substitution, angular acceleration.
THETA, OMEGA, SIN, COS, U_X, U_Y, TORQUE, PUSH_T, PUSH_N = range(9)
SUB_0, SUB_K, SUB_X, SUB_Y, ALPHA = range(9, 14)
RECORD = 14

# Rows of a thruster: command and force.
COMMAND, FORCE = range(2)
THRUSTER = 2


def rows(links: int, thrusters: int) -> int:
    """Number of rows of a block for robots of `links` links and `thrusters` thrusters."""
    return HEADER + links * RECORD + thrusters * THRUSTER
