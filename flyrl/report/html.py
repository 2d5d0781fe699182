"""The report: one HTML file that needs nothing else."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, TypedDict, Unpack

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flyrl.envs.config import randomisation_text
from flyrl.evaluation.conditions import Condition
from flyrl.evaluation.drive_map import DriveMap, Steering
from flyrl.evaluation.episodes import Json, episodes_digest
from flyrl.evaluation.metrics import descriptions, metric_label, metric_named
from flyrl.evaluation.results import Results
from flyrl.evaluation.trainings import PROFILE_AT, generalisation, over_seeds, trainings
from flyrl.files import OutputFolder
from flyrl.report import close_up, figures, sections, style, wording
from flyrl.report.curves import Evaluations, learning_curves
from flyrl.report.exports import format_tables
from flyrl.report.paths import paths_figure
from flyrl.report.video import Video
from flyrl.rollouts import EpisodeRecord
from flyrl.tasks import SUCCESS, TIMEOUT
from flyrl.text import plain_name, printable
from flyrl.validation import plain_record

REPORT_FILE: Final = "report.html"
FIGURES_FOLDER: Final = "figures"
TABLES_FOLDER: Final = "tables"

ORIGIN_SCHEMA: Final = "flyrl.report/1"
ORIGIN_ID: Final = "origin"
"""Id of the element in a report that says how to repeat it."""


class Additions(TypedDict, total=False):
    """Optional contents of a report.

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
    files = {
        f"{FIGURES_FOLDER}/{plain_name(name)}.svg": style.standalone(svg)
        for name, svg in context["svgs"].items()
    }
    for name, text in format_tables(results, context["all_leaders"]).items():
        files[f"{TABLES_FOLDER}/{name}"] = text
    earlier = {*output.files(FIGURES_FOLDER), *output.files(TABLES_FOLDER)}
    output.remove(*(earlier - files.keys()))
    try:
        for name, text in files.items():
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
    environment.filters |= {
        "data_url": data_url,
        "label": context["labels"].get,
        "metric_label": metric_label,
        "number": wording.format_number,
        "outcome": wording.outcome_name,
        "prefixed": lambda text, prefix: f"{prefix}{text}",
        "script_hash": script_hash,
    }
    return environment.get_template("report.html.j2").render(context)


def _shown(value: Any) -> Any:
    """Value as it stands in the page: texts of others cannot turn the reading direction round."""
    is_text = isinstance(value, str) and not isinstance(value, Markup)
    return printable(value, keep="\n\t\u00a0") if is_text else value


def data_url(data: bytes, kind: str) -> str:
    """Address that holds a file itself, of a kind such as video/mp4."""
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def script_hash(script: str) -> str:
    """Source expression by which a Content-Security-Policy allows this inline script alone."""
    return f"sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}"


def draw_figures(
    results: Results, terrains: Sequence[Json], seeds: Json | None, additions: Additions
) -> tuple[dict[str, str], dict[str, str]]:
    """Every figure of a report, by the name that it has in the page and as a file.

    Those with nothing to show are left out, as are those of single walks where quantities were
    varied.

    Parameters
    ----------
    terrains, seeds
        See `flyrl.report.sections.terrain_section` and `flyrl.evaluation.trainings.over_seeds`.

    Returns
    -------
    Name -> SVG, e.g. `success`, `paths-flat`, `doses-flat-friction`; and terrain -> the ground in
    the figure of its paths, see `paths_figure`.
    """
    protocol, rows, summary = results.protocol, results.episodes, results.summaries
    horizon_s, metrics = protocol["horizon_s"], sections.spread_metrics(protocol)
    usual = sections.usual_rows(results)
    success = figures.success_figure(usual, wording.usual_condition(protocol))
    drawn: dict[str, Figure | None] = {"success": success}
    grounds = {}
    present = sections.present_metrics(results)
    had = ["success", *(metric for metric in metrics if metric in present)]
    for terrain, section in zip(protocol["terrains"], terrains, strict=True):
        at = terrain["name"]
        if protocol["vary"]:
            for quantity, values in protocol["vary"].items():
                labels = [Condition(quantity, value).label for value in values]
                doses = figures.doses_figure(summary, at, quantity, labels, had)
                drawn[f"doses-{at}-{quantity}"] = doses
            continue
        drawn[f"distributions-{at}"] = figures.distributions_figure(rows, at, horizon_s, metrics)
        drawn[f"differences-{at}"] = figures.paired_figure(rows, summary, at, horizon_s)
        walks, episodes = sections.walks_on(results, at), results.drawn.get(at, ())
        drawn[f"paths-{at}"], grounds[at] = paths_figure(walks, terrain, episodes)
        if section["walks"]:
            drawn[f"gait-{at}"] = close_up.gait_figure(section["walks"])
        for player in section["players"]:
            if player["walked"]:
                curves = close_up.time_figure(player["walked"], player["until_s"])
                drawn[f"time-{player['name']}"] = curves
    if seeds:
        drawn["profiles"] = figures.profiles_figure(seeds["profiles"], PROFILE_AT)
    if drive_map := additions.get("drive_map"):
        drawn["drive-map"] = close_up.drive_map_figure(drive_map, _learned_drives(results))
    if steering := additions.get("steering"):
        drawn["steering"] = close_up.steering_figure(steering)
    evaluated = additions.get("curves", {})
    groups = [
        (label, [evaluated[name] for name in names if evaluated.get(name)])
        for label, names in trainings(protocol["entrants"]).items()
    ]
    if any(runs for _, runs in groups):
        drawn["learning-curves"] = learning_curves(groups, width=style.WIDTH_IN)
    return {name: style.svg_text(figure) for name, figure in drawn.items() if figure}, grounds


def _learned_drives(results: Results) -> dict[str, NDArray[np.float32]]:
    """Drives (T, 2) that each learned policy chose, as far as its paths were kept."""
    names = results.episodes["controller"]
    learned = {each["name"] for each in results.protocol["entrants"] if wording.is_taught(each)}
    drives: dict[str, list[NDArray[np.float32]]] = {}
    for row, path in results.trajectories.items():
        if names[row] in learned:
            drives.setdefault(names[row], []).append(path.drive[1:])
    return {name: np.concatenate(own) for name, own in drives.items()}


def report_context(results: Results, **additions: Unpack[Additions]) -> dict[str, Any]:
    """All that the page's template is given; see `write_report`."""
    protocol, summary = results.protocol, results.summaries
    videos, examples = additions.get("videos", ()), additions.get("examples", ())
    leading = sections.lead_videos(protocol, videos)
    terrains = [
        sections.terrain_section(results, terrain, videos, examples, leading)
        for terrain in protocol["terrains"]
    ]
    drive_map, steering = additions.get("drive_map"), additions.get("steering")
    names = [row["controller"] for row in summary]
    names += [entrant["name"] for entrant in protocol["entrants"]]
    walked_on = ", ".join(dict.fromkeys(row["terrain"] for row in summary))
    usual, condition = sections.usual_rows(results), wording.usual_condition(protocol)
    leaders = sections.all_leaders(results)
    usual_leaders = [each for each in leaders if each.condition == usual[0]["condition"]]
    table = protocol.get("table")
    present = sections.present_metrics(results)
    measured = summary[0]["metrics"]
    labels = {metric: metric_label(metric) for metric in ("success", *measured)}
    effects = wording.effects_text(protocol)
    if (table or {}).get("actions") == "neurons":
        labels["drive_variation"] = "change of tensions (1/s)"
    outcomes = [
        *(table or {}).get("failures", ()),
        *(name for row in summary for name, count in row["outcomes"].items() if count),
    ]
    failures = [each for each in dict.fromkeys(outcomes) if each not in (SUCCESS, TIMEOUT)]
    controllers = len({row["controller"] for row in usual})
    notes = [wording.training_note(protocol)]
    if controllers > 1:
        level = effects and f"Differences under {effects} count as none."
        notes[:0] = [wording.changes_text(leaders, usual_leaders), level]
    shown = [*sections.spread_metrics(protocol), "path_efficiency"]
    metrics = {key: text for key, text in descriptions(protocol).items() if key in present}
    of_gait = [key for key in measured if metric_named(key).needs_gait or key == "drive_variation"]
    gait_metrics = [key for key in of_gait if key in present]
    seed = protocol["seed"]
    seeds = over_seeds(protocol["entrants"], usual, np.random.default_rng(seed))
    svgs, grounds = draw_figures(results, terrains, seeds, additions)
    return {
        "title": f"{protocol['task']} on {walked_on}",
        "headline": wording.headline(usual_leaders, controllers, condition),
        "notes": list(filter(None, notes)),
        "condition": condition,
        "shared": wording.shared_text(results.drawn),
        "held_out": wording.held_out_text(protocol),
        "effects": effects,
        "detail": wording.rates(usual, protocol) if protocol["decisive"][0] == "success" else "",
        "leaders": [(leader, wording.leader_cells(leader)) for leader in usual_leaders],
        "all_leaders": leaders,
        "leaders_by_condition": wording.leaders_by_condition(leaders),
        "lower_is_better": [metric for metric in measured if metric_named(metric).lower_is_better],
        "protocol": protocol,
        "folders": {"figures": FIGURES_FOLDER, "tables": TABLES_FOLDER},
        "stylesheet": Markup(style.stylesheet()),
        "colours": {name: style.themed(colour) for name, colour in style.colours(names).items()},
        "metrics": metrics,
        "shown": shown,
        "labels": labels,
        "svgs": svgs,
        "figures": {name: Markup(style.inline(svg, name)) for name, svg in svgs.items()},
        "grounds": grounds,
        "rows": [sections.table_row(row) for row in usual],
        "episodes": sections.episodes_section(results, shown),
        "filmed": sorted({f"{video.terrain}/{video.episode}" for video in videos}),
        "terrains": terrains,
        "lead": leading and sections.player(leading, ()),
        "lead_text": leading and wording.contrast_text(protocol, leading[0].terrain),
        "note": additions.get("note"),
        "drive_map": drive_map,
        "mdp": table,
        "parameters": wording.parameters_text(protocol),
        "failures": [wording.outcome_name(each) for each in failures],
        "shapes": style.outcome_shapes([SUCCESS, TIMEOUT, *failures]),
        "has_goals": any(drawn and drawn[0]["goal"] for drawn in results.drawn.values()),
        "trainings": sections.trainings_section(protocol["entrants"]),
        "steering_starts": len(next(iter(steering.drives.values()))) if steering else 0,
        "gait_metrics": gait_metrics,
        "gait_titles": {labels[metric]: metrics[metric] for metric in gait_metrics},
        "study": sections.study_section(results),
        "seeds": seeds,
        "generalisation": generalisation(protocol, usual, np.random.default_rng(seed)),
        "origin": Markup(origin_json(results)),
        "physics": json.dumps(protocol["physics"], indent=1),
        "randomisation": randomisation_text(protocol.get("randomisation")),
    }


def origin_json(results: Results) -> str:
    """JSON from which the evaluation can be repeated and compared, to stand in a script element."""
    protocol = results.protocol
    origin = {
        "schema": ORIGIN_SCHEMA,
        "settings": protocol["settings"],
        "versions": protocol["versions"],
        "policies": {entrant["name"]: entrant["sha256"] for entrant in protocol["entrants"]},
        "episodes_sha256": episodes_digest(results.episodes),
    }
    return json.dumps(origin).replace("<", "\\u003c")


def read_origin(path: Path) -> Json:
    """Origin of a report: settings, versions, hashes.

    Raises
    ------
    ValueError
        The file is no report, or of another version.
    OSError
        It cannot be read.
    """
    text = path.read_text(encoding="utf-8", errors="replace")
    found = re.search(rf'<script type="application/json" id="{ORIGIN_ID}">(.*?)</script>', text)
    try:
        origin: Json = json.loads(found.group(1)) if found else {}
    except (ValueError, RecursionError):
        origin = {}
    if not isinstance(origin, dict) or origin.get("schema") != ORIGIN_SCHEMA:
        raise ValueError(f"{path} is no report of this version of flyrl")
    plain_record("the origin", origin)
    objects = dict.fromkeys(("settings", "versions", "policies"), (dict, "an object"))
    for key, (kind, name) in {**objects, "episodes_sha256": (str, "text")}.items():
        if not isinstance(origin.get(key), kind):
            raise ValueError(f"{path}: {key!r} must be {name}, got {origin.get(key)!r:.60}")
    return origin
