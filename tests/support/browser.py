"""Pages in a browser, driven by Selenium."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def show(browser: Any, path: Path, width: int = 1280, scheme: str = "light") -> None:
    """Open a page in a window of a width, and find no fault with it."""
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    media = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
    browser.get(path.as_uri())
    assert browser.get_log("browser") == []
    assert browser.execute_script("return performance.getEntriesByType('resource').length") == 0


def find(browser: Any, selector: str) -> Any:
    """The first element that a selector of CSS matches."""
    return browser.find_element("css selector", selector)
