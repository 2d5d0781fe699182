"""The report: one HTML file that needs nothing else."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from flyrl.envs.record import randomisation_text
from flyrl.evaluation.drive_map import DriveMap
from flyrl.evaluation.metrics import METRICS, compared_metrics
from flyrl.evaluation.results import Results
from flyrl.files import write_text
from flyrl.report.curves import Evaluations
from flyrl.report.figures import METRIC_LABELS, success_figure
from flyrl.report.learning import curves_section, generalisation_section
from flyrl.report.origin import origin_json
from flyrl.report.palette import colours, stylesheet
from flyrl.report.sections import (
    drive_map_section,
    seeds_section,
    spread_metrics,
    study_section,
    table_row,
    terrain_section,
    usual_rows,
)
from flyrl.report.video import Video
from flyrl.report.wording import format_number, headline, title
from flyrl.rollouts import EpisodeRecord

REPORT_FILE: Final = "report.html"


def write_report(
    results: Results,
    folder: str | Path,
    *,
    videos: Sequence[Video] = (),
    examples: Sequence[EpisodeRecord] = (),
    drive_map: DriveMap | None = None,
    curves: Mapping[str, Evaluations] | None = None,
    note: str | None = None,
) -> Path:
    """Write `report.html` to `folder`, whole or not at all, and return its path.

    Parameters
    ----------
    results
        What to report.
    videos
        Shown in the section of their terrain.
    examples
        Episodes with a log of the gait, whose diagrams are shown in the section of their terrain.
    drive_map
        Shown with the drives that the learned policies chose on top.
    curves
        What held-out evaluations during training came to, by name of the entrant; its rows have
        `decisions`, `success_rate` and `mean_return`.
    note
        Said where videos would be, e.g. why there are none.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / REPORT_FILE
    text = format_report(
        results, videos=videos, examples=examples, drive_map=drive_map, curves=curves, note=note
    )
    write_text(path, text)
    return path


def format_report(
    results: Results,
    *,
    videos: Sequence[Video] = (),
    examples: Sequence[EpisodeRecord] = (),
    drive_map: DriveMap | None = None,
    curves: Mapping[str, Evaluations] | None = None,
    note: str | None = None,
) -> str:
    """Text of the report; see `write_report`."""
    environment = Environment(
        loader=PackageLoader("flyrl.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = format_number
    walked = [row["controller"] for row in results.summary]
    entered = [entrant["name"] for entrant in results.protocol["entrants"]]
    names = list(dict.fromkeys([*walked, *entered]))
    usual = usual_rows(results)
    sentence, detail = headline(usual, results.protocol)
    return environment.get_template("report.html.j2").render(
        title=title(results.protocol, results.summary),
        headline=sentence,
        detail=detail,
        protocol=results.protocol,
        stylesheet=Markup(stylesheet()),
        colours=colours(names),
        metrics=METRICS,
        shown=[*spread_metrics(results.protocol), "path_efficiency"],
        compared=compared_metrics(results.protocol["task"]),
        labels=METRIC_LABELS,
        success_svg=Markup(success_figure(usual)),
        rows=[table_row(row) for row in results.summary],
        terrains=[
            terrain_section(results, terrain["name"], videos, examples)
            for terrain in results.protocol["terrains"]
        ],
        note=note,
        drive_map=Markup(drive_map_section(results, drive_map)),
        is_varied=bool(results.protocol["vary"]),
        crashes=results.protocol["crashes"],
        study=study_section(results),
        seeds=seeds_section(results),
        generalisation=generalisation_section(results),
        curves=curves_section(results.protocol["entrants"], curves or {}),
        origin=Markup(origin_json(results)),
        entrants=results.protocol["entrants"],
        physics=json.dumps(results.protocol["physics"], indent=1),
        randomisation=randomisation_text(results.protocol.get("randomisation")),
    )
