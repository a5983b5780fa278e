"""What all robots of a fleet share, in the plane."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Plant(NamedTuple):
    """What all robots of a fleet share.

    Attributes:
        l: Half the length of a link, m.
        m: Mass of a link, kg.
        J: Moment of inertia of a link about its centre, kg m^2.
        lead: How far into a step forces are taken, s: half of it, or 0 for Euler's forward method.
        kirchhoff: 1.0 for the consistent added mass, 0.0 for that of Kelasidi et al. (2014).
        linear_drag: 1.0 for drag with its linear terms, 0.0 for quadratic drag alone.
        links: Number of links.
        thruster_links: Zero-based link of each thruster, int64.
        thruster_is_normal: Whether each thruster pushes across its link.
        h: Physics step, s.
        substeps: Physics steps in a control period.
        shifts: Largest number of changes of the joint references in any episode.
        sinusoids: Largest number of sinusoids in the water's velocity in any episode.
        steering: How a policy steers the joints, if it does: this and what follows as in
            `plant.steering.Steering`.
    """

    l: float
    m: float
    J: float
    lead: float
    kirchhoff: float
    linear_drag: float
    links: int
    thruster_links: NDArray[np.int64]
    thruster_is_normal: NDArray[np.bool_]
    h: float
    substeps: int
    shifts: int
    sinusoids: int
    steering: int
    joint_time_constant: float
    joint_decay: float
    joint_rate_limit: float
    joint_angle_limit: float
