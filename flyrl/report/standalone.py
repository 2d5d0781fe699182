"""The figures of a report as files of their own, for papers and slides."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final

_OF_A_TERRAIN: Final = {
    "gait": "gait",
    "distributions": "distributions",
    "paired": "differences",
}
"""Figure of a terrain's section: how its file begins."""


def named_figures(context: Mapping[str, Any]) -> dict[str, str]:
    """Every figure of a page, by a name of its own.

    Parameters
    ----------
    context
        What the page's template is given.

    Returns
    -------
    Name -> SVG as it stands in the page, e.g. `success`, `paths-flat`, `doses-flat-friction`.
    """
    figures = {"success": context["success_svg"]}
    for terrain in context["terrains"]:
        for key, name in _OF_A_TERRAIN.items():
            figures[f"{name}-{terrain['name']}"] = terrain.get(key, "")
        if terrain.get("paths"):
            figures[f"paths-{terrain['name']}"] = terrain["paths"]["figure"]
        for player in terrain.get("players", ()):
            if player["curves"]:
                figures[f"time-{terrain['name']}-{player['episode']}"] = player["curves"]["svg"]
        for dose in terrain["doses"]:
            figures[f"doses-{terrain['name']}-{dose['name']}"] = dose["figure"]
    figures["profiles"] = context["seeds"]["profiles"] if context["seeds"] else ""
    figures["drive-map"] = context["drive_map"]
    figures["steering"] = context["steering"]
    figures["learning-curves"] = context["curves"]
    return {name: svg for name, svg in figures.items() if svg}


def standalone(svg: str) -> str:
    """An SVG file from a figure that stands in a page.

    What only browsers know gives way to plain SVG 1.1: colours to their light values, references
    without a name space to `xlink:href`, a size that follows the page to one in points. Links into
    the page are left out.

    Raises
    ------
    ValueError
        It has no view box.
    """
    head, rest = svg.split(">", 1)
    box = re.search(r'viewBox="([^"]*)"', head)
    if box is None:
        raise ValueError(f"a figure needs a view box, got {head}>")
    width, height = box.group(1).split()[2:]
    rest = re.sub(r"var\(--\w+, (#[0-9a-f]{6})\)", r"\1", rest)
    rest = re.sub(r"</?a\b[^>]*>", "", rest)
    rest = rest.replace(' href="#', ' xlink:href="#')
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        f'version="1.1" width="{width}pt" height="{height}pt" {box.group()}>{rest}'
    )
