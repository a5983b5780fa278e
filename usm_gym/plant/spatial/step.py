"""The physics steps of a control period of spatial robots, by the method of `plant.step`."""

from __future__ import annotations

from usm_gym.kernels.compile import piece
from usm_gym.kernels.lanes import load, store
from usm_gym.plant.references import advance_references
from usm_gym.plant.spatial.chain import accelerate
from usm_gym.plant.spatial.layout import *
from usm_gym.plant.spatial.links import kinematics, load_attitude, load_base, store_base
from usm_gym.plant.spatial.rotation import turned
from usm_gym.plant.steering import steered_torque
from usm_gym.plant.thrusters import mean_force
from usm_gym.plant.water import move_water


@piece
def push(block, like, plant):
    """First-order lag of every thruster, and its mean force over a physics step on its link."""
    links, thrusters = plant.links, plant.thrusters
    rows, places = thruster_rows(links, thrusters), plant.thruster_places
    for entry in range(places.shape[0]):
        store(block, places[entry, 1], like)
    last, force = -1, like
    for entry in range(places.shape[0]):
        j, row = places[entry, 0], places[entry, 1]
        if j != last:
            last, force = j, mean_force(block, like, rows, j)
        store(block, row, load(block, row, like) + plant.thruster_shares[entry] * force)


@piece
def joint_torques(block, like, wide, stride, plant, asked_pan, asked_tilt):
    """Torque of every joint controller, as `plant.joints.joint_torques` has it."""
    links, lead = plant.links, plant.lead
    k_p, k_d = load(block, STIFFNESS, like), load(block, DAMPING, like)
    on_rate = k_d + lead * k_p
    on_acceleration = lead * (k_d - lead * k_p)
    for j in range(0, links - 1, stride):
        if plant.steering > 0:
            wanted = steered_torque(block, wide, plant, j, k_p, k_d)
        else:
            wanted = asked_pan * load(block, row_of(PAN_SHARE, links) + j, wide)
            wanted += asked_tilt * load(block, row_of(TILT_SHARE, links) + j, wide)
        held = k_p * load(block, row_of(PHI, links) + j, wide)
        held += on_rate * load(block, row_of(PHI_DOT, links) + j, wide)
        held -= on_acceleration * load(block, row_of(PHI_DDOT, links) + j, wide)
        store(block, row_of(TORQUE, links) + j, wanted - held)


@piece
def integrate(block, like, wide, stride, plant):
    """Velocities from the accelerations, positions from the velocities `lead` into the step."""
    links, h, lead = plant.links, plant.h, plant.lead
    phi, phi_dot, phi_ddot = row_of(PHI, links), row_of(PHI_DOT, links), row_of(PHI_DDOT, links)
    for j in range(0, links - 1, stride):
        rate, acceleration = load(block, phi_dot + j, wide), load(block, phi_ddot + j, wide)
        store(block, phi_dot + j, rate + h * acceleration)
        store(block, phi + j, load(block, phi + j, wide) + h * (rate + lead * acceleration))
    for axis in range(3):
        rate, acceleration = load(block, V + axis, like), load(block, A + axis, like)
        store(block, V + axis, rate + h * acceleration)
        moved = h * (rate + lead * acceleration)
        store(block, P + axis, load(block, P + axis, like) + moved)
    w, dw = load_base(block, W, like), load_base(block, DW, like)
    middle = w[0] + lead * dw[0], w[1] + lead * dw[1], w[2] + lead * dw[2]
    q = turned(load_attitude(block, like), middle, h)
    store_base(block, W, (w[0] + h * dw[0], w[1] + h * dw[1], w[2] + h * dw[2]))
    for k in range(4):
        store(block, Q + k, q[k])
    store(block, CLOCK, load(block, CLOCK, like) + 1.0)


@piece
def advance(block, like, wide, stride, plant):
    """Advance one block by a control period; `like`, `wide` and `stride` as in `plant.chain`."""
    shifts, h, lead = plant.shifts, plant.h, plant.lead
    for _ in range(plant.substeps):
        if plant.sinusoids > 0:
            move_water(block, like, WATER_ROWS, plant.sinusoids, h, lead)
        pan = advance_references(block, like, PAN_ROWS, shifts, h, lead)
        tilt = advance_references(block, like, TILT_ROWS, shifts, h, lead)
        push(block, like, plant)
        joint_torques(block, like, wide, stride, plant, pan, tilt)
        axes = kinematics(block, like, wide, stride, plant)
        accelerate(block, like, wide, stride, axes, plant)
        integrate(block, like, wide, stride, plant)
