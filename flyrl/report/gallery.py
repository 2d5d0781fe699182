"""The figures of the literature, drawn anew, each with the numbers that it shows."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from flyrl.files import write_text
from flyrl.report import controller_figures as controllers
from flyrl.report.curves import save_figure
from flyrl.report.film import Film, write_film
from flyrl.report.scene_figures import muscle_plot, terrains_plot
from flyrl.report.style import Plot
from flyrl.report.walk_videos import WALKS, film_walk, film_worm
from flyrl.report.walking_figures import comparison_plot, gaits_plot, slopes_plot
from flyrl.resources import assets_folder
from flyrl.text import csv_table

Draw = Callable[[Path, str], None]
"""Writes the files of a figure into a folder; their names begin with the figure's."""


def _files(plot: Callable[[], Plot]) -> Draw:
    """What writes a plot as SVG, PNG and CSV."""

    def write(folder: Path, name: str) -> None:
        figure, table = plot()
        save_figure(figure, folder, name)
        write_text(folder / f"{name}.csv", csv_table(table, float_format="%.6g"))

    return write


def _muscle() -> Plot:
    return muscle_plot(assets_folder() / "muscles" / "human.png")


def _video(film: Callable[[], Film]) -> Draw:
    """What writes a video as MP4, its poster as JPEG, and CSV."""

    def write(folder: Path, name: str) -> None:
        write_film(film(), folder, name)

    return write


GALLERY: Final[Mapping[str, Draw]] = {
    "cpg_three": _files(controllers.three_oscillators_plot),
    "cpg_tripod": _files(controllers.tripod_plot),
    "steps": _files(controllers.steps_plot),
    "steps_magnitude": _files(controllers.steps_magnitude_plot),
    "adhesion": _files(controllers.adhesion_plot),
    "rules_graph": _files(controllers.rules_graph_plot),
    "rules": _files(controllers.rules_plot),
    "terrains": _files(terrains_plot),
    "turn": _files(controllers.turn_plot),
    "gaits": _files(gaits_plot),
    "slopes": _files(slopes_plot),
    "comparison": _files(comparison_plot),
    "muscle": _files(_muscle),
    **{name: _video(functools.partial(film_walk, walk)) for name, walk in WALKS.items()},
    "worm": _video(film_worm),
}
"""What writes each figure, by the figure's name.

A figure that cannot be drawn on this machine raises `RenderingUnavailableError`, RuntimeError or
OSError.
"""
