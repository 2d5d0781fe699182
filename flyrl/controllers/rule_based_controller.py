"""The rule-based controller: Walknet's rules 1 to 3 decide which leg takes the next step.

Sources: Cruse et al. 1998, doi 10.1016/S0893-6080(98)00067-7; Schilling et al. 2013,
doi 10.1007/s00422-013-0563-5.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from flyrl.anatomy import Leg
from flyrl.controllers.compilation import kernel
from flyrl.controllers.controller import NUM_LEGS, Controller, Step
from flyrl.controllers.random import STATE_SIZE, seeded_stream
from flyrl.controllers.steps import (
    PreprogrammedSteps,
    StepsName,
    pack_step,
    step_fields,
    take_steps,
)
from flyrl.controllers.walknet import (
    MARGIN,
    RULE_WEIGHTS,
    RULES,
    construct_rules_graph,
    phase_increment,
    rule_matrices,
    walknet_step,
)
from flyrl.validation import Within, check_fields, positive

if TYPE_CHECKING:
    from flyrl.controllers.walknet import RulesGraph

Rule = Literal["rule1", "rule2_ipsi", "rule2_contra", "rule3_ipsi", "rule3_contra"]

STEP_DURATION_S: Final = 1.0 / 12.0
"""Step duration with untethered steps: the CPG's cycle (spec 9)."""

_RULE_PARAMETERS: Final = [
    ("rule1_weights", "f8", (NUM_LEGS, NUM_LEGS)),
    ("rule2_weights", "f8", (NUM_LEGS, NUM_LEGS)),
    ("rule3_weights", "f8", (NUM_LEGS, NUM_LEGS)),
    ("margin", "f8"),
    ("step_duration", "f8"),  # s
    ("phase_increment", "f8"),  # rad per time step
]

_STATE: Final = np.dtype(
    [
        ("phases", "f8", (NUM_LEGS,)),
        ("magnitudes", "f8", (NUM_LEGS,)),
        ("has_started", "f8"),
        ("is_stepping", "f8", (NUM_LEGS,)),
        ("rule1_scores", "f8", (NUM_LEGS,)),
        ("rule2_scores", "f8", (NUM_LEGS,)),
        ("rule3_scores", "f8", (NUM_LEGS,)),
        ("random", "f8", (STATE_SIZE,)),
    ]
)


@kernel
def rule_based_step(parameters: Any, state: Any, senses: Any, command: Any, output: Any) -> None:
    """Advance the coordination and the legs that step; the command has no say."""
    walknet_step(
        state.phases,
        state.is_stepping,
        state.rule1_scores,
        state.rule2_scores,
        state.rule3_scores,
        state.random,
        parameters.rule1_weights,
        parameters.rule2_weights,
        parameters.rule3_weights,
        parameters.grip_start,
        parameters.margin,
        parameters.phase_increment,
        state.has_started == 0.0,
    )
    state.has_started = 1.0
    take_steps(
        parameters.coefficients,
        parameters.neutral,
        parameters.swing_start,
        parameters.grip_start,
        state.phases,
        state.magnitudes,
        output,
    )


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
        Weight of each kind of influence (see `walknet.RULES`).
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

    def graph(self) -> "RulesGraph":
        """The legs' influences on each other."""
        graph = construct_rules_graph()
        if self.edges is not None:
            graph.clear_edges()
            for source, target, rule in self.edges:
                graph.add_edge(source, target, rule=rule)
        return graph

    def load_steps(self) -> PreprogrammedSteps:
        """Load the recorded steps, as long as the controller's."""
        duration = self.step_duration_s
        if duration is None and self.steps != "tethered":
            duration = STEP_DURATION_S
        return PreprogrammedSteps(self.steps or "untethered", duration)

    def parameters(self, timestep: float) -> np.void:
        """Constants that the kernel takes; ValueError if the time step is not above 0."""
        steps = self.load_steps()
        rules = rule_matrices(self.graph(), {rule: getattr(self, rule) for rule in RULES})
        record: np.void = np.zeros(1, dtype=[*_RULE_PARAMETERS, *step_fields(steps)])[0]
        pack_step(record, steps)
        record["rule1_weights"], record["rule2_weights"], record["rule3_weights"] = rules
        record["margin"] = self.margin
        record["step_duration"] = steps.duration
        record["phase_increment"] = phase_increment(positive("timestep", timestep), steps.duration)
        return record

    def initial_state(
        self,
        seed: int = 0,
        init_phases: ArrayLike | None = None,
        init_magnitudes: ArrayLike | None = None,
    ) -> np.void:
        """Legs at rest, whose steps are always taken in full; ValueError if `seed` is none."""
        record: np.void = np.zeros(1, dtype=_STATE)[0]
        record["magnitudes"] = 1.0
        record["random"] = seeded_stream(seed)
        return record
