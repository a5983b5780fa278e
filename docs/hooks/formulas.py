"""Writes formulas as MathML, which browsers draw without a script."""

import re
from html import unescape

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError

# What GitHub takes, and what latex2mathml does instead.
DIALECT = {r"\cr": r"\\", "{aligned}": "{align*}"}
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_content(html, **_):
    """Draw the formulas of a page."""
    return FORMULA.sub(lambda match: formula(unescape(match[2]), match[1] == "div"), html)


def formula(latex, block):
    """A formula as MathML."""
    known = latex
    for ours, theirs in DIALECT.items():
        known = known.replace(ours, theirs)
    drawn = convert(known, display="block" if block else "inline")
    # latex2mathml passes on what it does not know.
    if "\\" in drawn or "<mi>&</mi>" in drawn:
        raise PluginError(f"formula is {latex}; allowed: what latex2mathml knows")
    return drawn
