"""The environments in which the head of the spatial robot follows a path."""

from __future__ import annotations

from typing import Any

import gymnasium as gym

from usm_gym.envs.mode_env import ModeEnv, ModeVectorEnv
from usm_gym.task.head_scenario import SPATIAL_HEAD_MODES
from usm_gym.task.spatial_head_observation import SpatialHeadLayout


class Head3DEnv(ModeEnv):
    """An underwater swimming manipulator in space whose head has to follow a path.

    The robot is that of `usm_gym.envs.usm3d`: nine links, eight joints, seven thrusters. Here the
    joints are the policy's, too: thrusters hold the body, joints reach for the path, and both
    disturb each other. The head draws circles and lines, scans along a wall or keeps to a point,
    all within its reach while the centre of mass stays where it starts, at the station; nothing
    asks it to stay there. The score of an episode is the largest true position error of the head
    per axis after settling.

    ## Action

    `Box(-1, 1, (15,), float32)`; values beyond saturate, a wrong shape or a value that is not a
    number raises `ValueError`.

    | index | what | at 1 |
    |---|---|---|
    | 0-6 | commands of the thrusters over their limit, as of `usm_gym.envs.usm3d` | 40 N in \
"field" |
    | 7-14 | commanded rates of the joints, from the tail, over their limit | 0.5 rad/s |

    The commanded angle of a joint is the integral of its commanded rate and stays within 1.2 rad;
    the reference of its controller lags 0.1 s behind it.

    ## Observation

    `Box(float32)` of 86 numbers: physical value over scale. The first 74 are those of the body that
    holds its station, as `usm_gym.envs.usm3d` has them, so that a controller of the body can be
    given them. The position of the head is not measured: it follows from the position of the centre
    of mass, the attitude and the joint angles, with the errors of all three.

    OBSERVATION_TABLE

    ## Reward

    r = -10 mean_axes |e| / (|e| + 0.02 m) - 0.1 mean_thrusters |command| / limit, with the true
    position error e of the head after the step. The step that loses the robot costs -10.1 for
    itself and for every step that remains.

    ## Start

    Level, at rest, bent to the side and up, with the head on its reference. `reset(seed=...)` draws
    a scenario from `env.np_random`. `reset(options={"scenario": s})` takes s = "nominal", under the
    environment's conditions, or a `SpatialHeadScenario` or its dict, which brings its own.

    ## End

    Truncation at the scenario's duration (40 s, 2000 steps; in "basin" and "sea" 60 s, 3000
    steps). Termination when the robot is lost: the true error of the head exceeds 0.5 m in an axis,
    or the state is no longer finite; the observation is finite all the same.

    ## Info, at every step

    | key | unit | meaning |
    |---|---|---|
    | `error_x`, `error_y`, `error_z` | m | true position error of the head |
    | `max_error_x`, `max_error_y`, `max_error_z` | m | its largest absolute value since settling; \
0 before |
    | `pitch_error`, `yaw_error`, `roll_error` | rad | attitude of the middle link, which is level \
and straight ahead at 0 |
    | `thrust_effort` | N | mean absolute command of the thrusters |
    | `diverged` | 0 or 1 | whether the robot is lost |

    All values are `numpy.float64`, which is a `float`, so that JSON takes them.

    ## Arguments

    As of `usm_gym.envs.usm3d.USM3DEnv`.

    ## Version history

    - v0: first version.
    """

    modes = SPATIAL_HEAD_MODES


# The class docstring is the specification; its table comes from the one that the code uses.
Head3DEnv.__doc__ = (Head3DEnv.__doc__ or "").replace(
    "OBSERVATION_TABLE", SpatialHeadLayout(8, 7).table().replace("\n", "\n    ")
)


# Some clients, skrl for one, recognise a vector environment by its direct bases.
class Head3DVectorEnv(ModeVectorEnv, gym.vector.VectorEnv[Any, Any, Any]):
    """`num_envs` robots in space whose heads follow paths, as in `Head3DEnv`, with the same bits.

    Made by `gym.make_vec("usm_gym:USM-Head3D-v0", num_envs=256,
    vectorization_mode="vector_entry_point")`. Seeds, options and autoreset modes are as of
    `usm_gym.envs.usm.USMVectorEnv`.
    """

    modes = SPATIAL_HEAD_MODES
