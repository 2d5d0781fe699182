"""Reading run folders back: what a run is, how far it came, and what is wrong with its files.

Importing this loads neither torch nor Stable-Baselines3, so that a list of runs comes at once.
"""

import csv
import itertools
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

from flyrl.files import load_yaml
from flyrl.text import printable

CONFIG_FILE: Final = "config.yaml"
STATUS_FILE: Final = "status.json"
CHECKPOINT_SUFFIX: Final = ".pt"
_LOCK: Final = ".lock"
_FILES: Final = (CONFIG_FILE, "provenance.json", "progress.csv", STATUS_FILE, "last.safetensors")
"""Any of these makes a folder one of a run."""

State = Literal["finished", "interrupted", "running", "damaged"]


def present_names(settings: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Settings of a schedule by the names of its fields.

    `total_timesteps` was called `total_decisions`, which is understood for a release, with a
    warning.

    Parameters
    ----------
    settings
        By name, each after `prefix`.
    prefix
        Such as "training.".

    Raises
    ------
    ValueError
        A setting is given by both of its names.
    """
    earlier, present = f"{prefix}total_decisions", f"{prefix}total_timesteps"
    if earlier not in settings:
        return dict(settings)
    if present in settings:
        raise ValueError(f"{earlier} is {present}, and both are given")
    print(f"warning: {earlier} is called {present}", file=sys.stderr)
    return {present if key == earlier else key: value for key, value in settings.items()}


class ResumeError(ValueError):
    """The run cannot be resumed."""


class RunIsHeldError(OSError):
    """Another process trains in the folder."""


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Mark the run in `folder` as running, as long as the block or this process lasts.

    Where the file system has no locks, nothing is marked.

    Raises
    ------
    RunIsHeldError
        Another process trains in the folder.
    OSError
        The folder cannot be written to.
    """
    descriptor = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        if _is_locked(descriptor):
            raise RunIsHeldError(f"another process trains in {folder}")
        yield
    finally:
        os.close(descriptor)


def is_running(folder: Path) -> bool:
    """Whether a process holds the run in `folder`."""
    try:
        descriptor = os.open(folder / _LOCK, os.O_RDONLY)
    except OSError:
        return False
    try:
        return _is_locked(descriptor)
    finally:
        os.close(descriptor)


def _is_locked(descriptor: int) -> bool:
    """Try to lock; return whether another has."""
    from filelock import lock_descriptor  # noqa: PLC0415 - slow to import

    try:
        return not lock_descriptor(descriptor, blocking=False)
    except OSError:
        return False  # a file system without locks


def read_record(path: Path) -> dict[str, Any]:
    """Settings of the run in a folder, as `config.training_record` gave them.

    Raises
    ------
    ResumeError
        There is no run in the folder.
    """
    try:
        return _settings(path / CONFIG_FILE)
    except (OSError, ValueError) as error:
        raise ResumeError(f"{path} is not the folder of a run: {error}") from error


def read_rows(path: Path) -> list[dict[str, str]]:
    """Rows of a CSV file by column, without a last one that was cut off; none without a file."""
    if not path.exists():
        return []
    try:
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        return list(csv.DictReader(line for line in lines if line.endswith("\n")))
    except (UnicodeDecodeError, csv.Error) as error:
        raise ResumeError(f"{path} is no table: {error}") from error


def training_returns(folder: Path) -> list[tuple[float, float]]:
    """Decisions and the mean return of the latest training episodes, per update that has both."""
    keys = ("time/total_timesteps", "rollout/ep_rew_mean")
    rows = [[row.get(key) for key in keys] for row in read_rows(folder / "progress.csv")]
    return [(float(count), float(value)) for count, value in rows if count and value]


def checkpoint_files(folder: Path) -> list[Path]:
    """Checkpoints of the run in `folder`, oldest first."""
    return sorted((folder / "checkpoints").glob(f"[0-9]*{CHECKPOINT_SUFFIX}"))


@dataclass(frozen=True)
class RunSummary:
    """A run folder as it was found; what could not be read is empty, and `problems` says why.

    Attributes
    ----------
    path
        The folder.
    state
        `running` if a process holds it, `finished` or `interrupted` (killed, too) as its status
        says, `damaged` if its settings cannot be read.
    settings
        Of `config.yaml`.
    provenance
        Commit, package versions, CPU.
    decisions
        Collected so far, as the latest file tells.
    wall_time_s
        Spent so far.
    evaluations
        Rows of `evaluations.csv`.
    problems
        A line each.
    """

    path: Path
    state: State
    settings: Mapping[str, Any]
    provenance: Mapping[str, Any]
    decisions: int | None
    wall_time_s: float | None
    evaluations: tuple[Mapping[str, float], ...]
    problems: tuple[str, ...]

    def setting(self, key: str) -> Any:
        """Value of a dotted key of the settings; None where there is none."""
        return nested(self.settings, key)

    @property
    def has_checkpoint(self) -> bool:
        """Whether there is a checkpoint to resume from."""
        return bool(checkpoint_files(self.path))

    @property
    def last(self) -> Mapping[str, float] | None:
        """The last evaluation."""
        return self.evaluations[-1] if self.evaluations else None

    @property
    def best(self) -> Mapping[str, float] | None:
        """The evaluation with the highest success, and among these the highest return."""
        return max(self.evaluations, key=score, default=None)


def score(evaluation: Mapping[str, float]) -> tuple[float, float]:
    """Success and return of an evaluation, by which the best one is chosen."""
    return evaluation["success_rate"], evaluation["mean_return"]


def names_of(run: RunSummary) -> dict[str, Any]:
    """Names of the task, the terrain and the algorithm, as one gives them on the command line."""
    from flyrl.terrains import terrain_label  # noqa: PLC0415

    return {
        "task": run.setting("task.name"),
        "terrain": terrain_label(run.setting("terrain.name"), run.setting("terrain.random")),
        "algo": run.setting("algo.name"),
    }


def nested(tree: Any, key: str) -> Any:
    """Value at a dotted key of nested mappings; None where there is none."""
    for part in key.split("."):
        if not isinstance(tree, Mapping):
            return None
        tree = tree.get(part)
    return tree


def flat(tree: Any, prefix: str = "") -> dict[str, Any]:
    """Leaves of nested mappings by dotted key."""
    if not isinstance(tree, Mapping):
        return {prefix.removesuffix("."): tree}
    return {
        key: leaf
        for name, branch in tree.items()
        for key, leaf in flat(branch, f"{prefix}{name}.").items()
    }


def is_run(folder: Path) -> bool:
    """Whether a folder holds anything of a run."""
    return any((folder / name).is_file() for name in _FILES)


def find_runs(folder: Path, depth: int = 4) -> list[Path]:
    """Run folders in `folder`, itself or up to `depth` levels down, in order of their names."""
    if is_run(folder):
        return [folder]
    if depth == 0:
        return []
    shown = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    inside = [path for path in shown if path.is_dir() and os.access(path, os.R_OK | os.X_OK)]
    return [run for path in inside for run in find_runs(path, depth - 1)]


def read_run(path: Path) -> RunSummary:
    """Read a run folder, whatever state its files are in."""
    problems: list[str] = []

    def read(name: str, how: Callable[[Path], Any], *, is_needed: bool = True) -> Any:
        try:
            return how(path / name)
        except FileNotFoundError:
            if is_needed:
                problems.append(f"{name} is missing")
        except (OSError, ValueError, KeyError, TypeError) as error:
            problems.append(f"{name} cannot be read: {_one_line(error)}")
        return {}

    settings = read(CONFIG_FILE, _settings)
    provenance = read("provenance.json", _json_mapping)
    status = read(STATUS_FILE, _status, is_needed=False)
    evaluations = tuple(read("evaluations.csv", _evaluations, is_needed=False))
    progress = read("progress.csv", read_rows, is_needed=False)
    if is_running(path):
        state: State = "running"
    elif not settings:
        state = "damaged"
    else:
        state = "finished" if status and status["interrupted_by"] is None else "interrupted"
    if state == "finished" and not (path / "last.safetensors").is_file():
        problems.append("last.safetensors is missing")
    decisions, wall_time = _how_far(progress, evaluations)
    return RunSummary(
        path,
        state,
        settings,
        provenance,
        status.get("decisions", decisions),
        status.get("wall_time_s", wall_time),
        evaluations,
        tuple(problems),
    )


def _settings(path: Path) -> dict[str, Any]:
    settings = load_yaml(path)
    kinds = {"task.name": str, "terrain.name": str, "algo.name": str, "seed": int}
    for key, kind in kinds.items():
        if not isinstance(nested(settings, key), kind):
            raise ValueError(f"no {key}")
    return dict(settings)


def _json_mapping(path: Path) -> Mapping[str, Any]:
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    if not isinstance(record, dict):
        raise ValueError("no JSON object")
    return record


def _status(path: Path) -> Mapping[str, Any]:
    record = _json_mapping(path)
    return {
        "decisions": int(record["decisions"]),
        "wall_time_s": float(record["wall_time_s"]),
        "interrupted_by": record["interrupted_by"],
    }


def _evaluations(path: Path) -> list[dict[str, float]]:
    rows = [
        {key: float(value) for key, value in row.items()}
        for row in csv.DictReader(path.read_text(encoding="utf-8").splitlines())
    ]
    needed = ("decisions", "success_rate", "mean_return", "mean_duration_s")
    for row, key in itertools.product(rows, needed):
        if not math.isfinite(row[key]):
            raise ValueError(f"{key} must be finite, got {row[key]}")
    return rows


def _how_far(
    progress: list[dict[str, str]], evaluations: tuple[Mapping[str, float], ...]
) -> tuple[int | None, float | None]:
    """Decisions and wall time of a run without a status, from its tables."""
    counts, times = (
        [int(text) for row in progress if (text := row.get(f"time/{key}") or "").isdigit()]
        for key in ("total_timesteps", "time_elapsed")
    )
    counts += [int(row["decisions"]) for row in evaluations]
    return max(counts, default=None), max(map(float, times), default=None)


def _one_line(error: Exception) -> str:
    is_key = isinstance(error, KeyError)
    return printable(f"{error} is missing" if is_key else " ".join(str(error).split()))
