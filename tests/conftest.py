import os
from importlib import import_module, util

import pytest

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # windows of the tests appear on no screen


@pytest.fixture
def checkers():
    """The environment checkers of Gymnasium and, where it is installed, Stable-Baselines3."""
    packages = ["gymnasium.utils"]
    if util.find_spec("stable_baselines3"):
        packages.append("stable_baselines3.common")
    return [import_module(f"{package}.env_checker").check_env for package in packages]
