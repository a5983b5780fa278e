"""Accessibility of the page that a browser shows, by axe-core."""

from __future__ import annotations

from importlib import resources
from typing import Any

# Without the inside of formulas: many elements, which have the colour of the text around them.
RUN = """
const done = arguments[arguments.length - 1];
axe.run({exclude: ["math *"]}, {resultTypes: ["violations"]})
  .then((found) => done(found.violations), (error) => done(String(error)));
"""


def violations(driver: Any) -> list[str]:
    """What axe-core finds wrong on the page that is loaded, a line for every element.

    Args:
        driver: A Selenium driver.

    Raises:
        RuntimeError: axe-core could not run.
    """
    if not driver.execute_script("return window.axe !== undefined"):
        # The package has a recent axe-core; its own classes are for another driver.
        script = resources.files("axe_playwright_python") / "axe.min.js"
        driver.execute_script(script.read_text(encoding="utf-8"))
    driver.set_script_timeout(100)  # s; pages of many thousand elements on a busy machine
    found = driver.execute_async_script(RUN)
    if isinstance(found, str):
        raise RuntimeError(found)
    return [
        " ".join(f"{rule['id']}: {node['html'][:120]}: {node['failureSummary']}".split())
        for rule in found
        for node in rule["nodes"]
    ]
