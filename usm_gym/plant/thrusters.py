"""From a wrench on the centre of mass to thruster forces, and back (the paper's equation 4)."""

from __future__ import annotations

from usm_gym.kernels.compile import piece


@piece
def allocation_matrix(sine, cosine, l, thruster_links, thruster_is_normal, T):
    """Fill in T, shape (3, thrusters): the wrench (N, N, N m) that a unit force of each makes.

    The moment is about the centre of mass. The paper prints its row without the factor l; here
    it is the true moment (docs/model.md section 6).

    Args:
        sine: Sines of the link angles, (n,).
        cosine: Cosines of the link angles, (n,).
        l: Half the length of a link, m.
        thruster_links: Zero-based link of each thruster.
        thruster_is_normal: Whether each thruster pushes across its link.
        T: Where to write.
    """
    n = sine.size
    share = 1.0 / n
    x, y, mean_x, mean_y = 0.0, 0.0, 0.0, 0.0
    for i in range(1, n):
        x += l * (cosine[i - 1] + cosine[i])
        y += l * (sine[i - 1] + sine[i])
        mean_x += x * share
        mean_y += y * share
    at, x, y = 0, -mean_x, -mean_y
    for j in range(thruster_links.size):
        link = thruster_links[j]
        if link < at:
            at, x, y = 0, -mean_x, -mean_y
        for i in range(at + 1, link + 1):
            x += l * (cosine[i - 1] + cosine[i])
            y += l * (sine[i - 1] + sine[i])
        at = link
        T[0, j] = -sine[link] if thruster_is_normal[j] else cosine[link]
        T[1, j] = cosine[link] if thruster_is_normal[j] else sine[link]
        T[2, j] = x * T[1, j] - y * T[0, j]


@piece
def allocate(T, f_x, f_y, moment, forces):
    """Fill in the forces of least norm that make a wrench: f = T^T (T T^T)^-1 (f_x, f_y, moment).

    The normal equations are solved by Cholesky's decomposition, written out.
    """
    a, b, c, d, e, f = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(forces.size):
        a += T[0, j] * T[0, j]
        b += T[1, j] * T[0, j]
        c += T[1, j] * T[1, j]
        d += T[2, j] * T[0, j]
        e += T[2, j] * T[1, j]
        f += T[2, j] * T[2, j]
    b /= a
    c -= b * b * a
    g = d / a
    e = (e - d * b) / c
    f -= g * g * a + e * e * c
    y_0 = f_x
    y_1 = f_y - b * y_0
    y_2 = moment - g * y_0 - e * y_1
    z_2 = y_2 / f
    z_1 = y_1 / c - e * z_2
    z_0 = y_0 / a - b * z_1 - g * z_2
    for j in range(forces.size):
        forces[j] = T[0, j] * z_0 + T[1, j] * z_1 + T[2, j] * z_2
