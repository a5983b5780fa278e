"""Accessibility of the page that a browser shows, by axe-core."""

from __future__ import annotations

from importlib import resources
from typing import Any

# Away meanwhile, as they are many: rows of a table beyond the third, which are like those before;
# the insides of formulas, which have the colour of the text around them; shapes that say nothing.
RUN = """
const done = arguments[arguments.length - 1];
const said = "text, title, a, [role], [tabindex], [aria-label]";
const shapes = `svg :is(defs, g, path, use):not(${said}, :has(${said}))`;
const away = [...document.querySelectorAll(`tbody > tr:nth-child(n + 4), math > *, ${shapes}`)];
const places = away.map((element) => [element.parentNode, element]);
away.forEach((element) => element.remove());
const end = (found) => {
  places.forEach(([parent, element]) => parent.append(element));
  done(found);
};
axe.run({resultTypes: ["violations"]})
  .then((found) => end(found.violations), (error) => end(String(error)));
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
