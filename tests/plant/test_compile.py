"""The kernel cache, and bits that do not depend on the processor."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import usm_gym
from usm_gym.plant import compile as compiling

PACKAGE = Path(usm_gym.__file__).parent
POSITIONS = """
import numpy as np
import usm_gym
from usm_gym.plant.motion import path_positions
positions = np.empty((16, 2))
path_positions(np.arange(16.0), 0.1, 0.2, 1.0, 2.0, positions)
misses = sum(path_positions.stats.cache_misses.values())
print(misses, usm_gym.__file__, *(float(x).hex() for x in positions.ravel()), sep="\\n")
"""
FLEET = """
import hashlib
import numpy as np
from usm_gym import Robot
from usm_gym.conditions import PRESETS
from usm_gym.scenario import sample
from usm_gym.simulation import Simulation
draw = np.random.default_rng(0)
for size in (1, 3):
    scenarios = [sample("operation", PRESETS["rough"], draw) for _ in range(size)]
    fleet = Simulation(Robot(), scenarios)
    for _ in range(100):
        fleet.step(draw.uniform(-1, 1, (size, 5)).astype(np.float32))
    state = np.concatenate([fleet.observation.ravel(), fleet.error.ravel(), fleet.theta.ravel()])
    print(hashlib.sha256(state.tobytes()).hexdigest())
"""


def run(code, **environment):
    answer = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(sys.executable).parent,
        env={**os.environ, **{key: str(value) for key, value in environment.items()}},
    )
    assert answer.returncode == 0, answer.stderr
    return answer.stdout.splitlines()


def test_a_warm_cache_is_used_and_an_edited_helper_is_not_served_stale(tmp_path):
    copy = tmp_path / "usm_gym"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    environment = {"PYTHONPATH": tmp_path, "NUMBA_CACHE_DIR": tmp_path / "cache"}
    cold = run(POSITIONS, **environment)
    warm = run(POSITIONS, **environment)
    assert cold[1] == warm[1] == str(copy / "__init__.py")
    assert (cold[0], warm[0]) == ("1", "0")
    assert cold[2:] == warm[2:]
    # A helper in another file than the kernel that was cached.
    helper = copy / "plant" / "elementary.py"
    source = helper.read_text()
    assert source.count("half = 0.5 * z") == 1
    helper.write_text(source.replace("half = 0.5 * z", "half = 0.25 * z"))
    edited = run(POSITIONS, **environment)
    assert edited[0] == "1"
    assert edited[2:] != warm[2:]


def test_a_processor_without_vector_or_fused_instructions_computes_the_same_bits(tmp_path):
    generic = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": tmp_path}
    assert run(FLEET, **generic) == run(FLEET)


def test_without_a_writable_folder_kernels_work_after_a_warning(monkeypatch, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    monkeypatch.setattr(compiling.numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(compiling.platformdirs, "user_cache_path", lambda name: blocked / name)
    monkeypatch.setattr(compiling.tempfile, "gettempdir", lambda: str(blocked))
    compiling.cache_folder.cache_clear()
    try:
        with pytest.warns(UserWarning, match="NUMBA_CACHE_DIR"):
            double = compiling.compiled(lambda x: 2.0 * x)
        assert double(2.0) == 4.0
    finally:
        compiling.cache_folder.cache_clear()


def test_an_unwritable_home_falls_back_to_the_temporary_directory(tmp_path):
    nowhere = tmp_path / "file"
    nowhere.write_text("no folder")
    code = "from usm_gym.plant.compile import cache_folder, PACKAGE; print(cache_folder(PACKAGE))"
    environment = {"HOME": nowhere, "XDG_CACHE_HOME": nowhere, "TMPDIR": tmp_path}
    assert run(code, **environment, NUMBA_CACHE_DIR="")[0].startswith(str(tmp_path))
