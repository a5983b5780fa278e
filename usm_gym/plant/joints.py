"""The joint controllers, which follow the joint references."""

from __future__ import annotations

from usm_gym.kernels.compile import piece
from usm_gym.kernels.lanes import load, store
from usm_gym.plant.layout import *
from usm_gym.plant.steering import steered_torque


@piece
def joint_torques(block, like, wide, stride, plant, asked):
    """Torque of every joint controller, less the part that is in the joint-space inertia.

    It is that of the middle of a step of 2 lead, from those at three ends of steps: the torque to
    come less half the change over the step before, u_1 - (u_0 - u_-1) / 2. So the fast motion that
    the stiff controllers damp dies out within a few steps, which it would not with the mean of u_0
    and u_1. What the references ask for is `asked` itself, or of joints that are steered their own.
    """
    links, lead = plant.links, plant.lead
    k_p, k_d = load(block, STIFFNESS, like), load(block, DAMPING, like)
    on_rate = k_d + lead * k_p
    on_acceleration = lead * (k_d - lead * k_p)
    theta, omega, alpha = row_of(THETA, links), row_of(OMEGA, links), row_of(ALPHA, links)
    for i in range(0, links - 1, stride):
        phi = load(block, theta + i, wide) - load(block, theta + i + 1, wide)
        phi_dot = load(block, omega + i, wide) - load(block, omega + i + 1, wide)
        phi_ddot = load(block, alpha + i, wide) - load(block, alpha + i + 1, wide)
        if plant.steering > 0:
            wanted = steered_torque(block, wide, plant, i, k_p, k_d)
        else:
            wanted = asked * load(block, row_of(SHARE, links) + i, wide)
        held = k_p * phi + on_rate * phi_dot - on_acceleration * phi_ddot
        store(block, row_of(TORQUE, links) + i, wanted - held)
