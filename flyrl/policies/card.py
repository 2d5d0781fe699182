"""Model cards: what a policy is, how it came about and what it can do, from its own record."""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from flyrl.envs.record import randomisation_text
from flyrl.policies.bundle import PolicyBundle, trained_with_preset
from flyrl.terrains import terrain_label
from flyrl.text import printable

_UNKNOWN: Final = "not recorded"

_LIMITS: Final = """\
- It was trained and judged in the setting above and in no other. On other terrain, with another
  body, leg controller or physics, it may fail.
- It is deterministic.
- It moves a simulated body. It says nothing by itself about how a real one is moved."""


def model_card(name: str, bundle: PolicyBundle) -> str:
    """Model card of a policy, as Markdown.

    Parameters
    ----------
    name
        Of the policy.
    bundle
        The policy. Of `bundle.training`, the card shows "algo", "seed", "decisions", "command",
        "provenance" (as in a run folder) and "held_out": "episodes", "seed", "compared" (the
        metrics that the task is compared by, success first), and "results", one row per entrant
        with "controller", "success_rate" and "metrics" as in an evaluation's summary. What is
        missing is said to be.
    """
    env, training = bundle.env, bundle.training
    held_out = _mapping(training.get("held_out"))
    return f"""\
# {name}

Moves the body in the task {_cell(_name(env, "task"))} on {_cell(_terrain(env))} terrain. Loads with
`flyrl.load_policy("{name}")` and enters an evaluation as `policies=[{name}]`.

## Trained in

{_table(("what", "which"), _setting(bundle))}

## Trained with

{_table(("what", "which"), _making(bundle))}

## Held-out episodes

{_figures(held_out)}

## Observation and action

The observation is one vector of {sum(term.size for term in bundle.observation)} values:

{_table(("term", "values"), [(term.name, term.size) for term in bundle.observation])}

{_action(bundle)}

## Limits

{_LIMITS}

## Licence

Apache-2.0, as flyrl.
"""


def _action(bundle: PolicyBundle) -> str:
    kind, low, high = "values", list(bundle.action_low), list(bundle.action_high)
    if bundle.squashing == "argmax":
        kind, low, high = "whole numbers", list(map(int, low)), list(map(int, high))
    return f"The action is {len(low)} {kind}, from {low} to\n{high}."


def _setting(bundle: PolicyBundle) -> list[tuple[str, Any]]:
    env = bundle.env
    interval = _mapping(env.get("task")).get("decision_interval", _UNKNOWN)
    preset = trained_with_preset(bundle)
    drawn = randomisation_text(env["randomisation"]) if "randomisation" in env else _UNKNOWN
    return [
        ("task", _name(env, "task")),
        ("decision interval, s", interval),
        ("terrain", _terrain(env)),
        *_body(env),
        ("physics", f"{preset.name}, version {preset.version}" if preset else _own_physics(env)),
        ("randomisation", drawn),
    ]


def _making(bundle: PolicyBundle) -> list[tuple[str, Any]]:
    training = bundle.training
    provenance = _mapping(training.get("provenance"))
    packages = {"python": provenance.get("python"), **_mapping(provenance.get("packages"))}
    versions = ", ".join(f"{name} {version}" for name, version in packages.items() if version)
    command = training.get("command")
    return [
        ("algorithm", training.get("algo", _UNKNOWN)),
        ("decisions", training.get("decisions", _UNKNOWN)),
        ("seed", training.get("seed", _UNKNOWN)),
        ("network", " → ".join(map(str, bundle.network.sizes)) + f", {bundle.network.activation}"),
        ("command", f"`{command}`" if command else _UNKNOWN),
        ("commit", _mapping(provenance.get("git")).get("commit", _UNKNOWN)),
        ("versions", versions or _UNKNOWN),
        ("CPU", _mapping(provenance.get("cpu")).get("model") or _UNKNOWN),
    ]


def _figures(held_out: Mapping[str, Any]) -> str:
    if not held_out:
        return f"Figures are {_UNKNOWN}."
    metrics = held_out["compared"][1:]
    rows = []
    for result in held_out["results"]:
        rate = result["success_rate"]
        rows.append(
            (
                result["controller"],
                f"{rate['value']:.1%}",
                f"{rate['low']:.1%} to {rate['high']:.1%}",
                *(_rounded(result["metrics"][metric]["median"]) for metric in metrics),
            )
        )
    header = ("who", "success", "95 % interval", *(f"median {metric}" for metric in metrics))
    asked = _cell(f"`episodes={held_out['episodes']} seed={held_out['seed']}`")
    return (
        f"The same {_cell(held_out['episodes'])} episodes for everybody, none of them trained or "
        f"chosen on ({asked}):\n\n{_table(header, rows)}"
    )


def _rounded(value: float | None) -> str:
    return "none" if value is None else f"{value:.2f}"


def _table(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(map(_cell, line))} |" for line in lines)


def _cell(value: Any) -> str:
    """Text in one line that is no Markdown or HTML, but for code in backticks."""
    text = printable(" ".join(str(value).split()))
    if re.fullmatch("`[^`]+`", text):
        return text.replace("|", r"\|")
    return re.sub(r"([\\`*|]|(?<=\])\()", r"\\\1", text).replace("<", "&lt;")


def _body(env: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """The body, and what controls a fly's legs."""
    segments = _mapping(env.get("body")).get("segments")
    if segments is not None:
        return [("body", f"worm of {segments} segments")]
    return [("body", _name(env, "body")), ("leg controller", _name(env, "controller"))]


def _name(env: Mapping[str, Any], part: str) -> str:
    return str(_mapping(env.get(part)).get("name", _UNKNOWN))


def _terrain(env: Mapping[str, Any]) -> str:
    return terrain_label(_name(env, "terrain"), _mapping(env.get("terrain")).get("random"))


def _own_physics(env: Mapping[str, Any]) -> str:
    return f"of its own: {env.get('physics', _UNKNOWN)}"


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}
