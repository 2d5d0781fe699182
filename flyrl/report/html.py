"""The report: one HTML file that needs nothing else."""

from __future__ import annotations

import base64
import hashlib
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, TypedDict, Unpack

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from flyrl.envs.record import randomisation_text
from flyrl.evaluation.conditions import compared_conditions
from flyrl.evaluation.drive_map import DriveMap, Steering
from flyrl.evaluation.metrics import descriptions, metric_label, metric_named
from flyrl.evaluation.results import Results
from flyrl.files import OutputFolder
from flyrl.report.close_up import steering_figure
from flyrl.report.curves import Evaluations
from flyrl.report.episodes import episodes_section
from flyrl.report.exports import format_tables, named_figures, standalone
from flyrl.report.figures import success_figure
from flyrl.report.sections import (
    all_leaders,
    drive_map_section,
    seeds_section,
    spread_metrics,
    study_section,
    table_row,
    terrain_section,
    usual_rows,
)
from flyrl.report.setup import (
    control_loop,
    curves_section,
    generalisation_section,
    origin_json,
    trainings_section,
)
from flyrl.report.style import colours, outcome_shapes, stylesheet
from flyrl.report.video import Video
from flyrl.report.wording import (
    changes_text,
    condition_text,
    effects_text,
    format_number,
    headline,
    held_out_text,
    leader_cells,
    leaders_by_condition,
    level_text,
    outcome_name,
    parameters_text,
    rates,
    shared_text,
    title,
    training_note,
)
from flyrl.rollouts import EpisodeRecord
from flyrl.tasks import SUCCESS, TIMEOUT
from flyrl.text import plain_name, printable

REPORT_FILE: Final = "report.html"
FIGURES_FOLDER: Final = "figures"
TABLES_FOLDER: Final = "tables"


class Additions(TypedDict, total=False):
    """What a report can show beside results.

    Attributes
    ----------
    videos
        Shown on the page of their terrain.
    examples
        Episodes with a log of the gait, whose diagrams are shown on the page of their terrain.
    drive_map
        Shown with the drives that the learned policies chose on top.
    steering
        Drives of policies over the bearing.
    curves
        Evaluations during training, by the names of learned policies.
    note
        Said where videos would be, e.g. why there are none.
    """

    videos: Sequence[Video]
    examples: Sequence[EpisodeRecord]
    drive_map: DriveMap | None
    steering: Steering | None
    curves: Mapping[str, Evaluations]
    note: str | None


def write_report(results: Results, folder: str | Path, **additions: Unpack[Additions]) -> Path:
    """Write `report.html` to `folder`, whole or not at all, and return its path.

    Beside it go the figures as SVG and the tables as CSV and LaTeX, in folders of their own. Where
    those cannot be written, a warning on stderr says so.

    Parameters
    ----------
    results
        What to report.
    additions
        See `Additions`.

    Raises
    ------
    OSError
        The report cannot be written.
    """
    output = OutputFolder(folder)
    context = report_context(results, **additions)
    output.write_text(REPORT_FILE, format_page(context))
    figures = {
        f"{FIGURES_FOLDER}/{plain_name(name)}.svg": standalone(svg)
        for name, svg in named_figures(context).items()
    }
    tables = {
        f"{TABLES_FOLDER}/{name}": text
        for name, text in format_tables(results, context["all_leaders"]).items()
    }
    earlier = {*output.files(FIGURES_FOLDER), *output.files(TABLES_FOLDER)}
    output.remove(*(earlier - figures.keys() - tables.keys()))
    try:
        for name, text in {**figures, **tables}.items():
            output.write_text(name, text)
    except OSError as error:
        print(f"warning: the report lacks figures or tables beside it: {error}", file=sys.stderr)
    return output.path / REPORT_FILE


def format_report(results: Results, **additions: Unpack[Additions]) -> str:
    """Text of a report with no files beside it; see `write_report`."""
    return format_page({**report_context(results, **additions), "folders": None})


def format_page(context: Mapping[str, Any]) -> str:
    """Text of the page, from what `report_context` gives."""
    environment = Environment(
        loader=PackageLoader("flyrl.report"),
        autoescape=True,
        finalize=_shown,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = format_number
    environment.filters["script_hash"] = script_hash
    return environment.get_template("report.html.j2").render(context)


def _shown(value: Any) -> Any:
    """Value as it stands in the page: texts of others cannot turn the reading direction round."""
    is_text = isinstance(value, str) and not isinstance(value, Markup)
    return printable(value, keep="\n\t\u00a0") if is_text else value


def script_hash(script: str) -> str:
    """Source expression by which a Content-Security-Policy allows this inline script alone."""
    return f"sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}"


def report_context(results: Results, **additions: Unpack[Additions]) -> dict[str, Any]:
    """All that the page's template is given; see `write_report`."""
    videos, examples = additions.get("videos", ()), additions.get("examples", ())
    walked = [row["controller"] for row in results.summaries]
    entered = [entrant["name"] for entrant in results.protocol["entrants"]]
    names = list(dict.fromkeys([*walked, *entered]))
    usual = usual_rows(results)
    usual_condition = compared_conditions(results.protocol["vary"])[0]
    leaders = all_leaders(results)
    usual_leaders = [each for each in leaders if each.condition == usual_condition.label]
    table, steering = results.protocol.get("table"), additions.get("steering")
    decisive = results.protocol["decisive"]
    measured = results.summaries[0]["metrics"]
    labels = {metric: metric_label(metric) for metric in ("success", *measured)}
    effects = effects_text(decisive, labels, results.protocol)
    if (table or {}).get("actions") == "neurons":
        labels["drive_variation"] = "change of tensions (1/s)"
    outcomes = [
        *(table or {}).get("failures", ()),
        *(name for row in results.summaries for name, count in row["outcomes"].items() if count),
    ]
    failures = [each for each in dict.fromkeys(outcomes) if each not in (SUCCESS, TIMEOUT)]
    controllers = len({row["controller"] for row in usual})
    comparing = [changes_text(leaders, usual_condition.label), level_text(effects)]
    if controllers < 2:
        comparing.clear()
    return {
        "title": title(results.protocol, results.summaries),
        "headline": headline(usual_leaders, controllers, condition_text(usual_condition)),
        "notes": list(filter(None, [*comparing, training_note(results.protocol)])),
        "condition": condition_text(usual_condition),
        "shared": shared_text(results.protocol, results.drawn),
        "held_out": held_out_text(results.protocol),
        "effects": effects,
        "detail": rates(usual, results.protocol) if decisive[0] == "success" else "",
        "leaders": [(leader, leader_cells(leader)) for leader in usual_leaders],
        "all_leaders": leaders,
        "leaders_by_condition": leaders_by_condition(leaders),
        "decisive": decisive,
        "lower_is_better": [metric for metric in measured if metric_named(metric).lower_is_better],
        "protocol": results.protocol,
        "folders": {"figures": FIGURES_FOLDER, "tables": TABLES_FOLDER},
        "stylesheet": Markup(stylesheet()),
        "colours": colours(names),
        "metrics": {
            metric: text
            for metric, text in descriptions(results.protocol).items()
            if metric in measured and any(row["metrics"][metric]["n"] for row in results.summaries)
        },
        "shown": [*spread_metrics(results.protocol), "path_efficiency"],
        "compared": results.protocol["compared"],
        "labels": labels,
        "success_svg": Markup(success_figure(usual, condition_text(usual_condition))),
        "rows": [table_row(row) for row in usual],
        "episodes": episodes_section(
            results, [*spread_metrics(results.protocol), "path_efficiency"]
        ),
        "filmed": sorted({f"{video.terrain}/{video.episode}" for video in videos}),
        "terrains": [
            terrain_section(results, terrain["name"], videos, examples)
            for terrain in results.protocol["terrains"]
        ],
        "note": additions.get("note"),
        "drive_map": Markup(drive_map_section(results, additions.get("drive_map"))),
        "drive_map_starts": getattr(additions.get("drive_map"), "starts", 0),
        "table": table,
        "parameters": parameters_text(results.protocol),
        "loop_parts": control_loop(results.protocol) if table else [],
        "failures": [outcome_name(each) for each in failures],
        "shapes": outcome_shapes([SUCCESS, TIMEOUT, *failures]),
        "has_goals": any(drawn and drawn[0]["goal"] for drawn in results.drawn.values()),
        "trainings": trainings_section(results.protocol["entrants"]),
        "steering": Markup(steering_figure(steering, "steering")) if steering else "",
        "steering_starts": len(next(iter(steering.drives.values()))) if steering else 0,
        "gait_metrics": [
            metric
            for metric in measured
            if (metric_named(metric).needs_gait or metric == "drive_variation")
            and any(row["metrics"][metric]["n"] for row in results.summaries)
        ],
        "is_varied": bool(results.protocol["vary"]),
        "crashes": results.protocol["crashes"],
        "study": study_section(results),
        "seeds": seeds_section(results),
        "generalisation": generalisation_section(results),
        "curves": curves_section(results.protocol["entrants"], additions.get("curves", {})),
        "origin": Markup(origin_json(results)),
        "entrants": results.protocol["entrants"],
        "physics": json.dumps(results.protocol["physics"], indent=1),
        "randomisation": randomisation_text(results.protocol.get("randomisation")),
    }
