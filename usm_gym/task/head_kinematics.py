"""Where the head is, how the joints move it, and whether they can follow a path.

All of it is kinematics: the centre of mass holds its station, and the body its attitude.
"""

from __future__ import annotations

import numpy as np

from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.elementary import sincos
from usm_gym.plant.spatial.layout import FIRST_MOMENT, HALF, MASS
from usm_gym.plant.spatial.posture import centre_of_mass, place_links
from usm_gym.plant.spatial.rotation import cross
from usm_gym.plant.thrusters import allocate
from usm_gym.task.head_path import CHANNELS

# Damping of least squares, m/rad, and the rate at which postures return and errors go, 1/s.
DAMPING, RETURN, CORRECTION = 0.01, 0.3, 5.0


@piece
def head_arm(plant, i):
    """How far link i, counted from 0, carries the head from the centre of mass, m.

    The links before it, and on average half of it, are behind the middle of a link.
    """
    return 2.0 * plant.l * (i + 0.5) / plant.links


@piece
def bent(phi, plant, theta):
    """Fill in the angles of the links of mean 0, rad, (links,), given those of the joints."""
    total, angle, links = 0.0, 0.0, plant.links
    theta[0] = 0.0
    for j in range(links - 1):
        angle -= phi[j]
        theta[j + 1] = angle
        total += angle
    for i in range(links):
        theta[i] -= total / links


@piece
def find_planar_head(theta, plant):
    """Where the head is from the centre of mass, m, given the angles of the links."""
    x, y = 0.0, 0.0
    for i in range(plant.links):
        s, c = sincos(theta[i])
        x += head_arm(plant, i) * c
        y += head_arm(plant, i) * s
    return x, y


@piece
def planar_jacobian(theta, plant, matrix):
    """Fill in how the head moves and turns with the joints, (3, joints).

    Centre of mass and heading, the mean angle of the links, stay as they are.
    """
    links = plant.links
    whole_x, whole_y = 0.0, 0.0
    for i in range(links):
        s, c = sincos(theta[i])
        whole_x -= head_arm(plant, i) * s
        whole_y += head_arm(plant, i) * c
    # What turning all links beyond a joint does, from the head on.
    x, y = 0.0, 0.0
    for j in range(links - 2, -1, -1):
        s, c = sincos(theta[j + 1])
        x -= head_arm(plant, j + 1) * s
        y += head_arm(plant, j + 1) * c
        # The heading stays, so that all links turn back by the share that lies beyond.
        share = (links - 1 - j) / links
        matrix[0, j] = share * whole_x - x
        matrix[1, j] = share * whole_y - y
        matrix[2, j] = share - 1.0


@piece
def find_spatial_head(plant, q, phi, centre, frame):
    """Place the links about the middle of the root; where the head is from the centre of mass, m.

    Arguments are those of `place_links`.
    """
    place_links(plant, (0.0, 0.0, 0.0), q, phi, centre, frame)
    middle, last = centre_of_mass(plant, centre, frame), plant.links - 1
    half = plant.constants[HALF, last]
    return (
        centre[last, 0] + half * frame[last, 0] - middle[0],
        centre[last, 1] + half * frame[last, 1] - middle[1],
        centre[last, 2] + half * frame[last, 2] - middle[2],
    )


@piece
def weighed(plant, centre, frame, i):
    """First moment of link i about the middle of the root, kg m."""
    mass, low = plant.constants[MASS, i], plant.constants[FIRST_MOMENT, i]
    return (
        mass * centre[i, 0] + low * frame[i, 6],
        mass * centre[i, 1] + low * frame[i, 7],
        mass * centre[i, 2] + low * frame[i, 8],
    )


@piece
def spatial_jacobian(plant, centre, frame, matrix):
    """Fill in how the head moves with the joints, (3, joints), from what `place_links` has written.

    Centre of mass and attitude of the root stay as they are.
    """
    links, root = plant.links, plant.root
    last, total = links - 1, 0.0
    for i in range(links):
        total += plant.constants[MASS, i]
    half = plant.constants[HALF, last]
    for end in range(2):
        # From either end inwards: what lies beyond a joint.
        mass, x, y, z = 0.0, 0.0, 0.0, 0.0
        for step in range(links - 1 - root if end == 0 else root):
            outer = last - step if end == 0 else step
            inner, side = (outer - 1, 1.0) if end == 0 else (outer + 1, -1.0)
            j = min(inner, outer)
            moment = weighed(plant, centre, frame, outer)
            mass += plant.constants[MASS, outer]
            x, y, z = x + moment[0], y + moment[1], z + moment[2]
            near, a = side * plant.constants[HALF, inner], plant.axes[j]
            joint = (
                centre[inner, 0] + near * frame[inner, 0],
                centre[inner, 1] + near * frame[inner, 1],
                centre[inner, 2] + near * frame[inner, 2],
            )
            axis = (
                side * (a[0] * frame[inner, 0] + a[1] * frame[inner, 3] + a[2] * frame[inner, 6]),
                side * (a[0] * frame[inner, 1] + a[1] * frame[inner, 4] + a[2] * frame[inner, 7]),
                side * (a[0] * frame[inner, 2] + a[1] * frame[inner, 5] + a[2] * frame[inner, 8]),
            )
            moved = cross(axis, (x - mass * joint[0], y - mass * joint[1], z - mass * joint[2]))
            tip = (
                centre[last, 0] + half * frame[last, 0] - joint[0],
                centre[last, 1] + half * frame[last, 1] - joint[1],
                centre[last, 2] + half * frame[last, 2] - joint[2],
            )
            swept = cross(axis, tip)
            for k in range(3):
                matrix[k, j] = (swept[k] if end == 0 else 0.0) - moved[k] / total


@piece
def follow(wanted, error, matrix, phi, home, step, T, work, rates):
    """Move joint angles, rad, (joints,), on by a step, s; returns the largest rate, rad/s."""
    joints = phi.size
    for c in range(CHANNELS):
        for j in range(joints):
            T[c, j] = matrix[c, j]
            wanted[c] += matrix[c, j] * RETURN * (phi[j] - home[j])
        T[c, joints + c] = DAMPING
        wanted[c] -= CORRECTION * error[c]
    allocate(T, wanted, CHANNELS, 0.0, work, rates)
    fastest = 0.0
    for j in range(joints):
        rate = rates[j] - RETURN * (phi[j] - home[j])
        phi[j] += step * rate
        fastest = max(fastest, abs(rate))
    return fastest


@compiled
def trace_in_plane(references, step, plant, home):
    """Follow a path of the head with the joints alone.

    Args:
        references: Positions, m, and directions, rad, of the head, a step apart, (k, 3).
        step: Time between them, s.
        plant: What all robots share.
        home: Joint angles at the start, to which the posture returns, rad, (joints,).

    Returns:
        The largest error, m, and the largest rate, rad/s, and angle, rad, of a joint.
    """
    joints, links = home.size, plant.links
    T, work = np.zeros((CHANNELS, joints + CHANNELS)), np.empty((2 * CHANNELS + 1, CHANNELS))
    rates, matrix = np.empty(joints + CHANNELS), np.empty((CHANNELS, joints))
    phi, theta, error, wanted = home.copy(), np.empty(links), np.empty(3), np.empty(3)
    furthest, fastest, largest = 0.0, 0.0, 0.0
    for k in range(references.shape[0] - 1):
        bent(phi, plant, theta)
        x, y = find_planar_head(theta, plant)
        planar_jacobian(theta, plant, matrix)
        error[0], error[1] = x - references[k, 0], y - references[k, 1]
        error[2] = theta[links - 1] - references[k, 2]
        furthest = max(furthest, abs(error[0]), abs(error[1]))
        for c in range(CHANNELS):
            wanted[c] = (references[k + 1, c] - references[k, c]) / step
        fastest = max(fastest, follow(wanted, error, matrix, phi, home, step, T, work, rates))
        for j in range(joints):
            largest = max(largest, abs(phi[j]))
    return furthest, fastest, largest


@compiled
def trace_in_space(references, step, plant, home):
    """The same in space, where the head has no direction to keep."""
    joints, links = home.size, plant.links
    T, work = np.zeros((CHANNELS, joints + CHANNELS)), np.empty((2 * CHANNELS + 1, CHANNELS))
    rates, matrix = np.empty(joints + CHANNELS), np.empty((CHANNELS, joints))
    centre, frame = np.empty((links, 3)), np.empty((links, 9))
    phi, error, wanted = home.copy(), np.empty(3), np.empty(3)
    furthest, fastest, largest = 0.0, 0.0, 0.0
    for k in range(references.shape[0] - 1):
        head = find_spatial_head(plant, (1.0, 0.0, 0.0, 0.0), phi, centre, frame)
        spatial_jacobian(plant, centre, frame, matrix)
        for c in range(CHANNELS):
            error[c] = head[c] - references[k, c]
            furthest = max(furthest, abs(error[c]))
            wanted[c] = (references[k + 1, c] - references[k, c]) / step
        fastest = max(fastest, follow(wanted, error, matrix, phi, home, step, T, work, rates))
        for j in range(joints):
            largest = max(largest, abs(phi[j]))
    return furthest, fastest, largest
