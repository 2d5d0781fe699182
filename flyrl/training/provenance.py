"""Where a run comes from: code, packages, machine; and whether a repeat comes to the same."""

import contextlib
import hashlib
import math
import os
import platform
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numba
import numpy as np
from numpy.typing import NDArray

from flyrl.files import file_digest
from flyrl.policies.bundle import PolicyBundle, bundle_record, load_bundle
from flyrl.resources import version
from flyrl.tasks import code_digests
from flyrl.text import printable
from flyrl.training.runs import RunSummary, flat

_PACKAGE = Path(__file__).resolve().parents[1]
"""Folder of flyrl's code."""

_PACKAGES: Final = (
    "flyrl",
    "gymnasium",
    "hydra-core",
    "mujoco",
    "numba",
    "numpy",
    "optuna",
    "sb3-contrib",
    "scipy",
    "stable-baselines3",
    "torch",
)
_OWN_FOLDERS: Final = ("assets", "configs", "flyrl")
"""Of a checkout: what a run depends on."""


def provenance(code: Sequence[str] = ()) -> dict[str, Any]:
    """Commit, versions and CPU, as plain JSON values; what cannot be known is null.

    Parameters
    ----------
    code
        Names of a user's own task and terms, `module:attribute` each; the SHA-256 of the modules
        is noted.
    """
    cpu_info = ""
    with contextlib.suppress(OSError):  # only Linux has it
        cpu_info = Path("/proc/cpuinfo").read_text()
    return {
        "git": _commit(),
        "terms": code_digests(code),
        "python": platform.python_version(),
        "packages": {name: version(name) for name in _PACKAGES},
        "system": platform.platform(),
        "cpu": cpu(cpu_info),
        # those that this process may use
        "num_cpus": numba.config.NUMBA_DEFAULT_NUM_THREADS,  # type: ignore[attr-defined]
    }


def code_changes() -> bytes:
    """What the checkout that flyrl runs from has beyond its commit, for `git apply`.

    Without untracked files. Empty for an installed package, and where git cannot be asked.
    """
    plain = ("--binary", "--no-ext-diff", "--no-textconv", "--no-color")
    return _git("diff", *plain, "HEAD") or b""


def differences(before: Mapping[str, Any], now: Mapping[str, Any], when: str) -> list[str]:
    """What differs between two records of `provenance`, a line each.

    Parameters
    ----------
    before, now
        The records.
    when
        What the second one is, in a word or two.
    """
    first, second = flat(before), flat(now)
    lines = []
    for key in dict.fromkeys([*first, *second]):
        if key in {"started", "resumed"} or first.get(key) == second.get(key):
            continue
        if key == "cpu.flags":
            lost, new = (str(flags or "").split() for flags in (first.get(key), second.get(key)))
            lost, new = sorted({*lost} - {*new}), sorted({*new} - {*lost})
            lines.append(
                f"CPU flags: without {' '.join(lost) or 'none'}; with {' '.join(new) or 'none'}"
            )
        elif key == "git.diff":
            lines.append("the code has other changes beyond its commit: see code.diff")
        else:
            lines.append(f"{key}: {first.get(key)}, {when} {second.get(key)}")
    return list(map(printable, lines))


def _commit() -> dict[str, Any] | None:
    """Commit of the checkout that flyrl runs from; null for an installed package."""
    commit, status = _git("rev-parse", "HEAD"), _git("status", "--porcelain")
    if commit is None or status is None:
        return None
    # files of flyrl that git does not know, nor ignores
    asked = ("ls-files", "--others", "--exclude-standard", "-z", "--", *_OWN_FOLDERS)
    untracked = filter(None, (_git(*asked) or b"").split(b"\0"))
    changes = code_changes()
    return {
        "commit": commit.decode().strip(),
        "is_dirty": bool(status),
        "diff": hashlib.sha256(changes).hexdigest() if changes else None,
        "untracked": {
            name.decode(errors="replace"): file_digest(_PACKAGE.parent / os.fsdecode(name))
            for name in untracked
        },
    }


def _git(*arguments: str) -> bytes | None:
    """Output of git on the checkout that flyrl runs from; None where there is none, or no git."""
    checkout = _PACKAGE.parent
    if not (checkout / ".git").exists():
        return None
    command = ["git", "-C", str(checkout), *arguments]
    try:
        return subprocess.run(command, capture_output=True, timeout=10, check=True).stdout
    except (OSError, subprocess.SubprocessError):
        return None


def cpu(info: str) -> dict[str, Any]:
    """Model and instruction sets of the first CPU, from what Linux says in `/proc/cpuinfo`."""
    lines = [line.partition(":") for line in info.partition("\n\n")[0].splitlines()]
    first = {key.strip(): value.strip() for key, _, value in lines}
    return {
        "model": first.get("model name") or platform.processor() or None,
        "flags": first.get("flags", first.get("Features")),  # on x86, on ARM
    }


@dataclass(frozen=True)
class RepeatComparison:
    """Differences between a run and its repeat.

    Attributes
    ----------
    policy
        Difference of the final policies; None if they are the same bits.
    evaluations
        First difference of the evaluations; None if they are the same.
    origins
        Differences in code, packages and machine, a line each.
    """

    policy: str | None
    evaluations: str | None
    origins: tuple[str, ...]

    @property
    def is_identical(self) -> bool:
        """Whether the repeat came to the same."""
        return self.policy is None and self.evaluations is None


def check_repeatable(original: RunSummary) -> None:
    """Raise ValueError unless the run is finished, and its final policy can be read."""
    if original.state != "finished":
        reason = "; ".join(original.problems) or f"it is {original.state}"
        raise ValueError(f"{original.path} is no finished run to compare with: {reason}")
    load_bundle(_last(original))


def compare(original: RunSummary, repeat: RunSummary) -> RepeatComparison:
    """Compare a run with its repeat.

    Raises
    ------
    PolicyFileError
        The final policy of one of them cannot be read.
    """
    bundles = [load_bundle(_last(run)) for run in (original, repeat)]
    return RepeatComparison(
        policy=difference(*bundles),
        evaluations=_evaluations_differ(original, repeat),
        origins=tuple(_origins_differ(original.provenance, repeat.provenance)),
    )


def _last(run: RunSummary) -> Path:
    return run.path / "last.safetensors"


def difference(first: PolicyBundle, second: PolicyBundle) -> str | None:
    """Difference of two policies in what they make of an observation; None if in no bit."""
    one, other = (_settings(bundle) for bundle in (first, second))
    for key in {**one, **other}:
        if one.get(key) != other.get(key):
            return f"{key} {one.get(key)}, in the repeat {other.get(key)}"
    differences = (
        _arrays_differ("parameters", first.weights, second.weights),
        _arrays_differ("statistics of the normaliser", _statistics(first), _statistics(second)),
    )
    return "; ".join(filter(None, differences)) or None


def _settings(bundle: PolicyBundle) -> dict[str, Any]:
    """All that decides how the policy acts, but for its arrays, by dotted key."""
    record = bundle_record(bundle)
    settings = flat({key: record[key] for key in ("architecture", "observation", "action")})
    normaliser = bundle.normaliser
    return {**settings, "normaliser": normaliser and (normaliser.epsilon, normaliser.clip)}


def _statistics(bundle: PolicyBundle) -> dict[str, NDArray[Any]]:
    values = vars(bundle.normaliser) if bundle.normaliser else {}
    return {key: values[key] for key in ("mean", "variance") if values}


def _arrays_differ(
    what: str, first: Mapping[str, NDArray[Any]], second: Mapping[str, NDArray[Any]]
) -> str | None:
    one, other = (
        np.concatenate([*(np.ravel(each[name]) for name in sorted(each)), []])
        for each in (first, second)
    )
    changed = one.view(np.int64) != other.view(np.int64)  # float64, which keeps every bit
    if not changed.any():
        return None
    largest = abs(one - other).max()
    return f"{changed.sum()} of {one.size} {what} differ, by at most {largest:.3g}"


def _evaluations_differ(original: RunSummary, repeat: RunSummary) -> str | None:
    pairs = zip(original.evaluations, repeat.evaluations, strict=False)
    for one, other in pairs:
        for key, value in one.items():
            if value != other.get(key):
                return (
                    f"differ from decision {one['decisions']:.0f} on: {key} {value:.6g}, "
                    f"in the repeat {other.get(key, math.nan):.6g}"
                )
    counts = len(original.evaluations), len(repeat.evaluations)
    return None if counts[0] == counts[1] else "{}, in the repeat {}".format(*counts)


def _origins_differ(original: Mapping[str, Any], repeat: Mapping[str, Any]) -> list[str]:
    """Differences in commit, versions and machine, from run to repeat and within each."""
    lines = differences(original, repeat, "in the repeat")
    for name, origin in (("run", original), ("repeat", repeat)):
        resumed = origin.get("resumed")
        for later in resumed if isinstance(resumed, list) else ():
            lines += [
                f"within the {name}: {line}"
                for line in differences(origin, later, "after an interruption")
            ]
    return lines
