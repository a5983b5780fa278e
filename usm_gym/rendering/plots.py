"""How plots look, and how they are written (needs the extra `render`)."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from usm_gym.support.files import write_text

# Of Okabe and Ito, to be told apart by all eyes.
COLOURS = ("#0072b2", "#d55e00", "#56b4e9", "#009e73", "#cc79a7", "#e69f00")
STYLE: Any = {
    "svg.hashsalt": "usm-gym",  # equal figures make equal files
    "svg.fonttype": "none",
    "font.size": 9,
    "legend.frameon": False,
}
# Digits of a place after the second decimal.
SURPLUS = re.compile(r"(\.\d\d)\d+")


@contextmanager
def plotting(**style: Any) -> Iterator[None]:
    """Let pyplot draw without a screen and in one style, with what a figure has beside it."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    with plt.rc_context(STYLE | style):
        yield


def save(figure: Any, path: Path) -> None:
    """Write a figure as PNG and SVG, and forget it; `path` lacks the ending."""
    from matplotlib import pyplot as plt

    figure.savefig(path.with_suffix(".png"), dpi=120, metadata={"Software": None})
    drawn = io.StringIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None, "Creator": None})
    plt.close(figure)
    # A hundredth of a point is fine enough for a line, and makes a small file.
    short = re.sub(r' d="[^"]+"', lambda way: SURPLUS.sub(r"\1", way[0]), drawn.getvalue())
    write_text(path.with_suffix(".svg"), short)
