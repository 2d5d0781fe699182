"""How figures of a report look, and how they become SVG that stands inside a page."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable
from typing import Any, Final

from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from flyrl.report.palette import marker, themed
from flyrl.report.wording import outcome_name
from flyrl.rollouts import SUCCESS
from flyrl.tasks import TIMEOUT
from flyrl.text import plain_name

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
    "legend.frameon": False,
    "ytick.major.size": 0,
    "xtick.major.size": 0,
}
FRAMED_STYLE: Final[Any] = {
    **FIGURE_STYLE,
    "axes.spines.left": True,
    "ytick.labelcolor": marker("muted"),
}
"""Of figures whose vertical axis is a scale, not a list of names."""

_DOTS: Final[dict[str, dict[str, Any]]] = {
    SUCCESS: {"marker": "o", "s": 14, "linewidths": 0},
    TIMEOUT: {"marker": "o", "s": 14, "linewidths": 0.9, "facecolors": "none"},
    "fall": {"marker": "x", "s": 16, "linewidths": 1.1},
    "left_arena": {"marker": "^", "s": 16, "linewidths": 0.9, "facecolors": "none"},
    "unstable": {"marker": "+", "s": 22, "linewidths": 1.1},
}
"""How an episode's dot shows its outcome; one of a user's own is a diamond."""


_SHAPES: Final = {
    SUCCESS: "filled dot",
    TIMEOUT: "ring",
    "fall": "cross",
    "left_arena": "triangle",
    "unstable": "plus",
}


def outcome_shapes(outcomes: Iterable[str]) -> str:
    """Shape of the dot of each outcome, in words."""
    return "; ".join(
        f"{_SHAPES.get(outcome, 'diamond')}: {outcome_name(outcome)}" for outcome in outcomes
    )


def outcome_dot(outcome: str, shade: str) -> dict[str, Any]:
    """Arguments of `Axes.scatter` for episodes that ended so, in a colour."""
    style = _DOTS.get(outcome, {"marker": "D", "s": 12, "linewidths": 0})
    return {**style, "edgecolors" if "facecolors" in style else "color": shade}


def episode_url(terrain: str, episode: int) -> str:
    """Address, within the page, of an episode in the table of all."""
    return f"#episode={terrain}/{episode}"


def svg_text(figure: Figure, name: str) -> str:
    """SVG of `figure` without header and metadata; ids carry `name`, since pages hold many."""
    buffer = io.StringIO()
    FigureCanvasSVG(figure)
    figure.savefig(
        buffer, format="svg", metadata=dict.fromkeys(("Creator", "Date", "Format", "Type"))
    )
    svg = buffer.getvalue()
    return themed(_inline(svg[svg.index("<svg") :], plain_name(name)))


def _inline(svg: str, name: str) -> str:
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\bid="', f'id="{name}-', svg)
    # A hundredth of a point is finer than any screen.
    svg = re.sub(r"\d+\.\d{3,}", lambda number: f"{float(number.group()):.2f}", svg)
    svg = svg.replace("url(#", f"url(#{name}-")
    svg = svg.replace('<use xlink:href="#', f'<use href="#{name}-')
    # links lead to other parts of the page, not to figures
    svg = svg.replace("<a xlink:href", "<a href").replace(' target="_blank"', "")
    head, rest = svg.split(">", 1)
    view = re.search(r'viewBox="[^"]*"', head)
    # Scales with the page: only the view box gives its shape.
    box = view.group() if view else ""
    return f'<svg {box} xmlns="http://www.w3.org/2000/svg" role="img">{rest}'
