"""What the agent of the residual task sees: the table, which `observer` fills."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

from usm_baselines.estimation.estimator import LEADS

from usm_gym.sensors import Entry, Layout
from usm_gym.support.validation import require

# Scale of a position error, m, or where positions are measured worse than in `field`, so many of
# their standard deviations.
SHORT, DEVIATIONS = 2e-3, 5.0
# An agent that moves the joints alone is shown errors over so many times that scale.
FAR = 10.0

# How the agent sees the numbers of the base's state that its law declares as `shown`, one per axis.
BASE_ENTRIES = {
    "error": Entry("base_error", 1, "m", SHORT, 10 * SHORT, "error, as the base believes"),
    "rate": Entry("base_rate", 1, "m/s", 0.05, 1.0, "rate of the error, by the base's observer"),
    "disturbance": Entry("base_disturbance", 1, "m/s^2", 2.0, 40.0, "disturbance, by the same"),
    "unmodelled": Entry(
        "base_disturbance", 1, "m/s^2", 0.2, 4.0, "what the base's model leaves out"
    ),
    "integral": Entry("base_integral", 1, "m/s^2", 2.0, 40.0, "v of the super-twisting law (11)"),
    "alpha": Entry("base_alpha", 1, "m^(1/2)/s^(3/2)", 50.0, 500.0, "alpha of the same"),
}
# The posture of the planar robot in a few numbers, and that of the spatial one.
PLANAR_POSTURE = (
    Entry("heading", 1, "rad", 0.5, 10.0, "mean link angle, never wrapped"),
    Entry("heading_error", 1, "rad", 0.1, 1.0, "heading less its reference"),
    Entry("heading_rate", 1, "rad/s", 0.2, 4.0, "rate of the heading"),
    Entry("deflection", 1, "rad", 1.0, 10.0, "sum of the joint angles"),
    Entry("deflection_rate", 1, "rad/s", 2.0, 40.0, "its rate"),
    Entry("reference_deflection", 1, "rad", 1.0, 10.0, "sum of the joint references"),
    Entry("reference_deflection_rate", 1, "rad/s", 2.0, 40.0, "its rate"),
    Entry("reference_deflection_acceleration", 1, "rad/s^2", 50.0, 1000.0, "its acceleration"),
    Entry("bending_joints", 1, "1", 10.0, 100.0, "how many joints are asked to bend"),
)
_SIDES = "to the left and up: sums over the joints about z, and about -y"
SPATIAL_POSTURE = (
    Entry("attitude_error", 3, "rad", 0.1, 1.0, "errors of pitch, yaw and roll"),
    Entry("angular_velocity", 3, "rad/s", 0.2, 4.0, "of the middle link, its axes"),
    Entry("deflection", 2, "rad", 0.5, 10.0, _SIDES),
    Entry("deflection_rate", 2, "rad/s", 1.0, 40.0, "its rate"),
    Entry("reference_deflection", 2, "rad", 0.5, 10.0, "the same of the joint references"),
    Entry("reference_deflection_rate", 2, "rad/s", 1.0, 40.0, "its rate"),
    Entry("reference_deflection_acceleration", 2, "rad/s^2", 10.0, 1000.0, "its acceleration"),
    Entry("bending_joints", 1, "1", 10.0, 100.0, "how many joints are asked to bend"),
)

# What follows the posture of a robot whose head follows a path. Sizes are those of axes and joints.
HEAD_ERROR = Entry("head_error", 1, "m", SHORT, 10 * SHORT, "error of the head, by the navigator")
HEAD_ENTRIES = (
    Entry("head_reference_velocity", 1, "m/s", 0.1, 1.0, "velocity of the head's reference"),
    Entry("head_reference_acceleration", 1, "m/s^2", 0.1, 1.0, "its acceleration"),
)
DIRECTION_ENTRIES = (
    Entry("direction_error", 1, "rad", 0.01, 1.0, "direction of the head less its reference"),
    Entry("direction_reference_rate", 1, "rad/s", 0.1, 1.0, "rate of that reference"),
)
JOINTS_VELOCITY = Entry("joints_velocity", 1, "m/s", 0.1, 1.0, "velocity of the head by the joints")
JOINT_ANGLES = Entry("joint_angles", 1, "rad", 0.5, 10.0, "angles of the joints")


def base_entries(shown: Iterable[str], axes: int) -> tuple[Entry, ...]:
    """The entries of the base's own numbers, named as its law does.

    Args:
        shown: The numbers of the law's state.
        axes: Axes in which it controls the position.

    Raises:
        ValueError: If there is no entry for one of them.
    """
    for name in shown:
        require(name in BASE_ENTRIES, "shown", name, ", ".join(BASE_ENTRIES))
    return tuple(replace(BASE_ENTRIES[name], size=axes) for name in shown)


def measured_by(length: float, entries: tuple[Entry, ...]) -> tuple[Entry, ...]:
    """The same entries, with lengths measured by one of our own, m."""
    return tuple(
        replace(entry, scale=length, bound=10 * length) if entry.unit == "m" else entry
        for entry in entries
    )


@dataclass(frozen=True)
class ResidualLayout(Layout):
    """The layout of the residual task's observation; values beyond a bound are cut off at it.

    Attributes:
        axes: Names of the axes of the position.
        moments: Moments that a base asks for.
        thrusters: Number of thrusters.
        actions: Number of numbers in an action.
        base: Entries of the base's own state.
        posture: Entries of the body's posture.
        length: What a position error is measured by, m.
        omit: Names of entries that are left out.
        frames: How many observations are shown at once, the latest last.
    """

    axes: tuple[str, ...]
    moments: int
    thrusters: int
    actions: int
    base: tuple[Entry, ...]
    posture: tuple[Entry, ...]
    length: float = SHORT
    omit: tuple[str, ...] = ()
    frames: int = 1

    def __post_init__(self) -> None:
        """Refuse names of no entry."""
        known = [entry.name for entry in self.complete]
        for name in self.omit:
            require(name in known, "omit", name, ", ".join(known))
        number = isinstance(self.frames, int) and self.frames >= 1
        require(number, "frames", self.frames, "an integer >= 1")

    @property
    def complete(self) -> tuple[Entry, ...]:
        """All entries that a frame can have, in order."""
        length, axes, named = self.length, len(self.axes), ", ".join(self.axes)
        return (
            Entry("position_error", axes, "m", length, 10 * length, f"as last measured ({named})"),
            Entry("position_age", 1, "s", 0.1, 10.0, "how old that is"),
            Entry("velocity_age", 1, "s", 0.1, 10.0, "how old the last velocity is; -1 if none"),
            Entry(
                "reference_velocity", axes, "m/s", 0.1, 1.0, f"velocity of the reference ({named})"
            ),
            Entry("reference_acceleration", axes, "m/s^2", 0.02, 0.2, "its acceleration"),
            Entry("estimated_error", axes, "m", length, 10 * length, "error, by the navigator"),
            Entry("estimated_rate", axes, "m/s", 0.04, 0.4, "its rate, by the same"),
            Entry("estimated_disturbance", axes, "m/s^2", 0.2, 4.0, "disturbance, by the same"),
            Entry("estimated_thrust", axes, "m/s^2", 1.0, 20.0, "thrust over mass, by the same"),
            *(
                Entry(
                    f"foreseen_error_{lead}",
                    axes,
                    "m",
                    length,
                    10 * length,
                    f"error in {lead} periods if the last commands are held",
                )
                for lead in LEADS
            ),
            Entry("foreseen_rate", axes, "m/s", 0.04, 0.4, "rate of the last of these"),
            *self.base,
            Entry("base_force", axes, "N", 40.0, 400.0, "the base's force, before saturation"),
            Entry(
                "base_moment",
                self.moments,
                "N m",
                5.0,
                100.0,
                "the base's moment, before saturation",
            ),
            Entry(
                "thruster_command",
                self.thrusters,
                "1",
                1.0,
                1.1,
                "last command over the limit, after saturation",
            ),
            Entry("last_action", self.actions, "1", 1.0, 1.0, "the agent's last action"),
            *self.posture,
        )

    @cached_property
    def frame(self) -> tuple[Entry, ...]:
        """The entries of one frame, in order."""
        return tuple(entry for entry in self.complete if entry.name not in self.omit)

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """All entries in order; those of earlier frames have their age in the name."""
        earlier = [
            replace(entry, name=f"{entry.name}[-{age}]")
            for age in range(self.frames - 1, 0, -1)
            for entry in self.frame
        ]
        return (*earlier, *self.frame)
