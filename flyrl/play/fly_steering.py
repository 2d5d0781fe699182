"""Who can steer a played fly besides a person."""

from collections.abc import Callable, Mapping
from typing import Final

from flyrl.play.fly_setting import INTERVAL_S, PLAY_TASK
from flyrl.policies import LearnedPolicy, PolicyFileError, load_bundle, named_policies
from flyrl.policies.bundle import policy_file
from flyrl.policies.laws import FIXED
from flyrl.policies.library import policy_name
from flyrl.rollouts import Policy

BY_HAND: Final = "by hand"
PURSUIT: Final = "pursuit"


def pilots(given: str | None = None) -> dict[str, Callable[[], Policy]]:
    """Who can steer to a target: name -> what makes the policy.

    They are `PURSUIT`, all policies that come with flyrl and fit, and the one that is given.

    Parameters
    ----------
    given
        Name of one of these, a policy file, or a run folder.

    Raises
    ------
    ValueError
        What is given is missing, is no policy, or one that cannot steer here.
    """
    found: dict[str, Callable[[], Policy]] = {PURSUIT: _pursuit}
    for name, file in named_policies().items():
        policy = LearnedPolicy(load_bundle(file))
        if _misfit(policy) is None:
            found[name] = _same(policy)
    if given is not None and given not in found:
        names = ", ".join(found)
        try:
            policy = LearnedPolicy(load_bundle(given))
            name = pilot_name(given)
        except PolicyFileError as error:
            raise PolicyFileError(
                f"policy must be a file, a run folder or one of {names}; {error}"
            ) from error
        misfit = _misfit(policy)
        if misfit is not None:
            raise PolicyFileError(f"policy {given!r} cannot steer here ({names} can): {misfit}")
        found[name] = _same(policy)
    return found


def pilot_name(given: str) -> str:
    """Name under which a policy that is given stands among the pilots."""
    return given if given == PURSUIT else policy_name(policy_file(given)) or given


def _misfit(policy: LearnedPolicy) -> str | None:
    """Why a policy does not fit; None if it does."""
    try:
        policy.check_task(PLAY_TASK)
    except PolicyFileError as error:
        return str(error)
    task = policy.bundle.env.get("task")
    interval = task.get("decision_interval") if isinstance(task, Mapping) else None
    if interval is not None and interval != INTERVAL_S:
        return f"it decides every {interval} s; it must be {INTERVAL_S} s"
    return None


def _same(policy: Policy) -> Callable[[], Policy]:
    return lambda: policy


def _pursuit() -> Policy:
    return FIXED[PURSUIT].make(PLAY_TASK)
