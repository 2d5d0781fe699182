"""The rule-based controller: the first three of Walknet's rules decide which leg steps next.

Legs influence each other's readiness to step along the edges of a graph; the readiest leg steps.

Sources: Cruse et al. 1998, doi 10.1016/S0893-6080(98)00067-7; Schilling et al. 2013,
doi 10.1007/s00422-013-0563-5.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flyrl.anatomy import LEGS, Leg
from flyrl.controllers.compilation import kernel
from flyrl.controllers.controller import NUM_LEGS, Controller, Step, record_of
from flyrl.controllers.random import legacy_choice, seeded_stream
from flyrl.controllers.steps import TWO_PI, PreprogrammedSteps, StepsName, step_values, take_steps
from flyrl.validation import FloatArray, Within, check_fields, not_negative, one_of, positive

if TYPE_CHECKING:
    import networkx as nx

    RulesGraph: TypeAlias = nx.MultiDiGraph

Rule = Literal["rule1", "rule2_ipsi", "rule2_contra", "rule3_ipsi", "rule3_contra"]

RULES: Final[tuple[Rule, ...]] = get_args(Rule)
"""Kinds of influence: 1 swing inhibits, 2 start of stance excites, 3 end of stance excites."""

RULE_WEIGHTS: Final[Mapping[str, float]] = MappingProxyType(
    {"rule1": -10.0, "rule2_ipsi": 2.5, "rule2_contra": 1.0, "rule3_ipsi": 3.0, "rule3_contra": 2.0}
)
"""Weight of each kind of influence in NeuroMechFly v2."""

MARGIN: Final = 0.001
"""Scores within this fraction of the best one count as equally good."""

FIRST_LEGS: Final = tuple(LEGS.index(leg) for leg in ("LF", "LM", "RF", "RM"))
"""Legs of which one takes the very first step."""

NO_LEG: Final = -1

STEP_DURATION_S: Final = 1.0 / 12.0
"""Step duration with untethered steps: the CPG's cycle (spec 9)."""

_CONTRALATERAL: Final = ("FF", "MM", "HH")

_TARGETS: Final[dict[Rule, tuple[str, ...]]] = {
    "rule1": ("MF", "HM"),
    "rule2_ipsi": ("MF", "HM"),
    "rule2_contra": _CONTRALATERAL,
    "rule3_ipsi": ("FM", "MH"),
    "rule3_contra": _CONTRALATERAL,
}
"""Positions of a leg and of one that it influences, on the same side or (contra) the other one."""


def walknet_edges() -> Iterator[tuple[str, str, Rule]]:
    """Influences of legs on legs in Walknet: (source, target, rule) each."""
    for rule, pairs in _TARGETS.items():
        for side, other_side in ("LR", "RL"):
            target_side = other_side if pairs is _CONTRALATERAL else side
            for pair in pairs:
                yield side + pair[0], target_side + pair[1], rule


def construct_rules_graph() -> "RulesGraph":
    """Graph of the legs' influences on each other: an edge for each, with its `rule` attribute."""
    # Imported here because most uses of flyrl need no graph.
    import networkx as nx  # noqa: PLC0415

    graph: RulesGraph = nx.MultiDiGraph()
    graph.add_nodes_from(LEGS)
    for source, target, rule in walknet_edges():
        graph.add_edge(source, target, rule=rule)
    return graph


def filter_edges(
    graph: "RulesGraph", rule: str, src_node: str | None = None
) -> list[tuple[str, str]]:
    """Edges (source, target) of one rule, from one source if given.

    Raises
    ------
    ValueError
        If the rule or the source is unknown.
    """
    one_of("rule", rule, RULES)
    if src_node is not None:
        one_of("src_node", src_node, graph.nodes)
    return [
        (source, target)
        for source, target, label in graph.edges(data="rule")
        if label == rule and src_node in (None, source)
    ]


def rule_matrices(
    edges: Iterable[tuple[Any, Any, Any]], weights: Mapping[str, float]
) -> FloatArray:
    """Weights of rules 1, 2 and 3 between legs, shape (3, 6, 6): rule, source, target.

    Raises
    ------
    ValueError
        If an edge (source, target, rule) has no known legs or rule, or the weights are not one
        finite number for each rule.
    """
    if set(weights) != set(RULES):
        raise ValueError(f"weights must have the keys {', '.join(RULES)}, got {sorted(weights)}")
    for rule, weight in weights.items():
        if not math.isfinite(weight):
            raise ValueError(f"weights[{rule!r}] must be finite, got {weight!r}")
    matrices = np.zeros((3, len(LEGS), len(LEGS)))
    for source, target, rule in edges:
        for leg in (source, target):
            one_of(f"leg of edge {source}-{target}", leg, LEGS)
        one_of(f"rule of edge {source}-{target}", rule, RULES)
        number = int(rule[len("rule")]) - 1
        matrices[number, LEGS.index(source), LEGS.index(target)] += weights[rule]
    return matrices


@kernel
def _choose_leg(parameters: Any, state: Any) -> int:
    """Index of the leg to start stepping, drawn from the eligible ones; -1 if there is none."""
    scores, best = state.scores, -np.inf
    for i in range(NUM_LEGS):
        best = max(best, scores[0, i] + scores[1, i] + scores[2, i])
    threshold = max(0.0, best - parameters.margin * abs(best))
    # Twice over the legs (count, then find) rather than once into a list: kernels allocate nothing.
    remaining = -1
    for is_counting in (True, False):
        num_eligible = 0
        for i in range(NUM_LEGS):
            score = scores[0, i] + scores[1, i] + scores[2, i]
            if state.is_stepping[i] == 0.0 and score > 0.0 and score >= threshold:
                if num_eligible == remaining:
                    return i
                num_eligible += 1
        if is_counting:
            if num_eligible == 0:
                return NO_LEG
            remaining = legacy_choice(state.random, num_eligible)
    return NO_LEG


@kernel
def _score_legs(parameters: Any, state: Any) -> None:
    """Write the scores that each leg gets from all others by each rule."""
    scores, weights = state.scores, parameters.rule_weights
    scores[:, :] = 0.0
    for source in range(NUM_LEGS):
        phase, swing_end = state.phases[source], parameters.grip_start[source]
        swings = 0.0 < phase < swing_end
        progress = max(0.0, phase - swing_end) / (TWO_PI - swing_end)
        for target in range(NUM_LEGS):
            if swings:
                scores[0, target] += weights[0, source, target]
            if progress > 0.0:
                scores[1, target] += weights[1, source, target] * (1.0 - progress)
                scores[2, target] += weights[2, source, target] * progress


@kernel
def advance_rules(parameters: Any, state: Any) -> None:
    """Advance the coordination in place: choose, advance, complete, rescore.

    Parameters
    ----------
    parameters
        Record with the fields of `_rule_values`, and "grip_start": where each leg's swing ends.
    state
        Record that `RuleBased.initial_state` returns. The very first step has no scores to go by.
    """
    if state.has_started == 0.0:
        state.has_started = 1.0
        chosen = FIRST_LEGS[legacy_choice(state.random, len(FIRST_LEGS))]
    else:
        chosen = _choose_leg(parameters, state)
    if chosen != NO_LEG:
        state.is_stepping[chosen] = 1.0
    for i in range(NUM_LEGS):
        if state.is_stepping[i] != 0.0:
            state.phases[i] += parameters.phase_increment
        if state.phases[i] >= TWO_PI:
            state.phases[i] = 0.0
            state.is_stepping[i] = 0.0
    _score_legs(parameters, state)


@kernel
def rule_based_step(parameters: Any, state: Any, senses: Any, command: Any, output: Any) -> None:
    """Advance the coordination and the legs that step; the command has no say."""
    advance_rules(parameters, state)
    take_steps(parameters, state, output)


def _rule_values(
    edges: Iterable[tuple[Any, Any, Any]],
    weights: Mapping[str, float],
    margin: float,
    timestep: float,
    step_duration: float,
) -> dict[str, Any]:
    """Fields of the parameters that hold the rules; ValueError if a time is not above 0."""
    return {
        "rule_weights": rule_matrices(edges, weights),  # of the influence of legs (rows) on legs
        "margin": not_negative("margin", margin),
        # of a stepping leg, rad per time step
        "phase_increment": TWO_PI * positive("timestep", timestep) / step_duration,
    }


@dataclass(frozen=True)
class RuleBased(Controller):
    """Walknet's rules 1 to 3, without a drive.

    Attributes
    ----------
    steps
        Recorded step: "untethered" (goes with the current body) or "tethered" (with the classic
        body); None takes the body's.
    step_duration_s
        Duration of a step; None for 1/12 s on untethered steps and the recording's duration on
        tethered ones.
    rule1, rule2_ipsi, rule2_contra, rule3_ipsi, rule3_contra
        Weight of each kind of influence (see `RULES`).
    edges
        Influences of legs on legs: (source, target, rule) each; None takes Walknet's.
    margin
        Legs whose score is within this share of the best are drawn from at random.

    Raises
    ------
    ValueError
        If a name is unknown or a value is out of its range.
    """

    steps: StepsName | None = None
    step_duration_s: Annotated[float | None, Within(1e-3, 1e3)] = None
    rule1: Annotated[float, Within(-1e6, 1e6)] = RULE_WEIGHTS["rule1"]
    rule2_ipsi: Annotated[float, Within(-1e6, 1e6)] = RULE_WEIGHTS["rule2_ipsi"]
    rule2_contra: Annotated[float, Within(-1e6, 1e6)] = RULE_WEIGHTS["rule2_contra"]
    rule3_ipsi: Annotated[float, Within(-1e6, 1e6)] = RULE_WEIGHTS["rule3_ipsi"]
    rule3_contra: Annotated[float, Within(-1e6, 1e6)] = RULE_WEIGHTS["rule3_contra"]
    edges: tuple[tuple[Leg, Leg, Rule], ...] | None = None
    margin: Annotated[float, Within(0, 1)] = MARGIN

    follows_command: ClassVar[bool] = False
    step: ClassVar[Step] = staticmethod(rule_based_step)

    def __post_init__(self) -> None:
        check_fields(self, "controller")

    def load_steps(self) -> PreprogrammedSteps:
        """Load the recorded steps, as long as the controller's."""
        duration = self.step_duration_s
        if duration is None and self.steps != "tethered":
            duration = STEP_DURATION_S
        return PreprogrammedSteps(self.steps or "untethered", duration)

    def parameters(self, timestep: float) -> np.void:
        """Constants that the kernel takes; ValueError if the time step is not above 0."""
        return record_of(self.parameter_values(timestep))

    def parameter_values(self, timestep: float) -> dict[str, Any]:
        """Fields of the parameters."""
        steps = self.load_steps()
        weights: dict[str, float] = {rule: getattr(self, rule) for rule in RULES}
        edges = walknet_edges() if self.edges is None else self.edges
        rules = _rule_values(edges, weights, self.margin, timestep, steps.duration)
        return {**rules, **step_values(steps)}

    def initial_state(
        self,
        seed: int = 0,
        init_phases: ArrayLike | None = None,
        init_magnitudes: ArrayLike | None = None,
    ) -> np.void:
        """Legs at rest; ValueError if `seed` is none."""
        return record_of(self.state_values(seed))

    def state_values(self, seed: int) -> dict[str, Any]:
        """Fields of the state as an episode starts."""
        return {
            "phases": np.zeros(NUM_LEGS),  # rad in [0, 2π)
            "magnitudes": np.ones(NUM_LEGS),
            "has_started": 0.0,
            "is_stepping": np.zeros(NUM_LEGS),
            "scores": np.zeros((3, NUM_LEGS)),  # readiness of legs by each rule
            "random": seeded_stream(seed),
        }


class RuleBasedSteppingCoordinator:
    """Decides by local rules which leg steps when.

    Attributes
    ----------
    leg_phases : array
        Phase of each leg's step, rad in [0, 2π), shape (6,).
    mask_is_stepping : array
        Whether each leg is stepping, shape (6,).
    rule1_scores, rule2_scores, rule3_scores, combined_scores : array
        Each leg's readiness by each rule, and their sum, shape (6,).

    Parameters
    ----------
    timestep
        s.
    rules_graph
        As `construct_rules_graph` returns it.
    weights
        Weight of each of the rules "rule1", "rule2_ipsi", "rule2_contra", "rule3_ipsi" and
        "rule3_contra", e.g. `RULE_WEIGHTS`.
    preprogrammed_steps
        Gives the duration of a step and each leg's swing end.
    margin
        Legs whose score is within this fraction of the best are drawn from at random.
    seed
        Of the random draws, which are those of `numpy.random.RandomState(seed).choice`.

    Raises
    ------
    ValueError
        If the time step is not above 0, the margin is negative, the seed is no seed, or the graph
        and weights do not fit the legs and rules.
    """

    def __init__(
        self,
        timestep: float,
        rules_graph: "RulesGraph",
        weights: Mapping[str, float],
        preprogrammed_steps: PreprogrammedSteps,
        margin: float = MARGIN,
        seed: int = 0,
    ) -> None:
        self.timestep, self.margin = timestep, margin
        self.rules_graph = rules_graph
        self.weights = dict(weights)
        self.preprogrammed_steps = steps = preprogrammed_steps
        self.legs = list(LEGS)
        edges = rules_graph.edges(data="rule")
        values = _rule_values(edges, weights, margin, timestep, steps.duration)
        self._parameters = record_of({**values, "grip_start": steps.swing_ends})
        self._state = RuleBased().initial_state(seed)
        self._hand_out()

    def step(self) -> None:
        """Advance by one time step."""
        # On a fresh record, so that arrays handed out before keep the values of their time.
        self._state = self._state.copy()
        advance_rules(self._parameters, self._state)
        self._hand_out()

    def _hand_out(self) -> None:
        self.leg_phases: FloatArray = self._state["phases"]
        self.mask_is_stepping: NDArray[np.bool_] = self._state["is_stepping"] != 0.0
        scores: FloatArray = self._state["scores"]
        self.rule1_scores, self.rule2_scores, self.rule3_scores = scores
        self.combined_scores: FloatArray = scores[0] + scores[1] + scores[2]
