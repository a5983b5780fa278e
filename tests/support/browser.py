"""Pages in a browser, driven by Selenium."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from support.axe import violations

# Text of less contrast to its background than WCAG 2 asks for (AA).
FAINT = """
const channel = (v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
const numbers = (colour) => colour.match(/[\\d.]+/g).map(Number);
const light = ([r, g, b]) => 0.2126 * channel(r) + 0.7152 * channel(g) + 0.0722 * channel(b);
const ground = (node) => {
  for (; node; node = node.parentElement) {
    const colour = numbers(getComputedStyle(node).backgroundColor);
    if (colour.length === 3 || colour[3] > 0) return colour;
  }
  return [255, 255, 255];
};
const found = [];
for (const node of document.body.querySelectorAll("*")) {
  const own = [...node.childNodes].some((each) => each.nodeType === 3 && each.data.trim());
  if (!own || !node.getClientRects().length || node.closest("script, .skip")) continue;
  const style = getComputedStyle(node);
  const colour = node instanceof SVGElement ? style.fill : style.color;
  const [a, b] = [light(numbers(colour)), light(ground(node))];
  const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  if (contrast < 4.5) found.push([node.textContent.trim().slice(0, 40), contrast]);
}
return found;
"""
# What sticks out of the page, other than in a box of its own that scrolls.
BEYOND = """
const edge = document.documentElement.clientWidth + 0.5;
return [...document.querySelectorAll("body *")]
  .filter((each) => each.getBoundingClientRect().right > edge)
  .filter((each) => !each.closest(".scroll, .chart, .skip"))
  .map((each) => each.outerHTML.slice(0, 80));
"""
WIDER = """
const page = document.documentElement;
return page.scrollWidth !== page.clientWidth;
"""
# Letters smaller than this cannot be read, CSS pixels.
SMALLEST = """
return Math.min(...[...document.querySelectorAll("body *")]
  .filter((each) => each.getClientRects().length && each.textContent.trim())
  .map((each) => parseFloat(getComputedStyle(each).fontSize)));
"""


def show(browser: Any, path: Path, width: int = 1280, scheme: str = "light") -> None:
    """Open a page in a window of a width, and find no fault with it."""
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    media = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
    browser.get(path.as_uri())
    assert complaints(browser) == []
    assert browser.execute_script("return performance.getEntriesByType('resource').length") == 0


def complaints(browser: Any) -> list[str]:
    """What the console says, but for how fast WebGL is where no graphics card draws it."""
    said = [entry["message"] for entry in browser.get_log("browser")]
    return [message for message in said if "GL Driver Message" not in message]


def find(browser: Any, selector: str) -> Any:
    """The first element that a selector of CSS matches."""
    return browser.find_element("css selector", selector)


def drawn(browser: Any, selector: str) -> str:
    """What a canvas shows."""
    script = f"return document.querySelector('{selector}').toDataURL()"
    shown: str = browser.execute_script(script)
    return shown


def faults(browser: Any) -> list[str]:
    """What makes the page that is loaded hard to read or to use."""
    found = [f"beyond the page: {each}" for each in browser.execute_script(BEYOND)]
    found += [f"faint: {each}" for each in browser.execute_script(FAINT)]
    if browser.execute_script(WIDER):
        found.append("the page is wider than its window")
    if browser.execute_script(SMALLEST) < 11:
        found.append("small letters")
    return found + violations(browser)
