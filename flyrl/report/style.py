"""How figures of a report look, and how they become SVG that stands inside a page."""

from __future__ import annotations

import io
import re
from typing import Any, Final

from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from flyrl.report.palette import marker, themed

WIDTH_IN: Final = 9.6
"""Width of a figure, inches; pages scale it."""

FIGURE_STYLE: Final[Any] = {
    "text.parse_math": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "flyrl",
    "font.size": 10,
    "text.color": marker("ink"),
    "axes.edgecolor": marker("line"),
    "axes.labelcolor": marker("muted"),
    "axes.titlesize": 10,
    "axes.facecolor": "none",
    "figure.facecolor": "none",
    "axes.linewidth": 1,
    "xtick.color": marker("line"),
    "xtick.labelcolor": marker("muted"),
    "ytick.color": marker("line"),
    "ytick.labelcolor": marker("ink"),
    "grid.color": marker("line"),
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.spines.left": False,
    "ytick.major.size": 0,
    "xtick.major.size": 0,
}
FRAMED_STYLE: Final[Any] = {
    **FIGURE_STYLE,
    "axes.spines.left": True,
    "ytick.labelcolor": marker("muted"),
}
"""Of figures whose vertical axis is a scale, not a list of names."""


def svg_text(figure: Figure, name: str) -> str:
    """SVG of `figure` without header and metadata; ids carry `name`, since pages hold many."""
    buffer = io.StringIO()
    FigureCanvasSVG(figure)
    figure.savefig(
        buffer, format="svg", metadata=dict.fromkeys(("Creator", "Date", "Format", "Type"))
    )
    svg = buffer.getvalue()
    return themed(_inline(svg[svg.index("<svg") :], name))


def _inline(svg: str, name: str) -> str:
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\bid="', f'id="{name}-', svg)
    # A hundredth of a point is finer than any screen.
    svg = re.sub(r"\d+\.\d{3,}", lambda number: f"{float(number.group()):.2f}", svg)
    svg = svg.replace("url(#", f"url(#{name}-")
    svg = svg.replace('<use xlink:href="#', f'<use href="#{name}-').replace(
        "<a xlink:href", "<a href"
    )
    head, rest = svg.split(">", 1)
    view = re.search(r'viewBox="[^"]*"', head)
    # Scales with the page: only the view box gives its shape.
    box = view.group() if view else ""
    return f'<svg {box} xmlns="http://www.w3.org/2000/svg" role="img">{rest}'
