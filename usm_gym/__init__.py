"""Gymnasium environments of an underwater swimming manipulator, and their scoring."""

from importlib.metadata import version

from usm_gym.dynamics import accelerations
from usm_gym.evaluation import Evaluation, evaluate
from usm_gym.head_world import HeadWorld
from usm_gym.linear_model import LinearModel, linearise
from usm_gym.planar_world import PlanarWorld
from usm_gym.registration import register_environments
from usm_gym.robot import Robot, Thruster
from usm_gym.spatial_dynamics import spatial_accelerations
from usm_gym.spatial_robot import Link, SpatialRobot, SpatialThruster
from usm_gym.spatial_vehicle import SpatialVehicle
from usm_gym.spatial_world import SpatialWorld
from usm_gym.statistics import compare
from usm_gym.suites import suite
from usm_gym.task.conditions import Conditions
from usm_gym.task.head_path import HeadPath
from usm_gym.task.head_scenario import HeadScenario, SpatialHeadScenario
from usm_gym.task.metrics import max_error
from usm_gym.task.scenario import Inspection, Path, Scenario
from usm_gym.task.spatial_scenario import Scan, SpatialPath, SpatialScenario
from usm_gym.task.spatial_water import SpatialWater, SpatialWave
from usm_gym.task.water import Water, Wave
from usm_gym.vehicle import Vehicle

__all__ = [
    "Conditions",
    "Evaluation",
    "HeadPath",
    "HeadScenario",
    "HeadWorld",
    "Inspection",
    "LinearModel",
    "Link",
    "Path",
    "PlanarWorld",
    "Robot",
    "Scan",
    "Scenario",
    "SpatialHeadScenario",
    "SpatialPath",
    "SpatialRobot",
    "SpatialScenario",
    "SpatialThruster",
    "SpatialVehicle",
    "SpatialWater",
    "SpatialWave",
    "SpatialWorld",
    "Thruster",
    "Vehicle",
    "Water",
    "Wave",
    "accelerations",
    "compare",
    "evaluate",
    "linearise",
    "max_error",
    "spatial_accelerations",
    "suite",
]
__version__ = version("usm-gym")

register_environments()
