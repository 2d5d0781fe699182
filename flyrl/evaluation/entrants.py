"""Entrants of an evaluation: legs, and what steers them."""

from __future__ import annotations

import inspect
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from flyrl.controllers import DRIVE, Controller
from flyrl.controllers.controller import controller_from, settings_text
from flyrl.entry_points import check_trust, is_entry_point, load_module, takes
from flyrl.envs.core import EnvConfig
from flyrl.evaluation.config import EvaluationConfig
from flyrl.files import file_digest
from flyrl.policies import LearnedPolicy, PolicyFileError, load_bundle
from flyrl.policies.bundle import PolicyBundle, policy_file, policy_name
from flyrl.policies.fixed import FunctionPolicy
from flyrl.policies.laws import FIXED, fixed_policy, is_law, law_named, split_legs
from flyrl.rollouts import Policy
from flyrl.simulation.fly_scene import fit_controller
from flyrl.tasks import Task, code_digests, code_of, task_record
from flyrl.terrains import Terrain, terrain_label
from flyrl.validation import distinct, one_of

NAME_LENGTH: Final = 60
"""Characters of a name at most, before a number that makes it unique."""


@dataclass(frozen=True)
class Entrant:
    """A leg controller, if there are legs, and the policy that steers it.

    Attributes
    ----------
    name
        Unique among the entrants of an evaluation.
    kind
        "learned", "fixed" or "own".
    controller
        Of the legs; None of a worm.
    policy
        Of the descending drive, or of the muscles.
    text
        How the policy came to be, in words.
    source
        File or entry point of the policy; None of others.
    file
        That holds the policy, if there is one.
    decision_interval
        s for which a decision is held; None takes the task's.
    more
        Further plain JSON values for the record.
    """

    name: str
    kind: str
    controller: Controller | None
    policy: Policy
    text: str
    source: str | None = None
    file: Path | None = None
    decision_interval: float | None = None
    more: Mapping[str, Any] = field(default_factory=dict)

    @property
    def record(self) -> dict[str, Any]:
        """Origin of the entrant, as plain JSON values."""
        legs = self.controller
        return {
            "name": self.name,
            "kind": self.kind,
            "leg_controller": legs and legs.name,
            "policy": self.text,
            "source": self.source,
            "sha256": self.file and file_digest(self.file),
            "controller_config": legs and asdict(legs),
            **self.more,
        }

    def env(self, config: EvaluationConfig, terrain: Terrain) -> EnvConfig:
        """Environment that the entrant walks in."""
        return replace(
            config.env(terrain),
            controller=self.controller,
            decision_interval=self.decision_interval,
        )


def free_name(name: str, taken: Collection[str]) -> str:
    """`name`, or `name-2`, `name-3`, … where that is taken.

    Names come from files of others and reach pages, spreadsheets and terminals. Of them only
    letters, digits and `_ . ( ) + - @ space` are kept, at most `NAME_LENGTH` of them and starting
    with a letter or digit; `unnamed` stands where nothing is left.
    """
    kept = "".join(each if each.isalnum() or each in "_.()+-@ " else "_" for each in name)
    name = kept.lstrip("_.()+-@ ")[:NAME_LENGTH].rstrip() or "unnamed"
    if name not in taken:
        return name
    return next(f"{name}-{i}" for i in range(2, len(taken) + 3) if f"{name}-{i}" not in taken)


def make_entrants(config: EvaluationConfig) -> list[Entrant]:
    """All entrants of an evaluation: learned policies first, then the fixed controllers.

    Raises
    ------
    ValueError
        An unknown or repeated name, a policy file that cannot be used, a reference that is not
        among the entrants, or one whose decisions do not fit the physics.
    """
    task = config.resolved_task
    names: tuple[Any, ...] | None = config.controllers
    if names is None:
        names = tuple(
            name for name in FIXED if FIXED[name].is_usual and FIXED[name].goes_with(task)
        )
    # Fixed first: a misspelt name shows before any file is read.
    fixed = [make_fixed(each, config) for each in names]
    taken = [entrant.name for entrant in fixed]
    distinct("controllers", taken)
    learned: list[Entrant] = []
    for given in config.policies:
        steering, legs = split_legs(given) if isinstance(given, str) else (given, None)
        # what is both an entry point and a file is the file
        if isinstance(steering, str) and (not is_entry_point(steering) or Path(steering).exists()):
            entrant = make_learned(steering, config)
        else:
            entrant = make_own(steering, config)
        name = entrant.name
        if legs is not None:
            name = f"{name}@{legs}"
            entrant = replace(entrant, controller=_steered_legs(name, legs, config))
        learned.append(replace(entrant, name=free_name(name, taken)))
        taken.append(learned[-1].name)
    entrants = [*learned, *fixed]
    if config.reference is not None:
        one_of("reference", config.reference, [entrant.name for entrant in entrants])
    for entrant in entrants:
        for terrain in config.terrain_configs:
            try:
                entrant.env(config, terrain)
            except (ValueError, TypeError) as error:
                source = entrant.source or entrant.name
                raise ValueError(f"{source} cannot walk here: {error}") from error
    return entrants


def make_fixed(given: str | Controller, config: EvaluationConfig) -> Entrant:
    """Fixed entrant by its name; or legs with settings, which walk straight ahead.

    Raises
    ------
    ValueError
        There is no such name, the task does not show what it needs, or a drive is out of range.
    """
    task, own = config.resolved_task, given if isinstance(given, Controller) else None
    name = given if isinstance(given, str) else settings_text(given)
    steering, legs = split_legs(name) if own is None else ("constant(1, 1)", None)
    if not is_law(steering):
        one_of("controllers", steering, [*FIXED, "constant(left, right)"])
    try:
        fixed, policy = law_named(steering), fixed_policy(steering, task)
    except ValueError as error:
        raise ValueError(f"controllers: {error}") from error
    controller = None
    if legs is not None:
        controller = _steered_legs(name, legs, config)
    elif fixed.legs is not None:
        reflexes = {"reflexes": fixed.reflexes} if fixed.reflexes else {}
        controller = _fitted(own or controller_from({"name": fixed.legs, **reflexes}), config)
    shown = task.slices().keys()
    sees = next((list(terms) for terms in fixed.sees if shown >= set(terms)), [])
    return Entrant(name, "fixed", controller, policy, fixed.text, more={"sees": sees})


def _steered_legs(name: str, legs: str, config: EvaluationConfig) -> Controller:
    """Leg controller that an entrant is put on; ValueError unless it follows a drive."""
    if config.legs is None:
        raise ValueError(f"{name}: a worm has no legs; leave @{legs} out")
    controller = controller_from(legs)
    if not controller.follows_command or controller.command.names != DRIVE.names:
        raise ValueError(f"{name}: legs after @ must be such as follow a drive, got {legs!r}")
    return _fitted(controller, config)


def _fitted(controller: Controller, config: EvaluationConfig) -> Controller:
    """Leg controller with the recorded step that goes with the body."""
    return fit_controller(controller, config.env(config.terrains[0]).fly_scene.body)


def make_learned(path: str, config: EvaluationConfig) -> Entrant:
    """Entrant of a learned policy.

    Parameters
    ----------
    path
        A policy file, a run folder, the name of a policy that comes with flyrl, or
        algorithm:file.zip of a model that Stable-Baselines3 saved.
    config
        Of the evaluation.

    Raises
    ------
    ValueError
        Nothing there, or nothing that can be used here; a zip file without `trust_pickles`.
    """
    file, bundle = _load(path, config)
    env, training = bundle.env, bundle.training
    policy = _fitted_policy(file, bundle, config.resolved_task)
    trained_on = env.get("controller")
    check_trust(file, trained_on, config.trust_pickles, "trust_pickles=true")
    try:
        controller = controller_from(trained_on) if trained_on is not None else config.legs
    except (TypeError, ValueError) as error:
        raise PolicyFileError(f"{file}: its leg controller cannot be used here: {error}") from error
    if controller is not None and not controller.follows_command:
        raise PolicyFileError(
            f"{file}: its leg controller, {controller.name!r}, ignores the drive, so that no "
            "policy can steer it"
        )
    return Entrant(
        policy_name(file) or str(training.get("algo", file.stem)),
        "learned",
        controller,
        policy,
        _how_learned(env, training),
        source=str(file),
        file=file,
        decision_interval=_record(env, "task").get("decision_interval"),
        more={"trained_in": dict(env), "training": dict(training)},
    )


def _record(record: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    """Record in another one that anybody may have written; empty where there is none."""
    found = record.get(key)
    return found if isinstance(found, dict) else {}


def _load(path: str, config: EvaluationConfig) -> tuple[Path, PolicyBundle]:
    algorithm, colon, model = path.partition(":")
    if not (colon and model.endswith(".zip")):
        file = policy_file(path)
        if file.suffix == ".zip":
            raise PolicyFileError(
                f"{path}: of a zip file, say which algorithm made it, e.g. ppo:{path}"
            )
        return file, load_bundle(file)
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
    return Path(model), replace(bundle, env={})


def _fitted_policy(file: Path, bundle: PolicyBundle, task: Task) -> LearnedPolicy:
    """Policy for a task; PolicyFileError, saying what would help, unless it can act there."""
    try:
        return LearnedPolicy(bundle, task)
    except PolicyFileError as error:
        then, now = _changes(_record(bundle.env, "task")), _changes(task_record(task))
        changed = "" if then == now else f"; it was trained with {then}, here it is {now}"
        raise PolicyFileError(f"{file}: {error}{changed}") from error


def _changes(record: Mapping[str, Any]) -> str:
    """Changes of a task's terms, as on the command line."""
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
    terrain = _record(env, "terrain")
    if "name" in terrain:
        return f"{text} on {terrain_label(terrain['name'], terrain.get('random')):.60}"
    return f"{text} on unknown ground"


def make_own(given: object, config: EvaluationConfig) -> Entrant:
    """Entrant of a policy of the user's own.

    Parameters
    ----------
    given
        What `own_policy` takes, or its name, `module:attribute`.
    config
        Of the evaluation.

    Raises
    ------
    ValueError
        The module cannot be used, or what is there is no policy.
    """
    source = None
    if isinstance(given, str):
        source, name = given, given.partition(":")[2]
        found = load_module(given, "policies", "my_policies:steady")
        known = [key for key, each in found.items() if callable(each) or isinstance(each, Policy)]
        given = found[one_of(f"policies: policy in {found['__name__']}", name, known)]
        file = found.get("__file__")
    else:
        own: Any = given if hasattr(given, "__name__") else type(given)
        name, file = own.__name__.strip("<>"), getattr(inspect.getmodule(own), "__file__", None)
    policy = own_policy(given, source or name, config.resolved_task)
    text = f"your own, {source or name}"
    return Entrant(name, "own", config.legs, policy, text, source, file and Path(file))


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


def changed_terms(entrant: Entrant, task: Task) -> list[str]:
    """Modules of the user's task and terms that are not what a policy was trained with."""
    before = _record(entrant.more, "training").get("terms")
    if not isinstance(before, dict):  # fixed, or from before they were noted
        return []
    now = code_digests(code_of(task))
    return [module for module, digest in now.items() if before.get(module) != digest]
