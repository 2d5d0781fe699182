"""Files of walks: CSV, NumPy, Parquet, and NWB (Neurodata Without Borders)."""

from __future__ import annotations

import datetime
import importlib
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, Final
from uuid import uuid4

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flyrl.anatomy import JOINTS, LEGS
from flyrl.files import load_arrays, replacing
from flyrl.resources import install_command, version
from flyrl.text import csv_table
from flyrl.validation import one_of

TORQUES: Final = tuple(joint.replace("joint_", "torque_") for joint in JOINTS)
"""Columns of the joints' torques, ordered as `JOINTS`."""

_GRIPS: Final = tuple(f"adhesion_{leg}" for leg in LEGS)

_PACKAGES: Final = {".parquet": ("pyarrow", "parquet"), ".nwb": ("pynwb", "nwb")}
"""Suffix -> package that writes such a file, and the extra of flyrl that installs it."""


def save_table(path: str | Path, table: pd.DataFrame, about: str) -> Path:
    """Write a recorded walk to a file, whole or not at all; return its path.

    Parameters
    ----------
    path
        Its suffix says what it becomes. ".csv"; ".npz": an array per column, named alike, for
        `numpy.load`, and `joints` (T, 42) and `adhesion` (T, 6) in one piece, as `flyrl walk
        --joints` takes them; ".parquet", for which pyarrow is needed; ".nwb", for which pynwb is.
    table
        A row per sample, with the columns of `flyrl.front.walks.Walk.frame`.
    about
        What was recorded, in a line.

    Raises
    ------
    ValueError
        Another suffix, or the package that is needed is not installed.
    OSError
        The file cannot be written.
    """
    path = Path(path)
    suffix = one_of(f"suffix of {path.name!r}", path.suffix, (".csv", ".npz", *_PACKAGES))
    package = _needed(path, *_PACKAGES[suffix]) if suffix in _PACKAGES else None
    with replacing(path) as partial:
        if suffix == ".csv":
            partial.write_text(csv_table(table, float_format="%.6g"), encoding="utf-8", newline="")
        elif suffix == ".parquet":
            table.to_parquet(partial, engine="pyarrow", index=False)
        elif suffix == ".nwb":
            _write_nwb(package, partial, table, about)
        else:
            arrays: dict[str, Any] = {str(name): table[name].to_numpy() for name in table}
            arrays["joints"] = _columns(table, JOINTS)
            arrays["adhesion"] = _columns(table, _GRIPS)
            with partial.open("wb") as file:
                np.savez_compressed(file, **arrays)
    return path


def _write_nwb(pynwb: Any, path: Path, table: pd.DataFrame, about: str) -> None:
    """Write time series of the whole fly, of its joints and of its legs, in SI units."""
    now = datetime.datetime.now().astimezone()
    file = pynwb.NWBFile(
        session_description=about,
        identifier=f"flyrl {uuid4()}",
        session_start_time=now,
        source_script=f"flyrl {version('flyrl')}",
        source_script_file_name="flyrl",
        subject=pynwb.file.Subject(
            subject_id="NeuroMechFly",
            species="Drosophila melanogaster",
            sex="F",
            age="P1D/",
            description="a simulation",
        ),
    )
    behaviour = file.create_processing_module("behavior", "a simulated walk")
    time_s = table.time_s.to_numpy()
    interval_s = float(np.mean(np.diff(time_s))) if len(time_s) > 1 else 1.0
    for name, columns, unit, factor, description in _series(table):
        behaviour.add(
            pynwb.TimeSeries(
                name=name,
                data=_columns(table, columns),
                unit=unit,
                conversion=factor,
                starting_time=float(time_s[0]),
                rate=1.0 / interval_s,
                description=description,
            )
        )
    with pynwb.NWBHDF5IO(str(path), "w") as output:
        output.write(file)


def _series(table: pd.DataFrame) -> list[tuple[str, Sequence[str], str, float, str]]:
    """Name, columns, unit, factor from the columns' unit, and description of each time series."""
    command = [str(name) for name in table if str(name).startswith("command_")]
    forces, legs = [f"f{axis}_{leg}" for leg in LEGS for axis in "xyz"], ", ".join(LEGS)
    of_legs = {
        ("phases", "phase", "rad"): "of oscillators",
        ("magnitudes", "magnitude", "1"): "of oscillators",
        ("adhesion", "adhesion", "1"): "1 where a leg grips",
        ("stance", "stance", "1"): "1 where a leg stands",
        ("retraction", "retracts", "1"): "reflex, 1 in",
        ("stumbling", "stumbles", "1"): "reflex, 1 in",
    }
    return [
        ("thorax_position", ["x_mm", "y_mm", "z_mm"], "m", 1e-3, "x, y, z in the world"),
        ("thorax_velocity", ["vx_mm_s", "vy_mm_s", "vz_mm_s"], "m/s", 1e-3, "along x, y, z"),
        ("thorax_angles", ["yaw_rad", "pitch_rad", "roll_rad"], "rad", 1.0, "yaw, pitch, roll"),
        ("joint_angles", JOINTS, "rad", 1.0, ", ".join(JOINTS)),
        ("joint_torques", TORQUES, "N*m", 1e-9, ", ".join(TORQUES)),
        ("contact_forces", forces, "N", 1e-6, f"x, y, z in the world of each of {legs}"),
        *(
            (name, [f"{column}_{leg}" for leg in LEGS], unit, 1.0, f"{text}: {legs}")
            for (name, column, unit), text in of_legs.items()
        ),
        *([("command", command, "1", 1.0, ", ".join(command))] if command else []),
    ]


def _columns(table: pd.DataFrame, names: Sequence[str]) -> NDArray[np.float64]:
    return np.ascontiguousarray(table[list(names)].to_numpy(dtype=np.float64))


def _needed(path: Path, package: str, extra: str) -> ModuleType:
    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise ValueError(
            f"{path.name} needs {package}, which is not installed: {install_command(extra)}"
        ) from error


def load_recording(path: Path) -> dict[str, Any]:
    """Read joint angles, rad, (T, 42), and adhesion, (T, 6) or None, as `flyrl.walk` takes them.

    Parameters
    ----------
    path
        A CSV with a column per joint, and adhesion_LF, …; or an NPZ with `joints` and `adhesion`.

    Raises
    ------
    ValueError
        It is no such table.
    """
    if path.suffix == ".npz":
        arrays = load_arrays(path)
        if "joints" not in arrays:
            raise ValueError(f"{path} must hold the array joints, (T, 42)")
        return {name: arrays.get(name) for name in ("joints", "adhesion")}
    try:
        table = pd.read_csv(path)
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is no CSV: {error}") from error
    missing = [name for name in JOINTS if name not in table]
    if missing:
        raise ValueError(f"{path} must have a column for every joint; there is no {missing[0]!r}")
    has_grips = set(_GRIPS) <= set(table)
    return {
        "joints": table[list(JOINTS)].to_numpy(),
        "adhesion": table[list(_GRIPS)].to_numpy() if has_grips else None,
    }
