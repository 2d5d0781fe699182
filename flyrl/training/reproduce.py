"""Repeat a run from its settings, and compare the two to the bit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from flyrl.policies.bundle import PolicyBundle, load_bundle
from flyrl.training.config import TrainingConfig, training_record
from flyrl.training.learn import Run, resume, train
from flyrl.training.provenance import differences
from flyrl.training.runs import RunSummary, read_run


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


def repeat_run(
    config: TrainingConfig, runs: Path, repeat: Path | None, command: Sequence[str] = ()
) -> Run:
    """Train anew in `runs`, or finish a repeat that was made before.

    Parameters
    ----------
    config
        Settings of the original; without its logger, to which a repeat says nothing.
    runs
        Folder in which the run folder is made.
    repeat
        Run folder of an earlier repeat; if it was interrupted, it is resumed.
    command
        The command that asked for it, for the record.

    Raises
    ------
    ValueError
        `repeat` is a run of other settings, or cannot be resumed.
    """
    if repeat is None:
        return train(config, runs, command)
    earlier = read_run(repeat)
    settings = {key: value for key, value in earlier.settings.items() if key != "logger"}
    if settings != training_record(config):
        raise ValueError(f"{repeat} is no repeat: it has other settings")
    if earlier.state == "finished":
        return Run(repeat, None)
    return resume(config, repeat, command)


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
    others = _architecture(second)
    for key, value in _architecture(first).items():
        if value != others[key]:
            return f"{key} {value}, in the repeat {others[key]}"
    differences = (
        _arrays_differ("parameters", _parameters(first), _parameters(second)),
        _arrays_differ("statistics of the normaliser", _statistics(first), _statistics(second)),
    )
    return "; ".join(filter(None, differences)) or None


def _architecture(bundle: PolicyBundle) -> dict[str, Any]:
    """All that decides how the policy acts, but for its arrays: these are of the same shapes."""
    normaliser = bundle.normaliser
    return {
        "layers": bundle.network.sizes,
        "LSTM": bundle.lstm and bundle.lstm.sizes,
        "activation": bundle.network.activation,
        "squashing": bundle.squashing,
        "observation": [(term.name, term.size) for term in bundle.observation],
        "action bounds": (bundle.action_low, bundle.action_high),
        "normaliser's epsilon and clip": normaliser and (normaliser.epsilon, normaliser.clip),
    }


def _parameters(bundle: PolicyBundle) -> list[NDArray[Any]]:
    layers = (*bundle.network.layers, *(bundle.lstm.layers if bundle.lstm else ()))
    return [array for layer in layers for array in vars(layer).values()]


def _statistics(bundle: PolicyBundle) -> list[NDArray[Any]]:
    return [bundle.normaliser.mean, bundle.normaliser.variance] if bundle.normaliser else []


def _arrays_differ(
    what: str, first: Sequence[NDArray[Any]], second: Sequence[NDArray[Any]]
) -> str | None:
    pairs = list(zip(first, second, strict=True))
    bits = [[array.view(f"u{array.itemsize}") for array in pair] for pair in pairs]
    changed = sum(int((one != other).sum()) for one, other in bits)
    if not changed:
        return None
    largest = max(float(abs(one.astype("f8") - other).max()) for one, other in pairs)
    total = sum(one.size for one, _ in pairs)
    return f"{changed} of {total} {what} differ, by at most {largest:.3g}"


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
