"""Put the best policy of a run into `assets/policies/`, with its model card.

    python tools/publish_policy.py runs/<run> target-flat    # judge it on 500 episodes, write both
    python tools/publish_policy.py --check                   # fail if a card is not its policy's

The policy is judged beside the fixed controllers on episodes that no run is trained or chosen on.
Settings, command, provenance and figures of the run go into the policy file itself; the card says
what the file says.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import re
import shlex
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from flyrl.cli.config import training_config  # noqa: E402
from flyrl.envs.config import BODIES, EnvConfig, env_record, randomisation_text  # noqa: E402
from flyrl.evaluation import EvaluationConfig, evaluate  # noqa: E402
from flyrl.evaluation.metrics import compared_metrics  # noqa: E402
from flyrl.files import write_bytes, write_text  # noqa: E402
from flyrl.policies import PolicyBundle, load_bundle, named_policies, save_bundle  # noqa: E402
from flyrl.policies.bundle import SUFFIX, policies_folder, policy_file  # noqa: E402
from flyrl.simulation.physics import preset_version  # noqa: E402
from flyrl.tasks import TASKS  # noqa: E402
from flyrl.terrains import TERRAINS, terrain_label  # noqa: E402
from flyrl.text import printable  # noqa: E402
from flyrl.training.runs import read_record  # noqa: E402
from flyrl.validation import plain  # noqa: E402

LARGEST_BYTES: Final = 200_000

_LIMITS: Final = """\
- It was trained and judged in the setting above and in no other. On other terrain, with another
  body, leg controller or physics, it may fail.
- It is deterministic.
- It moves a simulated body. It says nothing by itself about how a real one is moved."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Read the command line, then publish or check."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("run", nargs="?", type=Path, help="run folder")
    parser.add_argument("name", nargs="?", help="name of the policy, such as target-flat")
    parser.add_argument("--episodes", type=int, default=500, help="how many to judge it on")
    parser.add_argument("--num-threads", type=int, default=0, help="0: one per CPU")
    parser.add_argument("--folder", type=Path, default=policies_folder(), help="where it goes")
    parser.add_argument("--check", action="store_true", help="compare cards, write nothing")
    given = parser.parse_args(arguments)
    if given.check:
        sys.exit(check())
    if given.run is None or given.name is None:
        parser.error("name a run folder and the policy, or --check")
    try:
        publish(given.run, given.name, given.folder, given.episodes, given.num_threads)
    except (ValueError, OSError) as error:
        parser.error(str(error))


def check() -> int:
    """Name the policies whose card differs from what their file says; 1 if there are any."""
    stale = [
        name
        for name, path in named_policies().items()
        if not path.with_suffix(".md").is_file()
        or path.with_suffix(".md").read_text(encoding="utf-8")
        != model_card(name, load_bundle(path))
    ]
    for name in stale:
        print(f"{name}: its card is missing, or says something else than the policy file")
    return int(bool(stale))


def publish(run: Path, name: str, folder: Path, episodes: int, num_threads: int) -> None:
    """Judge the best policy of a run, and write it and its card to `folder`.

    Raises
    ------
    ValueError
        A name that cannot be one, no run, a run of uncommitted code, or a policy that is too large.
    OSError
        A part of the run folder is missing.
    """
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name):
        raise ValueError(f"name: {name!r}; allowed: small letters and digits, joined by hyphens")
    record = read_record(run)
    provenance = json.loads((run / "provenance.json").read_text())
    if (provenance["git"] or {}).get("is_dirty"):
        raise ValueError(f"{run} ran code that is in no commit; see its code.diff")
    _check_size(policy_file(run).stat().st_size)  # before it is judged, which takes minutes
    bundle = load_bundle(run)
    training = {
        # a policy of today holds its own
        "settings": {group: record[group] for group in ("algo", "training")},
        **bundle.training,
        # the first line; those after it say where it was resumed
        "command": _command_anywhere((run / "command.txt").read_text().splitlines()[0]),
        "provenance": {**provenance, "cpu": {"model": provenance["cpu"]["model"]}},
        "held_out": judge(run, record, episodes, num_threads),
    }
    bundle = dataclasses.replace(bundle, training=training)
    with tempfile.TemporaryDirectory() as scratch:
        save_bundle(bundle, Path(scratch) / "policy")
        data = (Path(scratch) / "policy").read_bytes()
    _check_size(len(data))
    folder.mkdir(parents=True, exist_ok=True)
    write_bytes(folder / f"{name}{SUFFIX}", data)
    write_text(folder / f"{name}.md", model_card(name, bundle))
    print(f"policy: {folder / name}{SUFFIX} ({len(data)} bytes)")


def _check_size(size: int) -> None:
    if size > LARGEST_BYTES:
        raise ValueError(f"the policy has {size} bytes; allowed: {LARGEST_BYTES}")


def _command_anywhere(command: str) -> str:
    """Command without the places that interpreter, script and run had on the machine it ran on."""
    places = ("runs_folder=", "hydra.run.dir=")
    words = [word for word in shlex.split(command) if not word.startswith(places)]
    return shlex.join(Path(word).name if Path(word).is_absolute() else word for word in words)


def judge(run: Path, record: dict[str, Any], episodes: int, num_threads: int) -> dict[str, Any]:
    """Figures of the policy and of the fixed controllers on the same episodes."""
    env = training_config(record).env
    config = EvaluationConfig(
        policies=(str(policy_file(run)),),
        task=env.resolved_task,
        terrains=(env.scene.terrain,),
        body=env.scene.body,
        physics=env.scene.physics,
        randomisation=env.resolved_randomisation,
        episodes=episodes,
        num_threads=num_threads,
        progress=True,
    )
    compared = list(compared_metrics(config.resolved_task))
    kept = ("controller", "outcomes", "success_rate", "paired")
    results = [
        {key: row[key] for key in kept}
        | {"metrics": {name: row["metrics"][name] for name in compared if name in row["metrics"]}}
        for row in evaluate(config).summaries
    ]
    return {"episodes": episodes, "seed": config.seed, "compared": compared, "results": results}


def model_card(name: str, bundle: PolicyBundle) -> str:
    """Model card of a policy, as Markdown.

    Parameters
    ----------
    name
        Of the policy.
    bundle
        The policy, whose `training` has "algo", "seed", "decisions", "command", "provenance" (as in
        a run folder) and "held_out": "episodes", "seed", "compared" (the metrics that the task is
        compared by, success first), and "results", one row per entrant, the policy first, with
        "controller", "success_rate" and "metrics" as in an evaluation's summary.
    """
    env, training = bundle.env, bundle.training
    terrain = terrain_label(env["terrain"]["name"], env["terrain"].get("random"))
    return f"""\
# {name}

Moves the body in the task {_cell(env["task"]["name"])} on {_cell(terrain)} terrain. Loads with
`flyrl.load_policy("{name}")` and enters an evaluation as `policies=[{name}]`.

## Trained in

{_table(("what", "which"), _setting(env, terrain))}

## Trained with

{_table(("what", "which"), _making(bundle))}

## Held-out episodes

{_figures(name, training["held_out"], _evaluation(name, env, terrain))}

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


def _setting(env: Mapping[str, Any], terrain: str) -> list[tuple[str, Any]]:
    preset = preset_version(env["physics"])
    task, body = env["task"], env["body"]
    if "segments" in body:
        legs, usual_name = [], f"worm of {body['segments']} segments"
    else:
        legs, usual_name = [("leg controller", env["controller"]["name"])], body["name"]
    own = f"of its own: {env['physics']}"
    return [
        ("task", _without("task", [task["name"], *_task_words(env)])),
        ("decision interval, s", task["decision_interval"]),
        ("terrain", terrain),
        ("body", _without("body", _body_words(env)) or usual_name),
        *legs,
        ("physics", f"{preset.name}, version {preset.version}" if preset else own),
        ("randomisation", randomisation_text(env["randomisation"])),
    ]


def _without(group: str, words: Iterable[str]) -> str:
    """Overrides without the name of their group."""
    return ", ".join(re.sub(rf"^{group}[.=]", "", word) for word in words)


def _evaluation(name: str, env: Mapping[str, Any], terrain: str) -> list[str]:
    """Words of the command that compares the policy in its own setting."""
    task = env["task"]["name"]
    words = ["python", "evaluate.py", f"policies=[{name}]", f"task={task}"]
    if task not in TASKS or terrain not in TERRAINS:
        return [*words, f"terrains=[{terrain}]"]
    usual = env_record(EnvConfig(task, terrain=terrain))
    words += _task_words(env) + _body_words(env)
    preset, usual_preset = (preset_version(each["physics"]) for each in (env, usual))
    if preset and usual_preset and preset.name != usual_preset.name:
        words.append(f"physics={preset.name}")
    words += _changed("randomisation", env["randomisation"], usual["randomisation"])
    usual_ground = usual["terrain"]
    ground = {
        key: value
        for key, value in env["terrain"].items()
        if key in usual_ground and value != usual_ground[key]
    }
    return [*words, f"terrains=[{_typed({'name': terrain, **ground} if ground else terrain)}]"]


def _task_words(env: Mapping[str, Any]) -> list[str]:
    """Overrides of the settings of the task that are not its usual ones."""
    task = env["task"]
    if task["name"] not in TASKS:
        return []
    usual = env_record(EnvConfig(task["name"]))["task"]
    # records from before drives were smooth do not have it
    return _changed("task", {"drive_time_constant": 0.0, **task}, usual)


def _body_words(env: Mapping[str, Any]) -> list[str]:
    """Overrides that make the body from the nearest one, unless it is the task's usual one."""
    task, body = env["task"]["name"], env["body"]
    if task not in TASKS or not _changed("body", body, env_record(EnvConfig(task))["body"]):
        return []
    each = {name: plain(config) for name, config in BODIES.items()}
    alike = [name for name in each if each[name].keys() == body.keys()]
    typed = [[f"body={name}", *_changed("body", body, each[name])] for name in alike]
    return min(typed, key=lambda given: len(" ".join(given)))


def _changed(group: str, given: Mapping[str, Any], usual: Mapping[str, Any]) -> list[str]:
    """Overrides of the settings that are not the usual ones."""
    words = []
    for key, value in given.items():
        if isinstance(value, Mapping) and isinstance(usual.get(key), Mapping):
            # terms that an older record does not name were not in the reward
            missing = dict.fromkeys(usual[key], 0.0) if key == "weights" else {}
            words += _changed(f"{group}.{key}", {**missing, **value}, usual[key])
        elif key in usual and value != usual[key]:
            words.append(f"{group}.{key}={_typed(value)}")
    return words


def _typed(value: Any) -> str:
    return json.dumps(value, separators=(",", ":")).replace('"', "")


def _making(bundle: PolicyBundle) -> list[tuple[str, Any]]:
    training, provenance = bundle.training, bundle.training["provenance"]
    packages = {"python": provenance["python"], **provenance["packages"]}
    return [
        ("algorithm", training["algo"]),
        ("decisions", training["decisions"]),
        ("seed", training["seed"]),
        ("network", " → ".join(map(str, bundle.sizes)) + f", {bundle.activation}"),
        ("command", f"`{training['command']}`"),
        ("commit", provenance["git"]["commit"]),
        (
            "versions",
            ", ".join(f"{name} {version}" for name, version in packages.items() if version),
        ),
        ("CPU", provenance["cpu"]["model"]),
    ]


def _figures(name: str, held_out: Mapping[str, Any], command: Sequence[str]) -> str:
    metrics = held_out["compared"][1:]
    rows = []
    for place, result in enumerate(held_out["results"]):
        rate = result["success_rate"]
        rows.append(
            (
                result["controller"] if place else name,
                f"{rate['value']:.1%}",
                f"{rate['low']:.1%} to {rate['high']:.1%}",
                *(_rounded(result["metrics"][metric]["median"]) for metric in metrics),
            )
        )
    header = ("who", "success", "95 % interval", *(f"median {metric}" for metric in metrics))
    drawn = (f"episodes={held_out['episodes']}", f"seed={held_out['seed']}")
    typed = _cell(f"`{shlex.join((*command, *drawn))}`")
    return (
        f"The same {_cell(held_out['episodes'])} episodes for everybody, none of them trained or "
        f"chosen on:\n\n{typed}\n\n{_table(header, rows)}"
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


if __name__ == "__main__":
    main()
