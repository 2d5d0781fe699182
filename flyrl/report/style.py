"""Style of figures: one look for all, colours for light and dark, SVG that stands inside a page."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Final, NamedTuple

import matplotlib as mpl
import pandas as pd
from matplotlib.axes import Axes
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
"""CSS variable: (light, dark). Figures are drawn in light; `themed` makes variables of that."""

INK: Final = THEME["ink"][0]
MUTED: Final = THEME["muted"][0]
LINE: Final = THEME["line"][0]
SHADES: Final = tuple(values[0] for name, values in THEME.items() if name.startswith("c"))
"""The controllers' colours, c0 to c7."""

LEG_SHADES: Final = tuple(SHADES[index] for index in (0, 4, 3, 1, 5, 2))
"""Colours of the legs, ordered as `anatomy.LEGS`."""

_FIXED: Final = {"cpg": 5, "rule_based": 2, "hybrid": 4, "pursuit": 3, "zero": 7}
_FREE: Final = (0, 1, 6)
_VARIABLES: Final = {light: name for name, (light, _) in THEME.items() if name != "panel"}


def colours(controllers: Iterable[str]) -> dict[str, str]:
    """Colour of every controller: the same in every report for the fixed ones."""
    names = list(dict.fromkeys(controllers))
    free = [name for name in names if name not in _FIXED]
    places = {name: _FREE[index % len(_FREE)] for index, name in enumerate(free)} | _FIXED
    return {name: SHADES[places[name]] for name in names}


def themed(text: str) -> str:
    """Replace colours of the theme by CSS variables with the light colour as fallback."""
    return re.sub(
        "|".join(_VARIABLES), lambda found: f"var(--{_VARIABLES[found[0]]}, {found[0]})", text
    )


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

STYLE: Final[Any] = {
    "text.parse_math": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "flyrl",
    "font.size": 10,
    "text.color": INK,
    "axes.edgecolor": LINE,
    "axes.labelcolor": MUTED,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.facecolor": "none",
    "figure.facecolor": "white",
    "axes.linewidth": 1,
    "xtick.color": LINE,
    "xtick.labelcolor": MUTED,
    "ytick.color": LINE,
    "ytick.labelcolor": MUTED,
    "axes.grid": True,
    "grid.color": LINE,
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "ytick.major.size": 0,
    "xtick.major.size": 0,
    "xtick.major.pad": 6,  # keeps the first labels of both axes apart
}
LIST_STYLE: Final[Any] = {
    **STYLE,
    "axes.spines.left": False,
    "ytick.labelcolor": INK,
    "axes.grid.axis": "x",
    "axes.titleweight": "bold",
}
"""Style of figures whose vertical axis is a list of names."""


@contextmanager
def panels(
    rows: int,
    columns: int,
    height: float,
    style: Any = STYLE,
    *,
    width: float = WIDTH_IN,
    kind: type[Figure] = Figure,
    **options: Any,
) -> Iterator[tuple[Figure, list[Axes]]]:
    """A figure and its panels, row by row; it must be drawn on inside `with`.

    Parameters
    ----------
    rows, columns
        Of panels.
    height, width
        Of the figure, inches.
    style
        Settings of matplotlib.
    kind
        Class of the figure.
    options
        As for `Figure.subplots`.
    """
    with mpl.rc_context(style):
        figure = kind(figsize=(width, height), layout="constrained")
        yield figure, list(figure.subplots(rows, columns, squeeze=False, **options).ravel())


def add_legend(figure: Figure, **options: Any) -> None:
    """Put the legend of the first panel below all panels, if it has named lines."""
    handles, labels = figure.axes[0].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, **{"loc": "outside lower left", "ncols": 6, **options})


_DOTS: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    SUCCESS: ("filled dot", {"marker": "o", "s": 14, "linewidths": 0}),
    TIMEOUT: ("ring", {"marker": "o", "s": 14, "linewidths": 0.9, "facecolors": "none"}),
    "fall": ("cross", {"marker": "x", "s": 16, "linewidths": 1.1}),
    "left_arena": ("triangle", {"marker": "^", "s": 16, "linewidths": 0.9, "facecolors": "none"}),
    "unstable": ("plus", {"marker": "+", "s": 22, "linewidths": 1.1}),
}
"""Shape of an episode's dot by outcome, in words and for matplotlib."""

_OWN_DOT: Final[tuple[str, dict[str, Any]]] = ("diamond", {"marker": "D", "s": 12, "linewidths": 0})
"""Shape of the dot for an outcome of a user's own task."""


def outcome_shapes(outcomes: Iterable[str]) -> str:
    """Shape of the dot of each outcome, in words."""
    return "; ".join(
        f"{_DOTS.get(outcome, _OWN_DOT)[0]}: {outcome_name(outcome)}" for outcome in outcomes
    )


def outcome_dot(outcome: str, shade: str) -> dict[str, Any]:
    """Arguments of `Axes.scatter` for episodes that ended so, in a colour."""
    style = _DOTS.get(outcome, _OWN_DOT)[1]
    return {**style, "edgecolors" if "facecolors" in style else "color": shade}


def episode_url(terrain: str, episode: int) -> str:
    """Address, within the page, of an episode in the table of all."""
    return f"#episode={terrain}/{episode}"


def svg_text(figure: Figure) -> str:
    """SVG file of a figure without a background, its text as text; dots may link into a page."""
    buffer = io.StringIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with mpl.rc_context(STYLE):
        figure.savefig(buffer, format="svg", facecolor="none", metadata=nothing)
    # a hundredth of a point is finer than any screen; scales of pictures are below 1
    svg = re.sub(r"\b0\.\d{5,}", lambda number: f"{float(number[0]):.4f}", buffer.getvalue())
    return re.sub(r"[1-9]\d*\.\d{3,}", lambda number: f"{float(number[0]):.2f}", svg)


def standalone(svg: str) -> str:
    """`svg_text` without the links into a page."""
    return re.sub(r"</?a\b[^>]*>", "", svg)


def inline(svg: str, name: str) -> str:
    """`svg_text` to stand inside a page, whose colours and width it takes.

    Parameters
    ----------
    name
        Of the figure, for its ids: pages hold many figures.
    """
    name = plain_name(name)
    head, rest = svg[svg.index("<svg") :].split(">", 1)
    rest = re.sub(r'\bid="', f'id="{name}-', rest)
    rest = rest.replace("url(#", f"url(#{name}-")
    # links lead to other parts of the page, not to figures
    rest = rest.replace("xlink:href", "href").replace(' target="_blank"', "")
    rest = rest.replace('<use href="#', f'<use href="#{name}-')
    # only the view box gives its shape
    box = re.findall(r'viewBox="[^"]*"', head)[0]
    return themed(f'<svg {box} xmlns="http://www.w3.org/2000/svg" role="img">{rest}')


class Plot(NamedTuple):
    """A figure of matplotlib, and the numbers that it shows: a row per point, say."""

    figure: Figure
    table: pd.DataFrame
