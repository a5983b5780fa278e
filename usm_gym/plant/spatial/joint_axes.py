"""From the axes of a link to those of a joint, whose z is the axis of the joint, and back.

The axes of most joints are z or y of the link, for which no number has to be multiplied. Symmetric
matrices are given by xx, xy, xz, yy, yz, zz, others row by row.
"""

from __future__ import annotations

from usm_gym.kernels.compile import aside, piece
from usm_gym.plant.spatial.layout import ALONG_Y, ALONG_Z


@piece
def framed(F, u):
    """A vector by its components along the rows of F, given row by row."""
    return (
        F[0] * u[0] + F[1] * u[1] + F[2] * u[2],
        F[3] * u[0] + F[4] * u[1] + F[5] * u[2],
        F[6] * u[0] + F[7] * u[1] + F[8] * u[2],
    )


@piece
def framed_matrix(F, A):
    """The same of a matrix."""
    # The columns of A become rows, and by the second turn columns again.
    x, y, z = framed(F, A[0::3]), framed(F, A[1::3]), framed(F, A[2::3])
    a = framed(F, (x[0], y[0], z[0]))
    b = framed(F, (x[1], y[1], z[1]))
    c = framed(F, (x[2], y[2], z[2]))
    return a + b + c


@piece
def framed_symmetric(F, A):
    """The same of a symmetric matrix."""
    B = framed_matrix(F, (A[0], A[1], A[2], A[1], A[3], A[4], A[2], A[4], A[5]))
    return B[0], B[1], B[2], B[4], B[5], B[8]


@piece
def transposed(F):
    """A matrix, given row by row."""
    return F[0], F[3], F[6], F[1], F[4], F[7], F[2], F[5], F[8]


@aside
def framed_vectors(F, vectors):
    """The same of five vectors."""
    a, b, c, d, e = vectors
    return framed(F, a), framed(F, b), framed(F, c), framed(F, d), framed(F, e)


@aside
def framed_answer(F, answer):
    """The same of an answer, see `chain`."""
    J, H, M, n, f = answer
    J, M = framed_symmetric(F, J), framed_symmetric(F, M)
    return J, framed_matrix(F, H), M, framed(F, n), framed(F, f)


@piece
def frame_of(plant, j):
    """Three axes, row by row, of which the third is that of joint j."""
    F = plant.frames[j]
    return F[0], F[1], F[2], F[3], F[4], F[5], F[6], F[7], F[8]


@piece
def rolled(u):
    """A vector in axes of which the third is the second of its own."""
    return u[0], -u[2], u[1]


@piece
def unrolled(u):
    """Undo `rolled`."""
    return u[0], u[2], -u[1]


@piece
def vectors_to_joint(plant, j, vectors):
    """Five vectors in the axes of joint j."""
    a, b, c, d, e = vectors
    if plant.kinds[j] == ALONG_Z:
        return a, b, c, d, e
    if plant.kinds[j] == ALONG_Y:
        return rolled(a), rolled(b), rolled(c), rolled(d), rolled(e)
    return framed_vectors(frame_of(plant, j), vectors)


@piece
def vectors_from_joint(plant, j, vectors):
    """Undo `vectors_to_joint`."""
    a, b, c, d, e = vectors
    if plant.kinds[j] == ALONG_Z:
        return a, b, c, d, e
    if plant.kinds[j] == ALONG_Y:
        return unrolled(a), unrolled(b), unrolled(c), unrolled(d), unrolled(e)
    return framed_vectors(transposed(frame_of(plant, j)), vectors)


@piece
def pair_to_joint(plant, j, a, b):
    """Two vectors in the axes of joint j."""
    if plant.kinds[j] == ALONG_Z:
        return a, b
    if plant.kinds[j] == ALONG_Y:
        return rolled(a), rolled(b)
    F = frame_of(plant, j)
    return framed(F, a), framed(F, b)


@piece
def pair_from_joint(plant, j, a, b):
    """Undo `pair_to_joint`."""
    if plant.kinds[j] == ALONG_Z:
        return a, b
    if plant.kinds[j] == ALONG_Y:
        return unrolled(a), unrolled(b)
    F = transposed(frame_of(plant, j))
    return framed(F, a), framed(F, b)


@piece
def answer_to_joint(plant, j, answer):
    """An answer, see `chain`, in the axes of joint j."""
    J, H, M, n, f = answer
    if plant.kinds[j] == ALONG_Z:
        return J, H, M, n, f
    if plant.kinds[j] == ALONG_Y:
        return (
            (J[0], -J[2], J[1], J[5], -J[4], J[3]),
            (H[0], -H[2], H[1], -H[6], H[8], -H[7], H[3], -H[5], H[4]),
            (M[0], -M[2], M[1], M[5], -M[4], M[3]),
            rolled(n),
            rolled(f),
        )
    return framed_answer(frame_of(plant, j), answer)


@piece
def answer_from_joint(plant, j, answer):
    """Undo `answer_to_joint`."""
    J, H, M, n, f = answer
    if plant.kinds[j] == ALONG_Z:
        return J, H, M, n, f
    if plant.kinds[j] == ALONG_Y:
        return (
            (J[0], J[2], -J[1], J[5], -J[4], J[3]),
            (H[0], H[2], -H[1], H[6], H[8], -H[7], -H[3], -H[5], H[4]),
            (M[0], M[2], -M[1], M[5], -M[4], M[3]),
            unrolled(n),
            unrolled(f),
        )
    return framed_answer(transposed(frame_of(plant, j)), answer)
