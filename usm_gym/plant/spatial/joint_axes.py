"""From the axes of a link to those of a joint, whose z is the axis of the joint, and back.

The axes of most joints are z or y of the link, for which no number has to be multiplied.
"""

from __future__ import annotations

from usm_gym.kernels.compile import piece
from usm_gym.plant.spatial.layout import ALONG_Y, ALONG_Z


@piece
def to_joint(plant, j, u):
    """A vector in the axes of joint j."""
    if plant.kinds[j] == ALONG_Z:
        return u[0], u[1], u[2]
    if plant.kinds[j] == ALONG_Y:
        return u[0], -u[2], u[1]
    F = plant.frames[j]
    return (
        F[0] * u[0] + F[1] * u[1] + F[2] * u[2],
        F[3] * u[0] + F[4] * u[1] + F[5] * u[2],
        F[6] * u[0] + F[7] * u[1] + F[8] * u[2],
    )


@piece
def from_joint(plant, j, u):
    """A vector in link axes, given in those of joint j."""
    if plant.kinds[j] == ALONG_Z:
        return u[0], u[1], u[2]
    if plant.kinds[j] == ALONG_Y:
        return u[0], u[2], -u[1]
    F = plant.frames[j]
    return (
        F[0] * u[0] + F[3] * u[1] + F[6] * u[2],
        F[1] * u[0] + F[4] * u[1] + F[7] * u[2],
        F[2] * u[0] + F[5] * u[1] + F[8] * u[2],
    )


@piece
def symmetric_to_joint(plant, j, A):
    """A symmetric matrix (xx, xy, xz, yy, yz, zz) in the axes of joint j."""
    if plant.kinds[j] == ALONG_Z:
        return A[0], A[1], A[2], A[3], A[4], A[5]
    if plant.kinds[j] == ALONG_Y:
        return A[0], -A[2], A[1], A[5], -A[4], A[3]
    x = to_joint(plant, j, (A[0], A[1], A[2]))
    y = to_joint(plant, j, (A[1], A[3], A[4]))
    z = to_joint(plant, j, (A[2], A[4], A[5]))
    a = to_joint(plant, j, (x[0], y[0], z[0]))
    b = to_joint(plant, j, (x[1], y[1], z[1]))
    c = to_joint(plant, j, (x[2], y[2], z[2]))
    return a[0], a[1], a[2], b[1], b[2], c[2]


@piece
def symmetric_from_joint(plant, j, A):
    """A symmetric matrix in link axes, given in those of joint j."""
    if plant.kinds[j] == ALONG_Z:
        return A[0], A[1], A[2], A[3], A[4], A[5]
    if plant.kinds[j] == ALONG_Y:
        return A[0], A[2], -A[1], A[5], -A[4], A[3]
    x = from_joint(plant, j, (A[0], A[1], A[2]))
    y = from_joint(plant, j, (A[1], A[3], A[4]))
    z = from_joint(plant, j, (A[2], A[4], A[5]))
    a = from_joint(plant, j, (x[0], y[0], z[0]))
    b = from_joint(plant, j, (x[1], y[1], z[1]))
    c = from_joint(plant, j, (x[2], y[2], z[2]))
    return a[0], a[1], a[2], b[1], b[2], c[2]


@piece
def matrix_to_joint(plant, j, A):
    """A matrix, row by row, in the axes of joint j."""
    if plant.kinds[j] == ALONG_Z:
        return A[0], A[1], A[2], A[3], A[4], A[5], A[6], A[7], A[8]
    if plant.kinds[j] == ALONG_Y:
        return A[0], -A[2], A[1], -A[6], A[8], -A[7], A[3], -A[5], A[4]
    # The columns of A become rows, and by the second turn columns again.
    x = to_joint(plant, j, (A[0], A[3], A[6]))
    y = to_joint(plant, j, (A[1], A[4], A[7]))
    z = to_joint(plant, j, (A[2], A[5], A[8]))
    a = to_joint(plant, j, (x[0], y[0], z[0]))
    b = to_joint(plant, j, (x[1], y[1], z[1]))
    c = to_joint(plant, j, (x[2], y[2], z[2]))
    return a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]


@piece
def matrix_from_joint(plant, j, A):
    """A matrix, row by row, in link axes, given in those of joint j."""
    if plant.kinds[j] == ALONG_Z:
        return A[0], A[1], A[2], A[3], A[4], A[5], A[6], A[7], A[8]
    if plant.kinds[j] == ALONG_Y:
        return A[0], A[2], -A[1], A[6], A[8], -A[7], -A[3], -A[5], A[4]
    x = from_joint(plant, j, (A[0], A[3], A[6]))
    y = from_joint(plant, j, (A[1], A[4], A[7]))
    z = from_joint(plant, j, (A[2], A[5], A[8]))
    a = from_joint(plant, j, (x[0], y[0], z[0]))
    b = from_joint(plant, j, (x[1], y[1], z[1]))
    c = from_joint(plant, j, (x[2], y[2], z[2]))
    return a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]
