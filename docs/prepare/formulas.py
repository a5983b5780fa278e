"""Writes formulas as MathML, which browsers draw without a script."""

import re

from latex2mathml.converter import convert

from usm_gym.support.validation import require

# What GitHub takes, and what latex2mathml does instead.
DIALECT = {r"\cr": r"\\", "{aligned}": "{align*}"}
# Blocks of code and code in a line, which stay as they are; formulas of a block and of a line.
PLACE = re.compile(
    r"^(?P<fence> *```+).*?^(?P=fence)$|(?P<ticks>`+).+?(?P=ticks)"
    r"|\$\$(?P<block>.+?)\$\$|\$(?P<line>[^\s$](?:[^$\n]*[^\s$])?)\$",
    re.DOTALL | re.MULTILINE,
)
# What Markdown would read as its own marks between the tags.
MARKS = re.compile(r"[*_|`\[\]\\](?![^<]*>)")


def drawn(text):
    """A page with its formulas as MathML."""
    return PLACE.sub(replacement, text)


def replacement(match):
    """What stands for a piece of code or a formula."""
    if match["block"]:
        return mathml(match["block"], "block")
    # Without a frame, a formula that begins a paragraph would end it.
    return f"<span>{mathml(match['line'], 'inline')}</span>" if match["line"] else match[0]


def mathml(latex, display):
    """A formula as MathML on one line."""
    known = latex
    for ours, theirs in DIALECT.items():
        known = known.replace(ours, theirs)
    written = convert(known, display=display)
    # latex2mathml passes on what it does not know.
    known = "\\" not in written and "<mi>&</mi>" not in written
    require(known, "formula", latex, "what latex2mathml knows")
    return MARKS.sub(lambda mark: f"&#{ord(mark[0])};", written)
