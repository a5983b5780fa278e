"""The environments of the paper's robot."""

from __future__ import annotations

from typing import Any

import gymnasium as gym

from usm_gym.envs.mode_env import ModeEnv, ModeVectorEnv
from usm_gym.task.observation import ObservationLayout
from usm_gym.task.scenario import MODES


class USMEnv(ModeEnv):
    """An underwater swimming manipulator whose centre of mass has to follow a path.

    Sixteen links, five thrusters. The thrusters hold the centre of mass on a slow path; in
    operation mode (`usm_gym:USM-Operation-v0`) the joints meanwhile bend the head side of the body
    one way, the other way and back, at about 10, 20 and 30 s, and so disturb it; in torpedo mode
    (`usm_gym:USM-Torpedo-v0`) the body is straight, the path faster, and the heading follows the
    line of sight. The score of an episode is the largest true position error per axis after
    settling.

    ## Action

    `Box(-1, 1, (5,), float32)`: commands of the thrusters over their limit (20 N in "field");
    values beyond saturate, a wrong shape or a value that is not a number raises `ValueError`.

    | index | thruster | positive force |
    |---|---|---|
    | 0 | link 1 (tail), along the link | towards the head |
    | 1 | link 3, across | to the left of the link |
    | 2 | link 6, across | to the left |
    | 3 | link 11, across | to the left |
    | 4 | link 14 (head side), across | to the left |

    ## Observation

    `Box(float32)` of 94 numbers, the same in both modes: physical value over scale. Every error is
    actual minus reference. Angles are never wrapped. The true velocity of the centre of mass, the
    current and the true coefficients are not observed.

    OBSERVATION_TABLE

    ## Reward

    r = -10 mean_axes |e| / (|e| + 0.02 m) - 0.25 |a| / (|a| + 20 deg)
    - 0.1 mean_thrusters |command| / limit, with the true position error e and the heading error a
    after the step. The step that loses the robot costs -10.35 for itself and for every step that
    remains, so that ending early never pays.

    ## Start

    Straight, at rest, on the reference. `reset(seed=...)` draws a scenario of the mode from
    `env.np_random`. `reset(options={"scenario": s})` takes s = "nominal" or "table1", under the
    environment's conditions, or a `Scenario` or its dict, which brings its own.

    ## End

    Truncation at the scenario's duration (40 s, 2000 steps; in "basin" and "sea" 60 s, 3000
    steps). Termination when the robot is lost: the true error exceeds 0.5 m in an axis, or the
    state is no longer finite; the observation is finite all the same.

    ## Info, at every step

    | key | unit | meaning |
    |---|---|---|
    | `error_x`, `error_y` | m | true position error |
    | `max_error_x`, `max_error_y` | m | its largest absolute value since settling; 0 before |
    | `heading_error` | rad | heading minus its reference, as known on board |
    | `thrust_effort` | N | mean absolute command of the thrusters |
    | `diverged` | 0 or 1 | whether the robot is lost |

    All values are `numpy.float64`, which is a `float`, so that JSON takes them.

    ## Arguments

    | argument | default | meaning |
    |---|---|---|
    | `conditions` | `"field"` | `"ideal"`, `"field"`, `"basin"`, `"sea"`, or a dict of fields |
    | `robot` | the paper's | a dict of `Robot` fields |
    | `render_mode` | None | `"rgb_array"`: `render()` gives an image of 640 x 480; `"human"`: a \
window shows every step in real time (drawing needs the extra `render`) |

    ## Version history

    - v0: first version; since 0.2.0 the heading is part of the reward, the physics step is of
      second order, and the observation has a measured velocity and the ages of measurements.
    """

    modes = MODES


# The class docstring is the specification; its table comes from the one that the code uses.
USMEnv.__doc__ = (USMEnv.__doc__ or "").replace(
    "OBSERVATION_TABLE", ObservationLayout(16, 5).table().replace("\n", "\n    ")
)


# Some clients, skrl for one, recognise a vector environment by its direct bases.
class USMVectorEnv(ModeVectorEnv, gym.vector.VectorEnv[Any, Any, Any]):
    """`num_envs` underwater swimming manipulators, each as in `USMEnv`, with the same bits.

    Made by `gym.make_vec("usm_gym:USM-Operation-v0", num_envs=256,
    vectorization_mode="vector_entry_point")`. Spaces, reward, start, end and info are those of
    `USMEnv` with a batch axis; robot i with seed s behaves as the single environment with seed s.

    `reset(seed=s)` gives robot i the seed s + i; a list gives each its own. The option "scenario"
    is for all robots, or a list with one per robot (None draws one); the option "reset_mask", a
    bool array, resets only some. All three autoreset modes are supported: "NextStep" (Gymnasium's
    default), "SameStep" with `final_obs` and `final_info`, and "Disabled".
    """

    modes = MODES
