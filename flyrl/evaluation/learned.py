"""Learned entrants and a user's own: bundles, run folders, SB3 models, functions, objects."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Collection, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from flyrl.controllers.controller import controller_from
from flyrl.entry_points import check_trust, is_entry_point, load_module
from flyrl.evaluation.config import EvaluationConfig
from flyrl.evaluation.entrant import Entrant, free_name
from flyrl.files import file_digest
from flyrl.policies import LearnedPolicy, PolicyFileError, load_bundle
from flyrl.policies.bundle import policy_file, policy_name
from flyrl.policies.fixed import FunctionPolicy, takes
from flyrl.rollouts import Policy
from flyrl.tasks import Task, code_digests, code_of, task_record
from flyrl.terrains import terrain_label
from flyrl.validation import one_of


def changed_terms(entrant: Entrant, task: Task) -> list[str]:
    """Modules of the user's task and terms that are not what a policy was trained with."""
    training = entrant.record.get("training")
    before = training.get("terms") if isinstance(training, dict) else None
    if not isinstance(before, dict):  # fixed, or from before they were noted
        return []
    now = code_digests(code_of(task))
    return [module for module, digest in now.items() if before.get(module) != digest]


def make_learned(path: str, config: EvaluationConfig, taken: Collection[str]) -> Entrant:
    """Entrant of a learned policy.

    Parameters
    ----------
    path
        A policy file, a run folder, the name of a policy that comes with flyrl, or
        algorithm:file.zip of a model that Stable-Baselines3 saved.
    config
        Of the evaluation.
    taken
        Names that are not free any more.

    Raises
    ------
    ValueError
        Nothing there, or nothing that can be used here; a zip file without `trust_pickles`.
    """
    file, policy = _load(path, config)
    env, training = policy.bundle.env, policy.bundle.training
    _check_observations(file, policy, config.resolved_task)
    legs = env.get("controller")
    check_trust(file, legs, config.trust_pickles, "trust_pickles=true")
    try:
        controller = controller_from(legs) if legs is not None else config.legs
    except (TypeError, ValueError) as error:
        raise PolicyFileError(f"{file}: its leg controller cannot be used here: {error}") from error
    if controller is not None and not controller.follows_command:
        raise PolicyFileError(
            f"{file}: its leg controller, {controller.name!r}, ignores the drive, so that no "
            "policy can steer it"
        )
    interval = env["task"].get("decision_interval") if isinstance(env.get("task"), dict) else None
    name = free_name(policy_name(file) or str(training.get("algo", file.stem)), taken)
    record = {
        "name": name,
        "kind": "learned",
        "leg_controller": controller and controller.name,
        "policy": _how_learned(env, training),
        "source": str(file),
        "sha256": file_digest(file),
        "controller_config": controller and dataclasses.asdict(controller),
        "trained_in": dict(env),
        "training": dict(training),
    }
    return Entrant(name, controller, policy, interval, record)


def _load(path: str, config: EvaluationConfig) -> tuple[Path, LearnedPolicy]:
    algorithm, colon, model = path.partition(":")
    if not (colon and model.endswith(".zip")):
        file = policy_file(path)
        if file.suffix == ".zip":
            raise PolicyFileError(
                f"{path}: of a zip file, say which algorithm made it, e.g. ppo:{path}"
            )
        return file, LearnedPolicy(load_bundle(file))
    from flyrl.policies.sb3 import ALGORITHMS, import_sb3  # noqa: PLC0415  (takes torch)

    made_by = ALGORITHMS[one_of(f"policies: algorithm of {path!r}", algorithm, ALGORITHMS)]
    if not config.trust_pickles:
        raise PolicyFileError(
            f"{model} was not opened: a zip file of Stable-Baselines3 holds pickles, which can run "
            "any code when they are read. Say trust_pickles=true if you know who made it"
        )
    env = config.env(config.terrains[0])
    bundle = import_sb3(model, made_by, env, trust=True)
    # the file does not say what it was trained in; what it is loaded for is not that
    return Path(model), LearnedPolicy(dataclasses.replace(bundle, env={}))


def _check_observations(file: Path, policy: LearnedPolicy, task: Task) -> None:
    """Raise PolicyFileError unless the policy sees what the task shows; say what would help."""
    try:
        policy.check_task(task)
    except PolicyFileError as error:
        record = policy.bundle.env.get("task")
        then = _changes(record if isinstance(record, dict) else {})
        now = _changes(task_record(task))
        if then == now:
            raise PolicyFileError(f"{file}: {error}") from error
        raise PolicyFileError(
            f"{file}: {error}; it was trained with {then}, here it is {now}"
        ) from error


def _changes(record: Mapping[str, Any]) -> str:
    """What was changed of a task's terms, as one would type it."""
    texts = []
    for key in ("terms", "without"):
        names = record.get(key)
        if key == "terms" or names:
            listed = map(str, names) if isinstance(names, list) else ()
            texts.append(f"task.{key}=[{','.join(listed)}]")
    return " ".join(texts)


def _how_learned(env: Mapping[str, Any], training: Mapping[str, Any]) -> str:
    text = "learned"
    if "algo" in training:
        text += f" with {training['algo']!s:.60}"
    terrain = env.get("terrain")
    if isinstance(terrain, dict) and "name" in terrain:
        return f"{text} on {terrain_label(terrain['name'], terrain.get('random')):.60}"
    return f"{text} on unknown ground"


def is_own_name(name: str) -> bool:
    """Whether a name in `policies` is `module:attribute`, of something of the user's own."""
    return is_entry_point(name) and not Path(name).exists()


def make_own(given: object, config: EvaluationConfig, taken: Collection[str]) -> Entrant:
    """Entrant of a policy of the user's own.

    Parameters
    ----------
    given
        What `own_policy` takes, or its name, `module:attribute`.
    config
        Of the evaluation.
    taken
        Names that are not free any more.

    Raises
    ------
    ValueError
        The module cannot be used, or what is there is no policy.
    """
    source, file = None, None
    if isinstance(given, str):
        source = given
        found = load_module(given, "policies", "my_policies:steady")
        attribute = given.partition(":")[2]
        known = [key for key, value in found.items() if _is_something(value)]
        given = found[one_of(f"policies: policy in {found['__name__']}", attribute, known)]
        name, file = attribute, found.get("__file__")
    else:
        name = getattr(given, "__name__", type(given).__name__)
        module = inspect.getmodule(given if hasattr(given, "__name__") else type(given))
        file = getattr(module, "__file__", None)
    record = {
        "name": free_name(name.strip("<>"), taken),
        "kind": "own",
        "leg_controller": config.legs and config.legs.name,
        "policy": f"your own, {source or name}",
        "source": source,
        "sha256": file and file_digest(Path(file)),
        "controller_config": config.legs and asdict(config.legs),
    }
    policy = own_policy(given, source or name, config.resolved_task)
    return Entrant(str(record["name"]), config.legs, policy, None, record)


def own_policy(given: object, name: str, task: Task) -> Policy:
    """Policy of the user's own.

    Parameters
    ----------
    given
        One of three: an object with the `predict` of Stable-Baselines3; a function of one argument,
        the task, that returns such an object; or a function of two, the time and the observation,
        that returns a drive (see `FunctionPolicy`). A function is recognised by how many arguments
        it can be called with.
    name
        Of it, for messages.
    task
        What it is to act in.

    Raises
    ------
    ValueError
        It is none of these, or the function raises an error.
    """
    if isinstance(given, Policy) and not isinstance(given, type):
        return given
    if callable(given) and takes(given, 1):
        try:
            policy = given(task)
        except Exception as error:
            # the user's own code may raise anything
            raise ValueError(f"policies: {name} raised {type(error).__name__}: {error}") from error
        if not isinstance(policy, Policy):
            raise ValueError(
                f"policies: {name} must return a policy with predict(), got a "
                f"{type(policy).__name__}"
            )
        return policy
    if callable(given) and takes(given, 2):
        return FunctionPolicy(given, task)
    raise ValueError(
        f"policies: {name} must be an object with predict(), a function of (time_s, observation) "
        f"that returns a drive, or one of (task) that returns such an object, got a "
        f"{type(given).__name__}"
    )


def _is_something(value: Any) -> bool:
    return callable(value) or isinstance(value, Policy)
