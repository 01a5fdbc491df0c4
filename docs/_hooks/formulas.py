"""LaTeX formulas as inline SVG, which needs no font, script or network and follows dark mode."""

import io
import re
from html import escape

from matplotlib import rc_context
from matplotlib.font_manager import FontProperties
from matplotlib.mathtext import math_to_image

INK = "#010203"
"""Placeholder colour that is replaced by the colour of the text."""

_LEFT_OUT = re.compile(r'<metadata>.*?</metadata>|<g id="patch_1">.*?</g>|<!--.*?-->', re.DOTALL)
"""Parts removed from the SVG: date of the build, white background, comments."""


def formula(source: str, *_: object, **__: object) -> str:
    """A block of code in the language `math` as an inline SVG."""
    line = " ".join(source.split())
    drawn = io.BytesIO()
    font = FontProperties(size=13, math_fontfamily="stix")
    # Glyphs as outlines, and the same element ids in every build.
    with rc_context({"svg.fonttype": "path", "svg.hashsalt": "rearl_jax"}):
        math_to_image(f"${line}$", drawn, prop=font, format="svg", color=INK)
    svg = drawn.getvalue().decode()
    svg = _LEFT_OUT.sub("", svg[svg.index("<svg") :]).replace(INK, "currentColor")
    svg = svg.replace("<svg ", f'<svg role="img" aria-label="{escape(line)}" ', 1)
    return f'<div class="formula">{svg}</div>'
