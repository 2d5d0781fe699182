"""Colours of a report: names here, values for light and dark in one place.

Figures are drawn in a few marker colours that no figure needs otherwise. In the finished SVG they
become CSS variables, so that a figure inside the page follows its theme, and one on its own keeps
the light colours.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

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
