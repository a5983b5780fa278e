"""The physics steps of a control period, for blocks of robots.

Every quantity is a float64 or a `Lanes`, as in `chain`. The method is a linearly implicit midpoint
rule of second order (docs/model.md section 7): forces are taken `lead` into the step, half of it;
with a lead of 0 the same lines are Euler's forward method.
"""

from __future__ import annotations

from usm_gym.kernels.compile import piece
from usm_gym.kernels.lanes import load, store
from usm_gym.plant.chain import accelerate, kinematics
from usm_gym.plant.joints import joint_torques
from usm_gym.plant.layout import *
from usm_gym.plant.push import push
from usm_gym.plant.references import advance_references
from usm_gym.plant.water import move_water


@piece
def integrate(block, like, wide, stride, links, h, lead):
    """Velocities from the accelerations, positions from the velocities `lead` into the step."""
    theta, omega, alpha = row_of(THETA, links), row_of(OMEGA, links), row_of(ALPHA, links)
    for i in range(0, links, stride):
        rate, acceleration = load(block, omega + i, wide), load(block, alpha + i, wide)
        store(block, omega + i, rate + h * acceleration)
        moved = h * (rate + lead * acceleration)
        store(block, theta + i, load(block, theta + i, wide) + moved)
    for axis in range(2):
        rate, acceleration = load(block, V_X + axis, like), load(block, A_X + axis, like)
        store(block, V_X + axis, rate + h * acceleration)
        moved = h * (rate + lead * acceleration)
        store(block, P_X + axis, load(block, P_X + axis, like) + moved)
    store(block, CLOCK, load(block, CLOCK, like) + 1.0)


@piece
def physics_step(block, like, wide, stride, plant, base):
    """One physics step from kinematics that are known; arguments as in `chain.accelerate`."""
    links, h, lead = plant.links, plant.h, plant.lead
    asked = advance_references(block, like, REFERENCES, plant.shifts, h, lead)
    push(block, like, plant)
    joint_torques(block, like, wide, stride, plant, asked)
    accelerate(block, like, wide, stride, links, base, plant)
    integrate(block, like, wide, stride, links, h, lead)


@piece
def advance(block, like, wide, stride, plant):
    """Advance one block by a control period; `like`, `wide` and `stride` as in `chain`."""
    for _ in range(plant.substeps):
        if plant.sinusoids > 0:
            move_water(block, like, WATER_ROWS, plant.sinusoids, plant.h, plant.lead)
        base = kinematics(block, like, wide, stride, plant)
        physics_step(block, like, wide, stride, plant, base)
