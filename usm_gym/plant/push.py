"""The thrusters of the planar robot: where they push, and what wrench they make."""

from __future__ import annotations

from usm_gym.kernels.compile import piece
from usm_gym.kernels.lanes import load, store
from usm_gym.plant.layout import *
from usm_gym.plant.thrusters import mean_force


@piece
def push(block, like, plant):
    """First-order lag of every thruster, and its mean force over a physics step on its link."""
    links, thrusters = plant.links, plant.thruster_links.size
    along, across = row_of(PUSH_T, links), row_of(PUSH_N, links)
    for j in range(thrusters):
        store(block, along + plant.thruster_links[j], like)
        store(block, across + plant.thruster_links[j], like)
    rows = thruster_rows(links, thrusters)
    for j in range(thrusters):
        force = mean_force(block, like, rows, j)
        target = plant.thruster_links[j] + (across if plant.thruster_is_normal[j] else along)
        store(block, target, load(block, target, like) + force)


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
