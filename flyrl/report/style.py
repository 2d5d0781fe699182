"""Style of figures: colours for light and dark, and SVG that stands inside a page."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple

import pandas as pd
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from flyrl.report.wording import outcome_name
from flyrl.tasks import SUCCESS, TIMEOUT
from flyrl.text import plain_name

THEME: Final[dict[str, tuple[str, str]]] = {
    "ink": ("#1d232b", "#e6e9ed"),
    "muted": ("#66707c", "#98a2ae"),
    "line": ("#dde1e6", "#333b45"),
    "panel": ("#ffffff", "#171c22"),
    "c0": ("#2563c9", "#6aa5ff"),
    "c1": ("#c2410c", "#ff9055"),
    "c2": ("#0f8a6d", "#41d1ab"),
    "c3": ("#b3296f", "#f37ab3"),
    "c4": ("#6d4bc3", "#b49bff"),
    "c5": ("#946200", "#e5b94d"),
    "c6": ("#0e7f9c", "#4cc7e6"),
    "c7": ("#7a828c", "#99a3af"),
}
"""Variable name: (light, dark). c0 to c7 are the controllers' colours."""

_MARKERS: Final = {name: f"#01fe{index:02x}" for index, name in enumerate(THEME)}
_FIXED: Final = {"cpg": "c5", "rule_based": "c2", "hybrid": "c4", "pursuit": "c3", "zero": "c7"}
_FREE: Final = ("c0", "c1", "c6")


def marker(name: str) -> str:
    """Colour that stands for the theme colour `name` while a figure is drawn."""
    return _MARKERS[name]


def colours(controllers: Sequence[str]) -> dict[str, str]:
    """Theme colour of every controller: the same in every report for the fixed ones."""
    free = [name for name in controllers if name not in _FIXED]
    chosen = {name: _FREE[index % len(_FREE)] for index, name in enumerate(free)}
    return {name: _FIXED.get(name) or chosen[name] for name in controllers}


def themed(svg: str) -> str:
    """Replace the marker colours of `svg` by CSS variables with the light colour as fallback."""
    for name, colour in _MARKERS.items():
        svg = re.sub(colour, f"var(--{name}, {THEME[name][0]})", svg, flags=re.IGNORECASE)
    return svg


def stylesheet() -> str:
    """CSS that gives the variables their light and dark values."""
    light = " ".join(f"--{name}: {value[0]};" for name, value in THEME.items())
    dark = " ".join(f"--{name}: {value[1]};" for name, value in THEME.items())
    return (
        f":root {{ color-scheme: light dark; {light} }}\n"
        f"@media (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}\n"
        f"@media print {{ :root {{ color-scheme: light; {light} }} }}\n"
    )


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


def light(name: str) -> str:
    """Light value of a theme colour."""
    return THEME[name][0]


PAPER_STYLE: Final[Any] = {
    **FRAMED_STYLE,
    "text.color": light("ink"),
    "axes.edgecolor": light("line"),
    "axes.labelcolor": light("muted"),
    "axes.facecolor": "white",
    "figure.facecolor": "white",
    "xtick.color": light("line"),
    "xtick.labelcolor": light("muted"),
    "ytick.color": light("line"),
    "ytick.labelcolor": light("muted"),
    "grid.color": light("line"),
    "axes.grid": True,
    # the first labels of both axes keep apart
    "xtick.major.pad": 6,
}

LEG_COLOURS: Final = ("c0", "c4", "c3", "c1", "c5", "c2")
"""Theme colours of the legs, ordered as `anatomy.LEGS`."""


class Plot(NamedTuple):
    """A figure, and the numbers that it shows.

    Attributes
    ----------
    figure
        Of matplotlib.
    table
        A row per point, or per whatever else it shows.
    """

    figure: Figure
    table: pd.DataFrame
