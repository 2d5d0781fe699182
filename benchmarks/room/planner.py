"""A planner that tries drives out on copies of the simulation: an upper bound for policies."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flyrl.envs.core import BatchedEnv
from flyrl.policies.networks import vectors
from flyrl.rollouts import Policy

Array = NDArray[np.float64]

KNOT_S: Final = 0.1
"""s between two places of a plan; in between it is linear."""


@dataclass(frozen=True)
class PlannerConfig:
    """How hard a planner thinks.

    Attributes
    ----------
    candidates
        Plans that are tried at a time, the law itself and the last plan among them.
    rounds
        How often; after each, new ones are drawn about the best.
    best
        How many that are.
    knots
        Places of a plan, `KNOT_S` apart: the horizon.
    every
        Decisions between two plans.
    spread
        Standard deviation of the first draw, in units of an action.
    tries
        Copies that a plan is tried on; what they bring on average counts.
    noise
        Standard deviation by which the actions on each copy differ, decision by decision. On rough
        ground the least disturbance soon leads elsewhere; without noise, a plan may have been
        chosen for luck that only this one future has.
    foresees
        Whether it knows commands before they are given; if not, plans end where the next one comes.
    """

    candidates: int = 16
    rounds: int = 2
    best: int = 5
    knots: int = 5
    every: int = 10
    spread: float = 0.5
    tries: int = 1
    noise: float = 0.0
    foresees: bool = True


ROBUST: Final = PlannerConfig(tries=4, noise=0.1, foresees=False)
"""Of a planner that knows state and ground, but not where a stumble leads, nor the next command."""


class Planner:
    """Adds to a law's actions what brings the most reward on copies of the simulation.

    Model-predictive control by the cross-entropy method (Rubinstein 1999,
    doi 10.1023/A:1010091220143). It knows the simulation, which no fly does: what it reaches bounds
    what a policy can, from above as far as it searches well. Without noise it knows the very
    future.

    Parameters
    ----------
    env
        Of one simulation, which is asked what to do next.
    law
        A policy without memory, from which the search starts.
    config
        How hard to think.
    seed
        Of the search.
    """

    def __init__(
        self, env: BatchedEnv, law: Policy, config: PlannerConfig = PlannerConfig(), seed: int = 0
    ) -> None:
        self._env, self._law, self._config = env, law, config
        self._copies = BatchedEnv(env.config, config.candidates * config.tries)
        self._rng = np.random.default_rng(seed)
        low, high = env.task.actions.bounds
        self._low, self._high = low, high
        self._command_time = env.task.slices().get("command_time")
        knots = KNOT_S * np.arange(config.knots, dtype=np.float64)
        interval = env.config.decision_interval_s
        # how much of every knot there is in the action of each decision, and in each knot later
        times = np.arange(round(knots[-1] / interval)) * interval
        self._weights = _weights(times, knots)
        self._later = _weights(knots + config.every * interval, knots)

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], Any]:
        """Actions (1, k), and the plan with the number of decisions since it was made."""
        if state is None or np.any(episode_start):
            plan, since = np.zeros((self._config.knots, len(self._low))), 0
        else:
            plan, since = state
        if since % self._config.every == 0:
            plan, since = self._plan(self._later @ plan), 0
        offsets = np.array([self._weights[since] @ plan])
        return self._act(observation, offsets), (plan, since + 1)

    def _act(self, observation: Any, offsets: Array) -> Array:
        actions, _ = self._law.predict(observation)
        return np.clip(actions + offsets, self._low, self._high)

    def _plan(self, last: Array) -> Array:
        """Find a plan (knots, k) that brings more than the law and the last plan."""
        config = self._config
        mean, spread = last, np.full_like(last, config.spread)
        best, most = last, -np.inf
        for number in range(config.rounds):
            drawn = self._rng.normal(mean, spread, (config.candidates, *last.shape))
            drawn[0] = best
            if number == 0:
                drawn[1] = 0.0
            scores = self._scores(drawn)
            order = np.argsort(-scores, kind="stable")
            if scores[order[0]] > most:
                best, most = drawn[order[0]], scores[order[0]]
            chosen = drawn[order[: config.best]]
            mean, spread = chosen.mean(axis=0), chosen.std(axis=0) + 0.05
        return best

    def _scores(self, plans: Array) -> Array:
        """Reward of each plan (candidates, knots, k) until the horizon or the episode's end."""
        copies, config = self._copies, self._config
        plans = np.repeat(plans, config.tries, axis=0)
        observation = copies.copy_from(self._env, [0] * len(plans))
        scores, active = np.zeros(len(plans)), np.arange(len(plans))
        for weights in self._weights[: self._known(observation)]:
            offsets = np.einsum("k,nkd->nd", weights, plans)
            offsets += self._rng.normal(0.0, config.noise, offsets.shape)
            actions = self._act(observation, offsets)
            transition = copies.step(actions, ids=active)
            observation = transition.observation
            scores[active] += transition.reward[active]
            active = active[~transition.done[active]]
            if not active.size:
                break
        return np.asarray(scores.reshape(-1, config.tries).mean(axis=1))

    def _known(self, observation: Any) -> int:
        """Decisions of a plan whose command is known."""
        if self._config.foresees or self._command_time is None:
            return len(self._weights)
        left_s = vectors(observation)[0, self._command_time].item()
        return round(left_s / self._env.config.decision_interval_s)


def _weights(times: Array, knots: Array) -> Array:
    """Share of each knot in a piecewise linear function at times, (times, knots)."""
    return np.stack([np.interp(times, knots, row) for row in np.eye(len(knots))], axis=1)
