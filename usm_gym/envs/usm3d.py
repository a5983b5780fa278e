"""The environments of the spatial robot."""

from __future__ import annotations

from typing import Any

import gymnasium as gym

from usm_gym.envs.mode_env import ModeEnv, ModeVectorEnv
from usm_gym.task.spatial_observation import SpatialLayout
from usm_gym.task.spatial_scenario import SPATIAL_MODES


class USM3DEnv(ModeEnv):
    """An underwater swimming manipulator in space whose centre of mass has to follow a path.

    The robot is "Eely": nine cylinders, 3.37 m and 86 kg, eight joints in turn about z (pan) and y
    (tilt), seven thrusters; its centre of mass lies 3 cm below its centre of buoyancy. x points
    ahead, y to the left, z up.

    In operation mode (`usm_gym:USM-Operation3D-v0`) the thrusters hold the centre of mass on a slow
    path and the body level and straight ahead, while the head looks to the side and up, elsewhere,
    and back, at about 10, 20 and 30 s, and so disturbs both. In torpedo mode
    (`usm_gym:USM-Torpedo3D-v0`) the body is straight, the path faster, and pitch and yaw follow the
    line of sight. Roll is reported, and no reference is set for it. The score of an episode is the
    largest true position error per axis after settling.

    ## Action

    `Box(-1, 1, (7,), float32)`: commands of the thrusters over their limit (40 N in "field");
    values beyond saturate, a wrong shape or a value that is not a number raises `ValueError`.

    | index | thruster | positive force |
    |---|---|---|
    | 0 | link 3 | up |
    | 1 | link 3 | to the left |
    | 2 | link 5, the middle one | up |
    | 3 | link 5, 15 cm to the left | ahead |
    | 4 | link 5, 15 cm to the right | ahead |
    | 5 | link 7, 10 cm to the left | to the left |
    | 6 | link 7, 10 cm to the left | up |

    ## Observation

    `Box(float32)` of 74 numbers, the same in both modes: physical value over scale. Every error is
    actual minus reference; those of the attitude are a rotation vector in the axes of the middle
    link, which never unwinds. The true velocity of the centre of mass, the current and the true
    coefficients are not observed.

    OBSERVATION_TABLE

    ## Reward

    r = -10 mean_axes |e| / (|e| + 0.02 m) - 0.25 sum_angles |a| / (|a| + 20 deg)
    - 0.1 mean_thrusters |command| / limit, with the true position error e and the errors a of pitch
    and yaw after the step. The step that loses the robot costs -10.6 for itself and for every step
    that remains, so that ending early never pays.

    ## Start

    Straight, level, at rest, on the reference. `reset(seed=...)` draws a scenario of the mode from
    `env.np_random`. `reset(options={"scenario": s})` takes s = "nominal", under the environment's
    conditions, or a `SpatialScenario` or its dict, which brings its own.

    ## End

    Truncation at the scenario's duration (40 s, 2000 steps; in "basin" and "sea" 60 s, 3000
    steps). Termination when the robot is lost: the true error exceeds 0.5 m in an axis, or the
    state is no longer finite; the observation is finite all the same.

    ## Info, at every step

    | key | unit | meaning |
    |---|---|---|
    | `error_x`, `error_y`, `error_z` | m | true position error |
    | `max_error_x`, `max_error_y`, `max_error_z` | m | its largest absolute value since settling; \
0 before |
    | `pitch_error`, `yaw_error`, `roll_error` | rad | attitude minus its reference, as known on \
board |
    | `thrust_effort` | N | mean absolute command of the thrusters |
    | `diverged` | 0 or 1 | whether the robot is lost |

    All values are `numpy.float64`, which is a `float`, so that JSON takes them.

    ## Arguments

    | argument | default | meaning |
    |---|---|---|
    | `conditions` | `"field"` | `"ideal"`, `"field"`, `"basin"`, `"sea"`, or a dict of fields |
    | `robot` | `"eely"` | `"eely-neutral"`, which nothing keeps upright, or a dict of \
`SpatialRobot` fields |
    | `render_mode` | None | `"rgb_array"`: `render()` gives an image of 640 x 480; `"human"`: a \
window shows every step in real time (drawing needs the extra `render`) |

    ## Version history

    - v0: first version.
    """

    modes = SPATIAL_MODES


# The class docstring is the specification; its table comes from the one that the code uses.
USM3DEnv.__doc__ = (USM3DEnv.__doc__ or "").replace(
    "OBSERVATION_TABLE", SpatialLayout(8, 7).table().replace("\n", "\n    ")
)


# Some clients, skrl for one, recognise a vector environment by its direct bases.
class USM3DVectorEnv(ModeVectorEnv, gym.vector.VectorEnv[Any, Any, Any]):
    """`num_envs` underwater swimming manipulators in space, as in `USM3DEnv`, with the same bits.

    Made by `gym.make_vec("usm_gym:USM-Operation3D-v0", num_envs=256,
    vectorization_mode="vector_entry_point")`. Seeds, options and autoreset modes are as of
    `usm_gym.envs.usm.USMVectorEnv`.
    """

    modes = SPATIAL_MODES
