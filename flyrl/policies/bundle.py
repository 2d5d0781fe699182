"""The policy bundle: one safetensors file with the weights and everything needed to act on them.

Loading a bundle runs no code and unpickles nothing. Its JSON record stands in the file's metadata
under `flyrl`; the record's `sha256` is that of the whole file with these 64 digits set to zero, so
that any changed byte is noticed.
"""

import dataclasses
import hashlib
import json
import math
import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from flyrl.files import write_bytes
from flyrl.policies.library import named_policies
from flyrl.policies.networks import (
    ACTIVATIONS,
    LSTM,
    MLP,
    Layer,
    LSTMLayer,
    Normaliser,
)
from flyrl.simulation.physics import PRESET_VERSIONS, PresetVersion, preset_version
from flyrl.tasks import Neurons, Task
from flyrl.text import printable
from flyrl.validation import did_you_mean, plain_record

SCHEMA: Final = "flyrl.policy/1"

Squashing = Literal["clip", "tanh", "argmax"]
SQUASHINGS: Final[tuple[Squashing, ...]] = get_args(Squashing)
"""How outputs become an action.

One output per component is clipped to the bounds ("clip"), or its tanh is stretched over them
("tanh"). Or each component is a whole number, and has an output for every one from its lower to its
upper bound, component after component: the number with the largest output is taken, the first of
equals ("argmax").
"""

_LSTM_PARTS: Final = tuple(field.name for field in fields(LSTMLayer))
_METADATA_KEY: Final = "flyrl"
_NO_DIGEST: Final = "0" * 64
_HEADER_LENGTH_BYTES: Final = 8  # safetensors: little-endian length of the JSON header
_LARGEST_FILE_BYTES: Final = (
    256 * 2**20
)  # a policy here has some 10 kB; refuse to read a disk image
_LARGEST_HEADER_BYTES: Final = 2**18  # some 20 kB
_LARGEST_WHOLE: Final = 2**31 - 1  # more than any output stands for


class PolicyFileError(ValueError):
    """A policy file that is missing, damaged, foreign, or made for something else."""


@dataclass(frozen=True)
class TermLayout:
    """A named stretch of the flat observation.

    Attributes
    ----------
    name
        Name of the term in the task's observation table.
    size
        Number of values.
    """

    name: str
    size: int

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise ValueError(f"name of an observation term: {self.name!r}; allowed: a text")
        if type(self.size) is not int or self.size < 1:
            raise ValueError(f"size of {self.name!r}: {self.size!r}; allowed: 1, 2, 3, …")


@dataclass(frozen=True, eq=False)
class PolicyBundle:
    """A deterministic policy and where it comes from.

    Attributes
    ----------
    network
        Observation, or what `lstm` makes of it, to output.
    squashing
        Output to action; see `SQUASHINGS`.
    observation
        Layout of the flat observation, in order; see `observation_layout`.
    action_low, action_high
        Bounds of the action, shape (a,) each; whole numbers with "argmax".
    env
        What it was trained in, as plain JSON values: task, body, terrain, controller, physics.
    training
        What the training came to, as plain JSON values.
    normaliser
        What the observation goes through first; None leaves it as it is.
    lstm
        Memory between the observation and the network, if there is one.
    """

    network: MLP
    squashing: Squashing
    observation: tuple[TermLayout, ...]
    action_low: tuple[float, ...]
    action_high: tuple[float, ...]
    env: Mapping[str, Any]
    training: Mapping[str, Any]
    normaliser: Normaliser | None = None
    lstm: LSTM | None = None

    def __post_init__(self) -> None:
        _check_choice("activation", self.network.activation, ACTIVATIONS)
        _check_choice("squashing", self.squashing, SQUASHINGS)
        sizes = self.network.sizes
        if self.lstm is not None and self.lstm.sizes[-1] != sizes[0]:
            raise ValueError(
                f"the LSTM gives {self.lstm.sizes[-1]} values, the network takes {sizes[0]}"
            )
        if (given := sum(term.size for term in self.observation)) != self.num_inputs:
            raise ValueError(
                f"the observation terms have {given} values, the network takes {self.num_inputs}"
            )
        if self.normaliser is not None and len(self.normaliser.mean) != given:
            raise ValueError(
                f"normaliser.mean has {len(self.normaliser.mean)} values, the observation {given}"
            )
        self._check_bounds()

    def _check_bounds(self) -> None:
        """Raise ValueError unless the bounds are such, and as many as the network's outputs."""
        num_outputs = self.network.sizes[-1]
        if len(self.action_low) != len(self.action_high) or (
            self.squashing != "argmax" and len(self.action_low) != num_outputs
        ):
            raise ValueError(
                f"action bounds of {len(self.action_low)} and {len(self.action_high)} values, "
                f"the network gives {num_outputs}"
            )
        for low, high in zip(self.action_low, self.action_high, strict=True):
            if not -math.inf < low <= high < math.inf:
                raise ValueError(f"action bounds: {low} and {high}; allowed: finite, low <= high")
        if self.squashing != "argmax":
            return
        for bound in self.action_low + self.action_high:
            if bound != round(bound) or abs(bound) > _LARGEST_WHOLE:
                raise ValueError(
                    f"action bounds: {bound}; allowed with squashing 'argmax': whole numbers, "
                    f"at most {_LARGEST_WHOLE} from 0"
                )
        if sum(self.action_counts) != num_outputs:
            raise ValueError(
                f"action bounds that {sum(self.action_counts)} whole numbers lie within, "
                f"the network gives {num_outputs}"
            )

    @property
    def action_counts(self) -> tuple[int, ...]:
        """How many whole numbers each component chooses from; only with "argmax"."""
        bounds = zip(self.action_low, self.action_high, strict=True)
        return tuple(int(high) - int(low) + 1 for low, high in bounds)

    @property
    def num_inputs(self) -> int:
        """Values of an observation."""
        return (self.network if self.lstm is None else self.lstm).sizes[0]


def _check_choice(key: str, value: object, allowed: Sequence[str]) -> None:
    if value not in allowed:
        raise ValueError(f"{key}: {value!r}; allowed: {', '.join(allowed)}")


def observation_layout(task: Task) -> tuple[TermLayout, ...]:
    """Layout of a task's observation as a vector; see `flyrl.policies.networks`."""
    return tuple(TermLayout(term.name, term.size) for term in task.flattened().observation)


def action_bounds(task: Task) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Lower and upper bounds of a task's action, as its Gymnasium space has them; (a,) each."""
    actions = task.actions
    if isinstance(actions, Neurons) and actions.is_integer:
        return (0.0,) * actions.size, tuple(float(pool - 1) for pool in actions.pools)
    low, high = (bound.astype(np.float32).tolist() for bound in actions.bounds)
    return tuple(low), tuple(high)


def save_bundle(bundle: PolicyBundle, path: Path) -> None:
    """Write `bundle` to `path` (.safetensors), whole or not at all.

    Parameters
    ----------
    bundle
        The policy.
    path
        File to write; an existing one is replaced.
    """
    record = {"sha256": _NO_DIGEST, **bundle_record(bundle)}
    data = save(_tensors(bundle), {_METADATA_KEY: json.dumps(record, allow_nan=False)})
    digest = hashlib.sha256(data).hexdigest()
    # The digest is the first value of the header, so the first match is the field itself.
    data = data.replace(_NO_DIGEST.encode(), digest.encode(), 1)
    write_bytes(path, data)


def bundle_record(bundle: PolicyBundle) -> dict[str, Any]:
    """All but the weights, as plain JSON values."""
    return {
        "schema": SCHEMA,
        "architecture": _architecture(bundle),
        "observation": [dataclasses.asdict(term) for term in bundle.observation],
        "action": {"low": bundle.action_low, "high": bundle.action_high},
        "normaliser": None if bundle.normaliser is None else _normaliser_record(bundle.normaliser),
        "env": bundle.env,
        "training": bundle.training,
    }


def _architecture(bundle: PolicyBundle) -> dict[str, Any]:
    network: dict[str, Any] = {
        "sizes": bundle.network.sizes,
        "activation": bundle.network.activation,
        "squashing": bundle.squashing,
    }
    if bundle.lstm is None:
        return {"kind": "mlp", **network}
    return {"kind": "lstm", "lstm_sizes": bundle.lstm.sizes, **network}


def _tensors(bundle: PolicyBundle) -> dict[str, NDArray[np.float32]]:
    tensors = {}
    for i, layer in enumerate(bundle.network.layers):
        tensors[f"{i}.weight"] = layer.weight
        tensors[f"{i}.bias"] = layer.bias
    if bundle.lstm is not None:
        for i, lstm_layer in enumerate(bundle.lstm.layers):
            tensors |= {f"lstm.{i}.{part}": getattr(lstm_layer, part) for part in _LSTM_PARTS}
    return {
        name: np.ascontiguousarray(tensor, dtype=np.float32) for name, tensor in tensors.items()
    }


def _normaliser_record(normaliser: Normaliser) -> dict[str, Any]:
    return {
        "mean": normaliser.mean.tolist(),
        "variance": normaliser.variance.tolist(),
        "epsilon": normaliser.epsilon,
        "clip": normaliser.clip,
    }


def policy_file(path: str | os.PathLike[str], others: Iterable[str] = ()) -> Path:
    """Path of the policy file that `path` means.

    Parameters
    ----------
    path
        A file, a run folder (its best policy, else its last), or else the name of a policy that
        comes with flyrl.
    others
        Names besides that the caller takes, for the message.

    Raises
    ------
    PolicyFileError
        Nothing there.
    """
    place = Path(path)
    if place.is_file():
        return place
    if place.is_dir():
        for name in ("best.safetensors", "last.safetensors"):
            if (place / name).is_file():
                return place / name
        raise PolicyFileError(
            f"no policy in {place}: a run folder holds best.safetensors or last.safetensors"
        )
    named = named_policies()
    if (given := os.fspath(path)) in named:
        return named[given]
    names = (*named, *others)
    raise PolicyFileError(
        f"no policy at {place}: there is no such file or folder, and no policy of that name"
        f"{did_you_mean(given, names)}; names: {', '.join(names) or 'none'}"
    )


def load_bundle(path: str | os.PathLike[str]) -> PolicyBundle:
    """Read and check a policy file.

    Warns of a policy that was trained with another version of a preset of the physics.

    Parameters
    ----------
    path
        As `policy_file` takes it: a bundle, a run folder, or a name.

    Raises
    ------
    PolicyFileError
        It is missing, truncated, changed, no bundle, or of a schema that is not read here.
    """
    file = policy_file(path)
    try:
        if (size := file.stat().st_size) > _LARGEST_FILE_BYTES:
            raise PolicyFileError(f"{file} is no policy: {size} bytes are too many for one")
        data = file.read_bytes()
    except OSError as error:
        raise PolicyFileError(f"cannot read the policy {file}: {error.strerror}") from error
    if not data:
        raise PolicyFileError(f"{file} is empty")
    length = int.from_bytes(data[:_HEADER_LENGTH_BYTES], "little")
    if _LARGEST_HEADER_BYTES < length <= len(data):
        raise PolicyFileError(
            f"{file} is no policy: a header of {length} bytes is too long for one"
        )
    try:
        tensors = load(data)
        header = json.loads(data[_HEADER_LENGTH_BYTES : _HEADER_LENGTH_BYTES + length])
        record = json.loads(header["__metadata__"][_METADATA_KEY])
        schema, digest = str(record["schema"]), str(record["sha256"])
    except SafetensorError as error:
        raise PolicyFileError(
            f"{file} is no safetensors file, or it is truncated: {error}"
        ) from error
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise PolicyFileError(
            f"{file} is a safetensors file, but no flyrl policy: it carries no readable record"
        ) from error
    if schema != SCHEMA:
        raise PolicyFileError(f"{file} has schema {schema!r}; this flyrl reads {SCHEMA!r}")
    blank = data.replace(digest.encode(), _NO_DIGEST.encode(), 1)
    if hashlib.sha256(blank).hexdigest() != digest:
        raise PolicyFileError(f"{file} was changed after it was written: its sha256 does not match")
    try:
        plain_record("the record", record)
        bundle = _bundle(record, tensors)
    except (KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        raise PolicyFileError(f"{file} has an incomplete or wrong record: {error}") from error
    preset = trained_with_preset(bundle)
    if preset is not None and preset.version != (now := PRESET_VERSIONS[preset.name]):
        warnings.warn(
            f"{printable(str(file))} was trained with version {preset.version} of the physics "
            f"preset {preset.name!r}, which is now at version {now}: flies walk "
            "differently in it, so earlier figures do not compare",
            stacklevel=2,
        )
    return bundle


def trained_with_preset(bundle: PolicyBundle) -> PresetVersion | None:
    """Preset of the physics that a policy was trained with; None: of none, or not known."""
    noted = bundle.training.get("physics_preset")
    if isinstance(noted, dict):
        name, version = noted.get("name"), noted.get("version")
        if name in tuple(PRESET_VERSIONS) and type(version) is int:
            return PresetVersion(name, version)
    settings = bundle.env.get("physics")
    return preset_version(settings) if isinstance(settings, dict) else None


def _bundle(record: Mapping[str, Any], tensors: Mapping[str, NDArray[Any]]) -> PolicyBundle:
    architecture = record["architecture"]
    _check_choice("architecture", architecture["kind"], ("mlp", "lstm"))
    num_layers = len(architecture["sizes"]) - 1
    num_lstm_layers = len(architecture["lstm_sizes"]) - 1 if architecture["kind"] == "lstm" else 0
    names = {f"{i}.{part}" for i in range(num_layers) for part in ("weight", "bias")}
    names |= {f"lstm.{i}.{part}" for i in range(num_lstm_layers) for part in _LSTM_PARTS}
    if names != set(tensors):
        first = min(names.symmetric_difference(tensors))
        raise ValueError(f"{len(tensors)} tensors; allowed: {len(names)}; look at {first!r:.60}")
    for name, tensor in tensors.items():
        if tensor.dtype != np.float32 or not np.isfinite(tensor).all():
            raise ValueError(f"tensor {name} is not of finite float32 values")
    network = MLP(
        tuple(Layer(tensors[f"{i}.weight"], tensors[f"{i}.bias"]) for i in range(num_layers)),
        architecture["activation"],
    )
    if list(network.sizes) != architecture["sizes"]:
        raise ValueError(f"sizes {architecture['sizes']}, but the tensors have {network.sizes}")
    normaliser = record["normaliser"]
    for key in ("env", "training"):
        if not isinstance(record[key], dict):
            raise ValueError(f"{key} must be an object, got {record[key]!r:.60}")
    return PolicyBundle(
        network=network,
        squashing=architecture["squashing"],
        observation=tuple(TermLayout(term["name"], term["size"]) for term in record["observation"]),
        action_low=tuple(map(float, record["action"]["low"])),
        action_high=tuple(map(float, record["action"]["high"])),
        env=record["env"],
        training=record["training"],
        normaliser=None if normaliser is None else Normaliser(**normaliser),
        lstm=_lstm(architecture, tensors) if architecture["kind"] == "lstm" else None,
    )


def _lstm(architecture: Mapping[str, Any], tensors: Mapping[str, NDArray[Any]]) -> LSTM:
    sizes = architecture["lstm_sizes"]
    layers = (
        LSTMLayer(**{part: tensors[f"lstm.{i}.{part}"] for part in _LSTM_PARTS})
        for i in range(len(sizes) - 1)
    )
    lstm = LSTM(tuple(layers))
    if list(lstm.sizes) != sizes:
        raise ValueError(f"lstm_sizes {sizes}, but the tensors have {lstm.sizes}")
    return lstm
