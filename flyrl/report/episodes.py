"""Every episode of an evaluation in a table that can be sorted and filtered, inside the report.

The table is drawn by DataTables (https://datatables.net, MIT licence), which the package itables
carries along. Rows and library are packed, and unpacked when a reader first asks for the table, so
that a page with 100,000 episodes opens at once.
"""

from __future__ import annotations

import base64
import gzip
import json
from importlib import resources
from typing import Final

import numpy as np
import pandas as pd

from flyrl.evaluation.results import Results
from flyrl.evaluation.rows import Json
from flyrl.report.figures import metric_label
from flyrl.report.wording import outcome_name

DIGITS: Final = 5
"""Significant digits of a number in the table; episodes.csv has them all."""

_LIBRARY: Final = {"script": "html/dt_bundle.js", "style": "html/dt_bundle.css"}
"""Files of the package itables."""


def episodes_section(results: Results, metrics: list[str]) -> Json:
    """What the template needs: packed columns, and the packed library.

    Parameters
    ----------
    metrics
        Columns of numbers to show.
    """
    package = resources.files("itables")
    return {
        "count": len(results.episodes),
        "data": packed(json.dumps(episode_columns(results, metrics), separators=(",", ":"))),
        **{
            key: packed(package.joinpath(file).read_text(encoding="utf-8"))
            for key, file in _LIBRARY.items()
        },
    }


def episode_columns(results: Results, metrics: list[str]) -> list[Json]:
    """Columns of the table: `key`, `label`, `values`; for text, `names` that the values index."""
    rows = results.episodes
    columns = [
        _named("terrain", rows["terrain"]),
        {"key": "episode", "label": "episode", "values": rows["episode"].tolist()},
        _named("controller", rows["controller"]),
        _named("outcome", rows["outcome"].map(outcome_name)),
        *(
            {"key": metric, "label": metric_label(metric), "values": _numbers(rows[metric])}
            for metric in metrics
        ),
        {"key": "seed", "label": "seed", "values": rows["seed"].tolist()},
    ]
    if results.protocol["vary"]:
        columns.insert(1, _named("condition", rows["condition"]))
    return columns


def packed(text: str) -> str:
    """Text as gzip in base64; the same text gives the same bits."""
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()


def _named(key: str, values: pd.Series[str]) -> Json:
    codes, names = pd.factorize(values)
    return {"key": key, "label": key, "names": list(names), "values": codes.tolist()}


def _numbers(values: pd.Series[float]) -> list[float | None]:
    return [
        None if np.isnan(value) else float(f"{value:.{DIGITS}g}") for value in values.to_numpy()
    ]
