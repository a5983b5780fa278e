"""Formulas as MathML, which browsers draw without a script."""

import re
from html import unescape

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError

FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_content(html, **_):
    """Draw the formulas of a page."""
    return FORMULA.sub(lambda found: formula(unescape(found[2]), found[1] == "div"), html)


def formula(latex, block):
    """A formula as MathML."""
    # Of the two commands for a new row GitHub takes only \cr, latex2mathml only \\.
    drawn = convert(latex.replace(r"\cr", r"\\"), display="block" if block else "inline")
    if "\\" in drawn:
        raise PluginError(f"formula is {latex}; allowed: what latex2mathml knows")
    return drawn
