"""Files of walks: CSV, NumPy, Parquet, and NWB (Neurodata Without Borders)."""

from __future__ import annotations

import datetime
import importlib
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flyrl.anatomy import JOINTS, LEGS
from flyrl.files import replacing, write_text
from flyrl.resources import install_command, version
from flyrl.text import csv_table
from flyrl.validation import one_of


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
    _WRITERS[one_of(f"suffix of {path.name!r}", path.suffix, _WRITERS)](path, table, about)
    return path


def _write_csv(path: Path, table: pd.DataFrame, about: str) -> None:
    write_text(path, csv_table(table, float_format="%.6g"))


def _write_npz(path: Path, table: pd.DataFrame, about: str) -> None:
    arrays: dict[str, Any] = {str(name): table[name].to_numpy() for name in table}
    arrays["joints"] = _columns(table, list(JOINTS))
    arrays["adhesion"] = _columns(table, [f"adhesion_{leg}" for leg in LEGS])
    with replacing(path) as partial, partial.open("wb") as file:
        np.savez_compressed(file, **arrays)


def _write_parquet(path: Path, table: pd.DataFrame, about: str) -> None:
    _needed("pyarrow", "parquet", path)
    with replacing(path) as partial:
        table.to_parquet(partial, engine="pyarrow", index=False)


def _write_nwb(path: Path, table: pd.DataFrame, about: str) -> None:
    """Write time series of the whole fly, of its joints and of its legs, in SI units."""
    pynwb = _needed("pynwb", "nwb", path)
    now = datetime.datetime.now().astimezone()
    file = pynwb.NWBFile(
        session_description=about,
        identifier=f"flyrl {path.stem} {now.isoformat()}",
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
    for series in _series(table, pynwb.TimeSeries):
        behaviour.add(series)
    with replacing(path) as partial, pynwb.NWBHDF5IO(str(partial), "w") as output:
        output.write(file)


def _series(table: pd.DataFrame, series: Callable[..., Any]) -> list[Any]:
    """Time series of a walk, each (T, k), with what their columns are in the description."""
    time_s = table.time_s.to_numpy()
    interval_s = float(np.mean(np.diff(time_s))) if len(time_s) > 1 else 1.0
    command = [name for name in table if str(name).startswith("command_")]
    forces = [f"f{axis}_{leg}" for leg in LEGS for axis in "xyz"]
    torques = [joint.replace("joint_", "torque_") for joint in JOINTS]
    legs = ", ".join(LEGS)
    parts: list[tuple[str, list[Any], str, float, str]] = [
        ("thorax_position", ["x_mm", "y_mm", "z_mm"], "m", 1e-3, "x, y, z in the world"),
        ("thorax_velocity", ["vx_mm_s", "vy_mm_s", "vz_mm_s"], "m/s", 1e-3, "along x, y, z"),
        ("thorax_angles", ["yaw_rad", "pitch_rad", "roll_rad"], "rad", 1.0, "yaw, pitch, roll"),
        ("joint_angles", list(JOINTS), "rad", 1.0, ", ".join(JOINTS)),
        ("joint_torques", torques, "N*m", 1e-9, ", ".join(torques)),
        ("phases", [f"phase_{leg}" for leg in LEGS], "rad", 1.0, f"of oscillators: {legs}"),
        ("magnitudes", [f"magnitude_{leg}" for leg in LEGS], "1", 1.0, f"of oscillators: {legs}"),
        ("adhesion", [f"adhesion_{leg}" for leg in LEGS], "1", 1.0, f"1 where a leg grips: {legs}"),
        ("stance", [f"stance_{leg}" for leg in LEGS], "1", 1.0, f"1 where a leg stands: {legs}"),
        ("retraction", [f"retracts_{leg}" for leg in LEGS], "1", 1.0, f"reflex, 1 in: {legs}"),
        ("stumbling", [f"stumbles_{leg}" for leg in LEGS], "1", 1.0, f"reflex, 1 in: {legs}"),
        ("contact_forces", forces, "N", 1e-6, f"x, y, z in the world of each of {legs}"),
    ]
    if command:
        parts.append(("command", command, "1", 1.0, ", ".join(map(str, command))))
    return [
        series(
            name=name,
            data=_columns(table, columns),
            unit=unit,
            conversion=factor,
            starting_time=float(time_s[0]),
            rate=1.0 / interval_s,
            description=description,
        )
        for name, columns, unit, factor, description in parts
    ]


def _columns(table: pd.DataFrame, names: list[Any]) -> NDArray[np.float64]:
    return np.ascontiguousarray(table[names].to_numpy(dtype=np.float64))


def _needed(package: str, extra: str, path: Path) -> ModuleType:
    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise ValueError(
            f"{path.name} needs {package}, which is not installed: {install_command(extra)}"
        ) from error


_WRITERS: Final[Mapping[str, Callable[[Path, pd.DataFrame, str], None]]] = {
    ".csv": _write_csv,
    ".npz": _write_npz,
    ".parquet": _write_parquet,
    ".nwb": _write_nwb,
}
"""Suffix -> what writes such a file."""


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
        try:
            with np.load(path, allow_pickle=False) as file:
                found = {name: file[name] for name in ("joints", "adhesion") if name in file}
        except ValueError as error:
            raise ValueError(f"{path} is no NPZ of arrays: {error}") from error
        if "joints" not in found:
            raise ValueError(f"{path} must hold the array joints, (T, 42)")
        return found
    try:
        table = pd.read_csv(path)
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is no CSV: {error}") from error
    missing = [name for name in JOINTS if name not in table]
    if missing:
        raise ValueError(f"{path} must have a column for every joint; there is no {missing[0]!r}")
    grips = [f"adhesion_{leg}" for leg in LEGS]
    has_grips = set(grips) <= set(table)
    return {
        "joints": table[list(JOINTS)].to_numpy(),
        "adhesion": table[grips].to_numpy() if has_grips else None,
    }
