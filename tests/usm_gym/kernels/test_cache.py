"""The kernel cache, and bits that do not depend on the processor."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import usm_baselines

import usm_gym
from usm_gym.kernels import cache
from usm_gym.kernels.compile import compiled

PACKAGES = [Path(package.__file__).parent for package in (usm_gym, usm_baselines)]
POSITIONS = """
import numpy as np
import usm_baselines
import usm_gym
from usm_gym.task.guidance import path_positions
positions = np.empty((16, 2))
path_positions(np.arange(16.0), 0.1, 0.2, 1.0, 2.0, positions)
misses = sum(path_positions.stats.cache_misses.values())
print(misses, usm_gym.__file__, *(float(x).hex() for x in positions.ravel()), sep="\\n")
"""
FLEET = """
import hashlib
import numpy as np
from usm_gym import Robot
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import sample
from usm_gym.simulation import Simulation
draw = np.random.default_rng(0)
for size in (1, 3):
    scenarios = [sample("operation", PRESETS["sea"], draw) for _ in range(size)]
    fleet = Simulation(scenarios)
    for _ in range(100):
        fleet.step(draw.uniform(-1, 1, (size, 5)).astype(np.float32))
    state = [fleet.observation.ravel(), fleet.error.ravel(), fleet.read("theta").ravel()]
    state = np.concatenate(state)
    print(hashlib.sha256(state.tobytes()).hexdigest())
"""


def run(code, **environment):
    # Python tells sources by size and second, and tests edit theirs faster: they keep no bytecode.
    environment["PYTHONDONTWRITEBYTECODE"] = 1
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


@pytest.fixture
def copy(tmp_path):
    """Copies of our packages that are imported in their place, and the environment for that."""
    for package in PACKAGES:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(package, tmp_path / package.name, ignore=ignored)
    return tmp_path, {"PYTHONPATH": tmp_path, "NUMBA_CACHE_DIR": tmp_path / "cache"}


def edit(file, old, new):
    source = file.read_text()
    assert source.count(old) == 1
    file.write_text(source.replace(old, new))


@pytest.mark.slow
def test_a_warm_cache_is_used_and_an_edited_helper_is_not_served_stale(copy):
    folder, environment = copy
    cold = run(POSITIONS, **environment)
    warm = run(POSITIONS, **environment)
    assert cold[1] == warm[1] == str(folder / "usm_gym" / "__init__.py")
    assert (cold[0], warm[0]) == ("1", "0")
    assert cold[2:] == warm[2:]
    # A helper in another file than the kernel that was cached.
    edit(folder / "usm_gym" / "kernels" / "elementary.py", "half = 0.5 * z", "half = 0.25 * z")
    edited = run(POSITIONS, **environment)
    assert edited[0] == "1"
    assert edited[2:] != warm[2:]


LAWS = """
import numpy as np
from usm_baselines.laws.pd import PDGains, pd
from usm_baselines.laws.pid import PIDGains, pid
from usm_baselines.signals import Signals

y, u, velocity, acceleration = (np.full((1, 2), 0.1 * (k + 1)) for k in range(4))
none = np.zeros((1, 2))
signals = Signals(
    np.ones(1), np.ones(1, np.bool_), False, y, none, none, none, u, velocity, acceleration,
    np.zeros((1, 3, 3)), np.zeros((1, 1), np.float32),
)
for law, arguments in ((pd, (PDGains(), 0)), (pid, (PIDGains(),))):
    state, force = np.full((1, 2, 4), 0.01), np.empty((1, 2))
    law(signals, 0.02, 10.0, *arguments, state, force)
    print(sum(law.stats.cache_misses.values()), float(force[0, 0]).hex())
"""


@pytest.mark.slow
def test_an_edit_recompiles_the_kernels_that_use_it_and_no_others(copy):
    folder, environment = copy
    (cold_pd, force_pd), (cold_pid, force_pid) = map(str.split, run(LAWS, **environment))
    assert (cold_pd, cold_pid) == ("1", "1")
    assert run(LAWS, **environment) == [f"0 {force_pd}", f"0 {force_pid}"]
    edit(
        folder / "usm_baselines" / "estimation" / "observer.py",
        "state[2] += h * k3 * xi",
        "state[2] += h * xi",
    )
    (misses, force), other = map(str.split, run(LAWS, **environment))
    assert misses == "1"
    assert force != force_pd
    assert other == ["0", force_pid]


OWN = """
import my_laws.law
force = my_laws.law.force(2.0)
print(sum(my_laws.law.force.stats.cache_misses.values()), force)
"""


@pytest.mark.slow
def test_kernels_of_other_packages_notice_edits_in_all_their_folders(tmp_path):
    sources = {
        "my_laws/__init__.py": "",
        "my_laws/parts/__init__.py": "",
        "my_laws/parts/gains.py": "GAIN = 3.0\n",
        "my_laws/parts/proportional.py": "from .gains import GAIN\n"
        "from usm_gym.kernels.compile import piece\n\n\n"
        "@piece\ndef proportional(x):\n    return GAIN * x\n",
        "my_laws/law.py": "from usm_gym.kernels.compile import compiled\n"
        "from .parts import proportional as part\n\nproportional = part.proportional\n\n\n"
        "@compiled\ndef force(x):\n    return proportional(x)\n",
    }
    for name, source in sources.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(source)
    environment = {"PYTHONPATH": tmp_path, "NUMBA_CACHE_DIR": tmp_path / "cache"}
    assert [run(OWN, **environment)[0] for _ in range(2)] == ["1 6.0", "0 6.0"]
    (tmp_path / "my_laws" / "parts" / "gains.py").write_text("GAIN = 4.0\n")
    assert run(OWN, **environment) == ["1 8.0"]
    # What no kernel uses recompiles none.
    (tmp_path / "my_laws" / "parts" / "gains.py").write_text("# a comment\nGAIN = 4.0\nOTHER = 1\n")
    (tmp_path / "my_laws" / "parts" / "__init__.py").write_text("import os\n")
    assert run(OWN, **environment) == ["0 8.0"]


IMPORTS = {
    "import os, constants\nGAIN = constants.GAIN": "GAIN",
    "if True:\n    from constants import GAIN": "GAIN",
    "from constants import (  # a comment)\n    GAIN,\n)": "GAIN",
    "import sys; from constants import \\\n    GAIN": "GAIN",
    "from constants import *": "GAIN",
    "import constants as c": "c.GAIN",
}


@pytest.mark.slow
def test_a_constant_of_any_package_is_noticed_however_it_is_imported(tmp_path):
    laws = [f"law_{k}" for k in range(len(IMPORTS))]
    for law, (imported, gain) in zip(laws, IMPORTS.items(), strict=True):
        head = f"{imported}\nfrom usm_gym.kernels.compile import compiled\n\n\n"
        (tmp_path / f"{law}.py").write_text(
            f"{head}@compiled\ndef force(x):\n    return {gain} * x\n\n\nprint(force(2.0))\n"
        )
    environment = {"PYTHONPATH": tmp_path, "NUMBA_CACHE_DIR": tmp_path / "cache"}
    for value in (3.0, 4.0):
        (tmp_path / "constants.py").write_text(f"GAIN = {value}\n")
        answers = run(f"import {', '.join(laws)}", **environment)
        assert answers == len(laws) * [str(2.0 * value)]


SHARED = """
import my_laws.law, my_laws.gains
gains = my_laws.gains.Gains(a=5.0, inner=my_laws.gains.Inner(x=1.0, y=0.0), b=3.0)
print(my_laws.law.difference(gains))
"""


@pytest.mark.parametrize(("old", "new"), [("a, inner, b", "b, inner, a"), ("x, y", "y, x")])
def test_fields_that_change_places_are_noticed_by_kernels_that_do_not_import_them(
    old, new, tmp_path
):
    folder = tmp_path / "my_laws"
    folder.mkdir()
    gains = "from collections import namedtuple\n"
    gains += 'Gains = namedtuple("Gains", "a, inner, b")\nInner = namedtuple("Inner", "x, y")\n'
    (folder / "__init__.py").touch()
    (folder / "gains.py").write_text(gains)
    (folder / "law.py").write_text(
        "from usm_gym.kernels.compile import compiled\n\n\n"
        "@compiled\ndef difference(gains):\n"
        "    return gains.a - gains.b + 10.0 * gains.inner.x\n"
    )
    environment = {"PYTHONPATH": tmp_path, "NUMBA_CACHE_DIR": tmp_path / "cache"}
    assert run(SHARED, **environment) == ["12.0"]
    edit(folder / "gains.py", f'"{old}"', f'"{new}"')
    assert run(SHARED, **environment) == ["12.0"]


@pytest.mark.slow
def test_a_processor_without_vector_or_fused_instructions_computes_the_same_bits(tmp_path):
    generic = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": tmp_path}
    assert run(FLEET, **generic) == run(FLEET)


@pytest.fixture
def fresh():
    """Let the cache folder be looked for anew, in this test and after it."""
    caches = cache.cache_folder, cache._warn_of_no_cache
    for each in caches:
        each.cache_clear()
    yield
    for each in caches:
        each.cache_clear()


def test_without_a_writable_folder_kernels_work_after_a_warning(fresh, monkeypatch, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    monkeypatch.setattr(cache.numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(cache.platformdirs, "user_cache_path", lambda name: blocked / name)
    monkeypatch.setattr(cache.tempfile, "gettempdir", lambda: str(blocked))
    with pytest.warns(UserWarning, match="NUMBA_CACHE_DIR"):
        double = compiled(lambda x: 2.0 * x)
    assert double(2.0) == 4.0


def test_an_unwritable_home_falls_back_to_the_temporary_directory(tmp_path):
    nowhere = tmp_path / "file"
    nowhere.write_text("no folder")
    code = "from usm_gym.kernels.cache import cache_folder; print(cache_folder('0123'))"
    environment = {"HOME": nowhere, "XDG_CACHE_HOME": nowhere, "TMPDIR": tmp_path}
    assert run(code, **environment, NUMBA_CACHE_DIR="")[0].startswith(str(tmp_path))


HOMELESS = """
import pwd, tempfile

def nobody(number):
    raise KeyError(number)

def nowhere():
    raise FileNotFoundError("no usable temporary directory")

pwd.getpwuid, tempfile.gettempdir = nobody, nowhere
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "getuid"), reason="users without a home are of POSIX")
@pytest.mark.parametrize("given", [True, False])
def test_a_user_without_home_or_temporary_folder_needs_neither(given, tmp_path):
    environment = {key: os.environ[key] for key in ("PATH",) if key in os.environ}
    if given:
        environment["NUMBA_CACHE_DIR"] = str(tmp_path)
    answer = subprocess.run(
        [sys.executable, "-c", HOMELESS + POSITIONS],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(sys.executable).parent,
        env=environment,
    )
    assert answer.returncode == 0, answer.stderr
    assert answer.stderr.count("UserWarning") == (0 if given else 1)
    assert bool(list(tmp_path.rglob("*.nbi"))) == given


@pytest.fixture
def temporary(fresh, monkeypatch, tmp_path):
    """A temporary folder that many share, the only place for a cache."""
    shared = tmp_path.resolve() / "tmp"
    shared.mkdir()
    shared.chmod(0o1777)
    monkeypatch.setattr(cache.numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(cache.platformdirs, "user_cache_path", lambda name: Path("~") / name)
    monkeypatch.setattr(cache.tempfile, "gettempdir", lambda: str(shared))
    return shared


only_posix = pytest.mark.skipif(not hasattr(os, "getuid"), reason="owners and modes are of POSIX")


@only_posix
def test_a_cache_in_the_shared_temporary_folder_is_the_users_alone(temporary):
    folder = Path(cache.cache_folder("0123"))
    assert folder.parent == temporary / f"usm-gym-{os.getuid()}"
    for each in (folder, folder.parent):
        assert each.stat().st_mode & 0o777 == 0o700


@only_posix
@pytest.mark.parametrize(
    "trap",
    ["link", "writable", "not sticky", "link to a cache", "writable cache", "owner", "owner above"],
)
def test_a_trap_in_the_shared_temporary_folder_is_not_used(trap, temporary, tmp_path, monkeypatch):
    base = temporary / f"usm-gym-{os.getuid()}"
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    base.mkdir(mode=0o700)
    if trap == "link":
        base.rmdir()
        base.symlink_to(elsewhere)
    elif trap == "writable":
        base.chmod(0o777)
    elif trap == "not sticky":
        temporary.chmod(0o777)
    elif trap == "link to a cache":
        name = Path(cache.cache_folder("0123")).name
        cache.cache_folder.cache_clear()
        (base / name).rmdir()
        (base / name).symlink_to(elsewhere)
    elif trap == "writable cache":
        name = Path(cache.cache_folder("0123")).name
        cache.cache_folder.cache_clear()
        (base / name).chmod(0o777)
    else:
        lstat = Path.lstat
        owned = {"owner": base, "owner above": temporary}[trap]

        def other(path):
            found = list(lstat(path))
            found[4] = os.getuid() + 1 if path == owned else found[4]
            return os.stat_result(found)

        monkeypatch.setattr(Path, "lstat", other)
    with pytest.warns(UserWarning, match="no safe and writable cache folder") as caught:
        folders = [cache.cache_folder.__wrapped__("0123") for _ in range(2)]
    assert folders == [None, None]
    assert len(caught) == 1
    assert list(elsewhere.iterdir()) == []


@pytest.fixture(scope="module")
def compiled_once(tmp_path_factory):
    """A cache folder, and what was computed as it was filled."""
    folder = tmp_path_factory.mktemp("compiled")
    return folder, run(POSITIONS, NUMBA_CACHE_DIR=folder)[2:]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("suffix", "damage"),
    [("nbi", "truncated"), ("nbi", "garbage"), ("nbc", "truncated"), ("nbc", "empty")],
)
def test_a_damaged_file_of_the_cache_is_named_and_replaced(suffix, damage, compiled_once, tmp_path):
    filled, numbers = compiled_once
    shutil.copytree(filled, tmp_path, dirs_exist_ok=True)
    (damaged,) = tmp_path.rglob(f"guidance.path_positions-*.{suffix}")
    data = damaged.read_bytes()
    kept = {"truncated": data[: len(data) // 2], "empty": b"", "garbage": bytes(len(data))}
    damaged.write_bytes(kept[damage])
    answer = subprocess.run(
        [sys.executable, "-W", "always", "-c", POSITIONS],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(sys.executable).parent,
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
    )
    assert answer.returncode == 0, answer.stderr
    assert answer.stderr.count(f"UserWarning: {damaged} is damaged") == 1
    assert answer.stderr.count("is damaged") == 1
    assert answer.stdout.splitlines()[2:] == numbers
    assert damaged.read_bytes() != kept[damage]
    assert run(POSITIONS, NUMBA_CACHE_DIR=tmp_path)[0] == "0"
