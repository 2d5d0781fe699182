"""Rule-based coordination of stepping: the first three of the Walknet rules.

Legs influence each other's readiness to step along the edges of a graph; the readiest leg steps.

Sources: Cruse et al. 1998, doi 10.1016/S0893-6080(98)00067-7; Schilling et al. 2013,
doi 10.1007/s00422-013-0563-5.
"""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from flyrl.anatomy import LEGS
from flyrl.controllers.compilation import kernel
from flyrl.controllers.random import legacy_choice, seeded_stream
from flyrl.validation import FloatArray, not_negative, one_of, positive

if TYPE_CHECKING:
    import networkx as nx

    RulesGraph: TypeAlias = nx.MultiDiGraph

TWO_PI: Final = 2.0 * np.pi

RULES: Final = ("rule1", "rule2_ipsi", "rule2_contra", "rule3_ipsi", "rule3_contra")
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

# Source position -> positions of its targets on the same side and on the other side.
_IPSILATERAL: Final = {
    "rule1": {"M": "F", "H": "M"},
    "rule2": {"M": "F", "H": "M"},
    "rule3": {"F": "M", "M": "H"},
}
_CONTRALATERAL_RULES: Final = ("rule2", "rule3")


class StepTiming(Protocol):
    """What the coordinator asks of recorded steps: their duration (s) and swing phases (rad)."""

    @property
    def duration(self) -> float: ...  # noqa: D102

    @property
    def swing_period(self) -> Mapping[str, FloatArray]: ...  # noqa: D102


def construct_rules_graph() -> "RulesGraph":
    """Graph of the legs' influences on each other: an edge for each, with its `rule` attribute."""
    # Imported here because most uses of flyrl need no graph.
    import networkx as nx  # noqa: PLC0415

    graph: RulesGraph = nx.MultiDiGraph()
    graph.add_nodes_from(LEGS)
    for rule, targets in _IPSILATERAL.items():
        for side, other_side in ("LR", "RL"):
            for position in "FMH":
                source = side + position
                if rule in _CONTRALATERAL_RULES:
                    graph.add_edge(source, other_side + position, rule=f"{rule}_contra")
                if position in targets:
                    label = f"{rule}_ipsi" if rule in _CONTRALATERAL_RULES else rule
                    graph.add_edge(source, side + targets[position], rule=label)
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


def rule_matrices(graph: "RulesGraph", weights: Mapping[str, float]) -> FloatArray:
    """Weights of rules 1, 2 and 3 between legs, shape (3, 6, 6): rule, source, target.

    Raises
    ------
    ValueError
        If a node is no leg, an edge has no known rule, or the weights are not one finite number for
        each rule.
    """
    for node in graph.nodes:
        one_of("node of rules_graph", node, LEGS)
    if set(weights) != set(RULES):
        raise ValueError(f"weights must have the keys {', '.join(RULES)}, got {sorted(weights)}")
    for rule, weight in weights.items():
        if not math.isfinite(weight):
            raise ValueError(f"weights[{rule!r}] must be finite, got {weight!r}")
    matrices = np.zeros((3, len(LEGS), len(LEGS)))
    for source, target, rule in graph.edges(data="rule"):
        one_of(f"rule of edge {source}-{target}", rule, RULES)
        number = int(rule[len("rule")]) - 1
        matrices[number, LEGS.index(source), LEGS.index(target)] += weights[rule]
    return matrices


@kernel
def _choose_leg(
    is_stepping: FloatArray,
    rule1: FloatArray,
    rule2: FloatArray,
    rule3: FloatArray,
    stream: FloatArray,
    margin: float,
) -> int:
    """Index of the leg to start stepping, drawn from the eligible ones; -1 if there is none."""
    best = -np.inf
    for i in range(rule1.size):
        best = max(best, rule1[i] + rule2[i] + rule3[i])
    threshold = max(0.0, best - margin * abs(best))
    # Twice over the legs (count, then find) rather than once into a list: kernels allocate nothing.
    remaining = -1
    for is_counting in (True, False):
        num_eligible = 0
        for i in range(rule1.size):
            score = rule1[i] + rule2[i] + rule3[i]
            if is_stepping[i] == 0.0 and score > 0.0 and score >= threshold:
                if num_eligible == remaining:
                    return i
                num_eligible += 1
        if is_counting:
            if num_eligible == 0:
                return NO_LEG
            remaining = legacy_choice(stream, num_eligible)
    return NO_LEG


@kernel
def _score_legs(
    phases: FloatArray,
    rule1: FloatArray,
    rule2: FloatArray,
    rule3: FloatArray,
    weights1: FloatArray,
    weights2: FloatArray,
    weights3: FloatArray,
    swing_ends: FloatArray,
) -> None:
    """Write the scores that each leg gets from all others by each rule."""
    rule1[:] = 0.0
    rule2[:] = 0.0
    rule3[:] = 0.0
    for source in range(phases.size):
        swing_end = swing_ends[source]
        swings = 0.0 < phases[source] < swing_end
        progress = max(0.0, phases[source] - swing_end) / (TWO_PI - swing_end)
        for target in range(phases.size):
            if swings:
                rule1[target] += weights1[source, target]
            if progress > 0.0:
                rule2[target] += weights2[source, target] * (1.0 - progress)
                rule3[target] += weights3[source, target] * progress


@kernel
def walknet_step(
    phases: FloatArray,
    is_stepping: FloatArray,
    rule1: FloatArray,
    rule2: FloatArray,
    rule3: FloatArray,
    stream: FloatArray,
    weights1: FloatArray,
    weights2: FloatArray,
    weights3: FloatArray,
    swing_ends: FloatArray,
    margin: float,
    phase_increment: float,
    is_first: bool,
) -> None:
    """Advance the coordination in place: choose, advance, complete, rescore.

    Parameters
    ----------
    phases, is_stepping
        State of each leg: rad in [0, 2π), and 1 while it steps or 0; shape (6,).
    rule1, rule2, rule3
        Scores by each rule, shape (6,).
    stream
        Random stream (see `controllers.random`), shape (625,).
    weights1, weights2, weights3
        Influence of each leg (row) on each leg (column), shape (6, 6).
    swing_ends
        Phase at which each leg's swing ends, rad, shape (6,).
    margin
        Scores within this fraction of the best one are as good.
    phase_increment
        Advance of a stepping leg, rad.
    is_first
        Whether this is the very first step, which has no scores to go by.
    """
    if is_first:
        chosen = FIRST_LEGS[legacy_choice(stream, len(FIRST_LEGS))]
    else:
        chosen = _choose_leg(is_stepping, rule1, rule2, rule3, stream, margin)
    if chosen != NO_LEG:
        is_stepping[chosen] = 1.0
    for i in range(phases.size):
        if is_stepping[i] != 0.0:
            phases[i] += phase_increment
        if phases[i] >= TWO_PI:
            phases[i] = 0.0
            is_stepping[i] = 0.0
    _score_legs(phases, rule1, rule2, rule3, weights1, weights2, weights3, swing_ends)


class RuleBasedSteppingCoordinator:
    """Decides by local rules which leg steps when.

    Attributes
    ----------
    rule1_scores, rule2_scores, rule3_scores : array
        Each leg's readiness by each rule, shape (6,).

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
        preprogrammed_steps: StepTiming,
        margin: float = MARGIN,
        seed: int = 0,
    ) -> None:
        self.timestep = positive("timestep", timestep)
        self.margin = not_negative("margin", margin)
        self.rules_graph = rules_graph
        self.weights = dict(weights)
        self.preprogrammed_steps = preprogrammed_steps
        self.legs = list(LEGS)
        self._matrices = rule_matrices(rules_graph, weights)
        self._swing_ends = np.array([preprogrammed_steps.swing_period[leg][1] for leg in LEGS])
        self._stream = seeded_stream(seed)
        self._is_first = True
        self._phases = np.zeros(len(LEGS))
        self._is_stepping = np.zeros(len(LEGS))
        self.rule1_scores = np.zeros(len(LEGS))
        self.rule2_scores = np.zeros(len(LEGS))
        self.rule3_scores = np.zeros(len(LEGS))

    @property
    def leg_phases(self) -> FloatArray:
        """Phase of each leg's step, rad in [0, 2π), shape (6,)."""
        return self._phases

    @property
    def mask_is_stepping(self) -> NDArray[np.bool_]:
        """Whether each leg is stepping, shape (6,)."""
        return np.not_equal(self._is_stepping, 0.0)

    @property
    def combined_scores(self) -> FloatArray:
        """Sum of the three rules' scores, shape (6,)."""
        return self.rule1_scores + self.rule2_scores + self.rule3_scores

    def step(self) -> None:
        """Advance by one time step."""
        # On fresh arrays, so that those handed out before keep the values of their time.
        self._phases = self._phases.copy()
        self.rule1_scores = self.rule1_scores.copy()
        self.rule2_scores = self.rule2_scores.copy()
        self.rule3_scores = self.rule3_scores.copy()
        walknet_step(
            self._phases,
            self._is_stepping,
            self.rule1_scores,
            self.rule2_scores,
            self.rule3_scores,
            self._stream,
            self._matrices[0],
            self._matrices[1],
            self._matrices[2],
            self._swing_ends,
            self.margin,
            phase_increment(self.timestep, self.preprogrammed_steps.duration),
            self._is_first,
        )
        self._is_first = False


def phase_increment(timestep: float, step_duration: float) -> float:
    """Phase that a stepping leg gains in one time step (s) at a step duration (s), rad."""
    return TWO_PI * timestep / step_duration
