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
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
from gymnasium import Space
from gymnasium.spaces import Box, MultiDiscrete
from safetensors import SafetensorError
from safetensors.numpy import load, save

from flyrl.files import write_bytes
from flyrl.policies.networks import LSTM_PARTS, Activation, Normaliser, Weights
from flyrl.resources import assets_folder
from flyrl.simulation.physics import PRESET_VERSIONS, preset_version, walks_alike_on_flat
from flyrl.tasks import Task
from flyrl.text import printable
from flyrl.validation import Within, check_fields, did_you_mean, one_of, plain_record

SCHEMA: Final = "flyrl.policy/1"
SUFFIX: Final = ".safetensors"

Squashing = Literal["clip", "tanh", "argmax"]
"""How outputs become an action.

One output per component is clipped to the bounds ("clip"), or its tanh is stretched over them
("tanh"). Or each component is a whole number, and has an output for every one from its lower to its
upper bound, component after component: the number with the largest output is taken, the first of
equals ("argmax").
"""

_METADATA_KEY: Final = "flyrl"
_NO_DIGEST: Final = "0" * 64
_HEADER_LENGTH_BYTES: Final = 8  # safetensors: little-endian length of the JSON header
# a policy here has some 10 kB; refuse to read a disk image
_LARGEST_FILE_BYTES: Final = 256 * 2**20
_LARGEST_HEADER_BYTES: Final = 2**18  # some 20 kB
_LARGEST_WHOLE: Final = 2**31 - 1  # more than any output stands for

Sizes = tuple[Annotated[int, Within(1, math.inf)], ...]


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
    size: Annotated[int, Within(1, math.inf)]

    def __post_init__(self) -> None:
        check_fields(self, "observation term")


@dataclass(frozen=True, eq=False)
class PolicyBundle:
    """A deterministic policy and where it comes from.

    Attributes
    ----------
    weights
        float32, by the names and with the shapes of `weight_shapes`.
    sizes
        Inputs of the network, units of every hidden layer, and outputs.
    activation
        Function between two layers of the network.
    squashing
        Output to action; see `Squashing`.
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
    lstm_sizes
        Inputs, and units of every layer, of a memory between the observation and the network;
        () without one.
    """

    weights: Mapping[str, Weights]
    sizes: Sizes
    activation: Activation
    squashing: Squashing
    observation: tuple[TermLayout, ...]
    action_low: tuple[float, ...]
    action_high: tuple[float, ...]
    env: Mapping[str, Any]
    training: Mapping[str, Any]
    normaliser: Normaliser | None = None
    lstm_sizes: Sizes = ()

    def __post_init__(self) -> None:
        check_fields(self)
        self._check_weights()
        self._check_bounds()
        observed = sum(term.size for term in self.observation)
        components = len(self.action_low)
        outputs = sum(self.action_counts) if self.squashing == "argmax" else components
        sizes = [
            ("the observation terms", observed, self.num_inputs),
            *[("the LSTM", units, self.sizes[0]) for units in self.lstm_sizes[1:]],
            ("the upper action bounds", len(self.action_high), components),
            ("the network's outputs", self.sizes[-1], outputs),
        ]
        if self.normaliser is not None:
            sizes.append(("normaliser.mean", len(self.normaliser.mean), observed))
        for what, size, wanted in sizes:
            if size != wanted:
                raise ValueError(f"{what}: {size} values, but {wanted} are taken")

    def _check_weights(self) -> None:
        """Raise ValueError unless the weights are finite, and of the shapes that the sizes say."""
        if len(self.sizes) < 2 or len(self.lstm_sizes) == 1:
            raise ValueError(
                f"a network has at least one layer, got sizes {self.sizes}, {self.lstm_sizes}"
            )
        shapes = weight_shapes(self.sizes, self.lstm_sizes)
        given = {name: values.shape for name, values in self.weights.items()}
        for name in (*shapes, *given):
            if given.get(name) != shapes.get(name):
                raise ValueError(
                    f"tensor {name!r:.60}: shape {given.get(name)}; allowed by the sizes of the "
                    f"layers: {shapes.get(name)}"
                )
            if self.weights[name].dtype != np.float32 or not np.isfinite(self.weights[name]).all():
                raise ValueError(f"tensor {name!r} is not of finite float32 values")

    def _check_bounds(self) -> None:
        """Raise ValueError unless the lower bounds lie below the upper ones, and are whole."""
        for low, high in zip(self.action_low, self.action_high, strict=False):
            if not low <= high:
                raise ValueError(f"action bounds: {low} and {high}; allowed: low <= high")
        whole = self.action_low + self.action_high if self.squashing == "argmax" else ()
        for bound in whole:
            if bound != round(bound) or abs(bound) > _LARGEST_WHOLE:
                raise ValueError(
                    f"action bounds: {bound}; allowed with squashing 'argmax': whole numbers, "
                    f"at most {_LARGEST_WHOLE} from 0"
                )

    @property
    def action_counts(self) -> tuple[int, ...]:
        """How many whole numbers each component chooses from; only with "argmax"."""
        bounds = zip(self.action_low, self.action_high, strict=False)
        return tuple(int(high) - int(low) + 1 for low, high in bounds)

    @property
    def num_inputs(self) -> int:
        """Values of an observation."""
        return (self.lstm_sizes or self.sizes)[0]


def weight_shapes(sizes: Sizes, lstm_sizes: Sizes = ()) -> dict[str, tuple[int, ...]]:
    """Names of the weights and their shapes, as `networks.mlp` and `networks.lstm_step` say."""
    shapes: dict[str, tuple[int, ...]] = {}
    for i, (inputs, outputs) in enumerate(pairwise(sizes)):
        shapes |= {f"{i}.weight": (outputs, inputs), f"{i}.bias": (outputs,)}
    for i, (inputs, units) in enumerate(pairwise(lstm_sizes)):
        gates = 4 * units
        of_layer = ((gates, inputs), (gates, units), (gates,), (gates,))
        shapes |= {
            f"lstm.{i}.{part}": shape for part, shape in zip(LSTM_PARTS, of_layer, strict=True)
        }
    return shapes


def observation_layout(task: Task) -> tuple[TermLayout, ...]:
    """Layout of a task's observation as a vector; see `flyrl.policies.networks`."""
    return tuple(TermLayout(term.name, term.size) for term in task.flattened().observation)


def action_bounds(space: Space[Any]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Lower and upper bounds of actions, (a,) each; ValueError if no bundle holds such ones."""
    if isinstance(space, Box):
        low, high = space.low, space.high
    elif isinstance(space, MultiDiscrete) and not space.start.any():
        low, high = np.zeros(len(space.nvec)), space.nvec - 1.0
    else:
        raise ValueError(f"a bundle holds actions of a Box or a MultiDiscrete from 0; got {space}")
    return tuple(low.tolist()), tuple(high.tolist())


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
    data = save(dict(bundle.weights), {_METADATA_KEY: json.dumps(record, allow_nan=False)})
    digest = hashlib.sha256(data).hexdigest()
    # The digest is the first value of the header, so the first match is the field itself.
    data = data.replace(_NO_DIGEST.encode(), digest.encode(), 1)
    write_bytes(path, data)


def bundle_record(bundle: PolicyBundle) -> dict[str, Any]:
    """All but the weights, as plain JSON values."""
    memory = {"kind": "lstm", "lstm_sizes": bundle.lstm_sizes}
    normaliser = bundle.normaliser and {
        **vars(bundle.normaliser),
        "mean": bundle.normaliser.mean.tolist(),
        "variance": bundle.normaliser.variance.tolist(),
    }
    return {
        "schema": SCHEMA,
        "architecture": {
            **(memory if bundle.lstm_sizes else {"kind": "mlp"}),
            "sizes": bundle.sizes,
            "activation": bundle.activation,
            "squashing": bundle.squashing,
        },
        "observation": [dataclasses.asdict(term) for term in bundle.observation],
        "action": {"low": bundle.action_low, "high": bundle.action_high},
        "normaliser": normaliser,
        "env": bundle.env,
        "training": bundle.training,
    }


def policies_folder() -> Path:
    """Folder of the policies that come with flyrl, each beside its model card (<name>.md)."""
    return assets_folder() / "policies"


def named_policies() -> dict[str, Path]:
    """Files of the policies that come with flyrl, by name, in alphabetical order."""
    return {path.stem: path for path in sorted(policies_folder().glob(f"*{SUFFIX}"))}


def policy_name(file: Path) -> str | None:
    """Name of a policy file that comes with flyrl; None for any other file."""
    return file.stem if file in named_policies().values() else None


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

    Warns of a policy that was trained with another version of a preset of the physics, unless that
    is the same on the ground that it was trained on.

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
    record, tensors = _read(file)
    try:
        plain_record("the record", record)
        bundle = _bundle(record, tensors)
    except (KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        raise PolicyFileError(f"{file} has an incomplete or wrong record: {error}") from error
    physics = bundle.env.get("physics", {})
    is_flat = bundle.env.get("terrain", {}).get("name") == "flat"
    preset = preset_version(physics)
    if (
        preset is not None
        and preset.version != (now := PRESET_VERSIONS[preset.name])
        and not (is_flat and walks_alike_on_flat(physics))
    ):
        warnings.warn(
            f"{printable(str(file))} was trained with version {preset.version} of the physics "
            f"preset {preset.name!r}, which is now at version {now}: flies walk "
            "differently in it, so earlier figures do not compare",
            stacklevel=2,
        )
    return bundle


def _read(file: Path) -> tuple[dict[str, Any], dict[str, Weights]]:
    """Record and tensors of a file that is whole, and of the schema; neither is checked."""
    try:
        if (size := file.stat().st_size) > _LARGEST_FILE_BYTES:
            raise PolicyFileError(f"{file} is no policy: {size} bytes are too many for one")
        data = file.read_bytes()
    except OSError as error:
        raise PolicyFileError(f"cannot read the policy {file}: {error.strerror}") from error
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
    return record, tensors


def _bundle(record: Mapping[str, Any], weights: Mapping[str, Weights]) -> PolicyBundle:
    architecture = record["architecture"]
    kind = one_of("architecture", architecture["kind"], ("mlp", "lstm"))
    return PolicyBundle(
        weights,
        architecture["sizes"],
        architecture["activation"],
        architecture["squashing"],
        record["observation"],
        record["action"]["low"],
        record["action"]["high"],
        record["env"],
        record["training"],
        record["normaliser"],
        architecture["lstm_sizes"] if kind == "lstm" else (),
    )
