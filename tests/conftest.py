import os
import shutil
import subprocess
import sys
from datetime import timedelta
from importlib import import_module, util
from pathlib import Path

import pytest
from hypothesis import settings

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # windows of the tests appear on no screen

# How many examples of hostile input are tried: few in every run; HYPOTHESIS_PROFILE=long for many,
# each of which has ten seconds.
settings.register_profile("short", max_examples=25, deadline=None, derandomize=True)
settings.register_profile("long", max_examples=2000, deadline=timedelta(seconds=10))
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "short"))


def pytest_sessionstart(session):
    """Before all tests are run by several workers, compile what most of them need, once."""
    whole = session.config.args_source is pytest.Config.ArgsSource.TESTPATHS
    if (
        whole
        and session.config.getoption("dist", "no") != "no"
        and "PYTEST_XDIST_WORKER" not in os.environ
    ):
        script = Path(__file__).parent / "support" / "warm_up.py"
        parts = [subprocess.Popen([sys.executable, script, part]) for part in ("robots", "laws")]
        for part in parts:
            part.wait()


def pytest_collection_modifyitems(items):
    if sys.platform == "win32":
        for item in items:
            if item.get_closest_marker("posix"):
                item.add_marker(pytest.mark.skip(reason="Windows lacks what the test needs"))


@pytest.fixture
def checkers():
    """The environment checkers of Gymnasium and, where it is installed, Stable-Baselines3."""
    packages = ["gymnasium.utils"]
    if util.find_spec("stable_baselines3"):
        packages.append("stable_baselines3.common")
    return [import_module(f"{package}.env_checker").check_env for package in packages]


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """A headless browser, whose console is read after each page."""
    binary = next(filter(None, map(shutil.which, BROWSERS)), None)
    driver = shutil.which("chromedriver")
    if binary is None or driver is None:
        pytest.skip("no Chromium with chromedriver is installed")
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = binary
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    for name in (
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--enable-unsafe-swiftshader",  # draws WebGL without a graphics card
        "--disable-quic",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--no-first-run",
        f"--user-data-dir={tmp_path_factory.mktemp('browser')}",
    ):
        options.add_argument(name)
    opened = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    opened.set_script_timeout(60)
    yield opened
    opened.quit()
