"""The literature's figures of the controllers: oscillators, recorded steps, rules, a turn.

Nothing here is simulated but the controllers themselves. Sources: Ijspeert et al. 2007
(doi 10.1126/science.1138353), Cruse et al. 1998, Schilling et al. 2013 and Wang-Chen et al. 2024
(doi 10.1038/s41592-024-02497-y).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import networkx as nx
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from flyrl.anatomy import LEG_DOFS, LEGS
from flyrl.controllers import (
    CPGNetwork,
    PreprogrammedSteps,
    RuleBasedSteppingCoordinator,
    construct_rules_graph,
    filter_edges,
)
from flyrl.controllers.cpg import (
    TRIPOD_AMPLITUDE,
    TRIPOD_CONVERGENCE_RATE,
    TRIPOD_FREQUENCY_HZ,
    gait_coupling_weights,
    gait_phase_biases,
    modulated,
    three_oscillators,
)
from flyrl.controllers.rule_based import RULE_WEIGHTS, RULES
from flyrl.controllers.steps import STEPS
from flyrl.report.close_up import spans
from flyrl.report.style import (
    INK,
    LEG_SHADES,
    LINE,
    MUTED,
    PAPER_STYLE,
    SHADES,
    WIDTH_IN,
    Plot,
    add_legend,
    panels,
)
from flyrl.rollouts import BoolArray
from flyrl.validation import FloatArray

TIMESTEP_S: Final = 1e-3
"""Of what is integrated here, s."""

RULES_TIMESTEP_S: Final = 1e-4
"""Of the rules, s: as in the literature, for they are checked once a step."""

TURN: Final = (1.2, 0.2)
"""The literature's drive to the left and to the right legs."""

CYCLES: Final = 3
"""Step cycles in the figures of recorded steps."""

_LEG_NAMES: Final[dict[str, str]] = dict(zip(LEGS, LEGS, strict=True))
_PLACES: Final = {leg: ("LR".index(leg[0]), "HMF".index(leg[1])) for leg in LEGS}
"""Where the legs stand in the rules' graph: left and right, hind to front."""


def three_oscillators_plot() -> Plot:
    """Phases and magnitudes of three coupled oscillators, over 10 s."""
    network = three_oscillators()
    time_s, phases, magnitudes = _course(network, 10.0)
    names = {f"oscillator {i}": str(i) for i in range(1, 4)}
    return _oscillators(time_s, phases, magnitudes, names, SHADES[:3])


def tripod_plot() -> Plot:
    """Phases and magnitudes of the six legs' oscillators in the tripod gait, over 1 s."""
    time_s, phases, magnitudes = _course(_tripod(), 1.0)
    return _oscillators(time_s, phases, magnitudes, _LEG_NAMES, LEG_SHADES)


def turn_plot() -> Plot:
    """Magnitudes and phases of the oscillators, 1 s straight ahead and then 1 s in a turn."""
    time_s, phases, magnitudes = _course(_tripod(), 2.0, turn_s=1.0)
    plot = _oscillators(time_s, phases, magnitudes, _LEG_NAMES, LEG_SHADES)
    for axes in plot.figure.axes:
        axes.axvline(1.0, color=MUTED, linewidth=0.8, linestyle=":")
    plot.figure.axes[1].set_title(f"drive (1, 1), then {TURN}", loc="right", color=MUTED)
    return plot


def steps_plot(*, ramps: bool = False) -> Plot:
    """The 42 joint angles over three cycles of both recorded steps; swing is shaded.

    Parameters
    ----------
    ramps
        Whether the magnitude grows from 0, the neutral pose, to 1.
    """
    phase = np.linspace(0.0, 2 * np.pi * CYCLES, 120 * CYCLES + 1)
    magnitude = phase / phase[-1] if ramps else np.ones_like(phase)
    table = pd.DataFrame({"phase": phase, "magnitude": magnitude})
    shape = len(LEGS), len(STEPS)
    with panels(*shape, 9.5, PAPER_STYLE, sharex=True, sharey=True) as (figure, every):
        grid = np.array(every).reshape(shape)
        for recording, column in zip(STEPS, grid.T, strict=True):
            steps = PreprogrammedSteps(recording)
            column[0].set_title(f"{recording}, {1e3 * steps.duration:.4g} ms a step", loc="left")
            column[-1].set_xlabel("phase (rad)")
            for leg, axes in zip(LEGS, column, strict=True):
                angles = steps.get_joint_angles(leg, phase, magnitude).T
                _lines(axes, phase, np.degrees(angles), LEG_DOFS, SHADES[: len(LEG_DOFS)])
                for start, end in steps.swing_period[leg] + 2 * np.pi * np.arange(CYCLES)[:, None]:
                    axes.axvspan(start, end, color=LINE, alpha=0.6, zorder=0)
                for dof, angle in zip(LEG_DOFS, angles.T, strict=True):
                    table[f"{recording}_{leg}{dof}"] = angle
        for leg, axes in zip(LEGS, grid[:, 0], strict=True):
            axes.set_ylabel(f"{leg} (deg)")
        ticks = np.arange(CYCLES + 1)
        every[0].set_xlim(0.0, phase[-1])
        every[0].set_xticks(2 * np.pi * ticks, ["0", *(f"{2 * tick}π" for tick in ticks[1:])])
        add_legend(figure, loc="outside upper center", ncols=7)
    return Plot(figure, table)


def adhesion_plot() -> Plot:
    """Whether each leg grips, over the phase of its step."""
    steps = PreprogrammedSteps()
    phase = np.linspace(0.0, 2 * np.pi, 721)
    grips = {leg: np.asarray(steps.get_adhesion_onoff(leg, phase)) for leg in LEGS}
    height, width = 3.6, 0.7 * WIDTH_IN
    with panels(len(LEGS), 1, height, PAPER_STYLE, width=width, sharex=True) as (figure, every):
        for axes, leg, shade in zip(every, LEGS, LEG_SHADES, strict=True):
            bars = spans(grips[leg], float(phase[1]))
            axes.broken_barh(bars, (0.0, 1.0), facecolor=shade, linewidth=0)
            axes.set_ylabel(leg, rotation=0, ha="right", va="center")
            axes.set_yticks([0, 1], ["off", "on"], fontsize=7)
        axes.set_xlim(0.0, 2 * np.pi)
        axes.set_xticks(np.arange(5) * np.pi / 2, ["0", "π/2", "π", "3π/2", "2π"])
        axes.set_xlabel("phase of the step (rad)")
    table = pd.DataFrame(grips).astype(int)
    table.insert(0, "phase", phase)
    return Plot(figure, table)


def rules_graph_plot() -> Plot:
    """The legs' influences on each other, a panel for each kind."""
    graph = construct_rules_graph()
    rows = []
    style = {**PAPER_STYLE, "axes.grid": False}
    with panels(1, len(RULES), 2.6, style) as (figure, every):
        for axes, rule in zip(every, RULES, strict=True):
            edges = filter_edges(graph, rule)
            weight = RULE_WEIGHTS[rule]
            rows += [(rule, weight, *edge) for edge in edges]
            _graph(axes, edges, SHADES[1] if weight < 0 else SHADES[2])
            axes.set_title(f"{rule.replace('_', ' ')}: {weight:+g}")
    return Plot(figure, pd.DataFrame(rows, columns=["rule", "weight", "source", "target"]))


def rules_plot() -> Plot:
    """Phases of the legs under the rules over 1 s, their total scores, and those of each rule.

    As in the literature, a step takes as long as the recorded one. Every leg has a baseline of its
    own, shaded while it swings.
    """
    steps = PreprogrammedSteps()
    coordinator = RuleBasedSteppingCoordinator(
        RULES_TIMESTEP_S, construct_rules_graph(), RULE_WEIGHTS, steps
    )
    shown = {
        "phase": "leg_phases",
        "total score": "combined_scores",
        "rule 1": "rule1_scores",
        "rule 2": "rule2_scores",
        "rule 3": "rule3_scores",
    }
    samples: dict[str, list[FloatArray]] = {title: [] for title in shown}
    count = round(1.0 / RULES_TIMESTEP_S)
    for _ in range(count):
        coordinator.step()
        for title, name in shown.items():
            samples[title].append(getattr(coordinator, name))
    stride = round(TIMESTEP_S / RULES_TIMESTEP_S)
    time_s: FloatArray = np.linspace(TIMESTEP_S, 1.0, count // stride)
    columns = {title: np.array(values)[stride - 1 :: stride] for title, values in samples.items()}
    swings = (columns["phase"] > 0) & (columns["phase"] < steps.swing_ends)
    with panels(len(shown), 1, 9.5, PAPER_STYLE, sharex=True) as (figure, every):
        for axes, (title, values) in zip(every, columns.items(), strict=True):
            _baselines(axes, time_s, values, swings)
            axes.set_ylabel(title)
        axes.set_xlabel("time (s); a leg swings where it is shaded")
        axes.set_xlim(0.0, 1.0)
    numbers = {
        f"{name}_{leg}": columns[title][:, i]
        for title, name in shown.items()
        for i, leg in enumerate(LEGS)
    }
    return Plot(figure, pd.DataFrame({"time_s": time_s, **numbers}))


def _baselines(axes: Axes, time_s: FloatArray, values: FloatArray, swings: BoolArray) -> None:
    """Draw values (T, 6) of the legs below one another; all have the scale in the title."""
    low, high = min(0.0, float(values.min())), float(values.max())
    span = (high - low) or 1.0
    for i, (leg, shade) in enumerate(zip(LEGS, LEG_SHADES, strict=True)):
        bottom = 1.15 * (len(LEGS) - 1 - i)
        bars = spans(swings[:, i], TIMESTEP_S)
        axes.broken_barh(bars, (bottom, 1.0), facecolor=LINE, linewidth=0, zorder=0)
        axes.axhline(bottom - low / span, color=MUTED, linewidth=0.4)
        axes.plot(time_s, bottom + (values[:, i] - low) / span, color=shade, label=leg)
    axes.set_yticks([1.15 * (len(LEGS) - 1 - i) - low / span for i in range(len(LEGS))], LEGS)
    axes.grid(visible=False)
    axes.set_title(f"each from {low:.3g} to {high:.3g}", loc="right", color=MUTED)


def _tripod() -> CPGNetwork:
    """The fly's oscillators, driven straight ahead."""
    count = len(LEGS)
    return CPGNetwork(
        timestep=TIMESTEP_S,
        intrinsic_freqs=np.full(count, TRIPOD_FREQUENCY_HZ),
        intrinsic_amps=np.full(count, TRIPOD_AMPLITUDE),
        coupling_weights=gait_coupling_weights(),
        phase_biases=gait_phase_biases(),
        convergence_coefs=np.full(count, TRIPOD_CONVERGENCE_RATE),
    )


def _course(
    network: CPGNetwork, duration_s: float, turn_s: float = math.inf
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Let a network run, in a `TURN` from a time on: times (T,), phases and magnitudes (T, N)."""
    steps = math.ceil(duration_s / network.timestep - 1e-9)
    phases, magnitudes = [network.curr_phases], [network.curr_magnitudes]
    for step in range(steps):
        if step * network.timestep >= turn_s:
            drive = modulated(TURN, TRIPOD_FREQUENCY_HZ)
            network.intrinsic_freqs, network.intrinsic_amps = drive
        network.step()
        phases.append(network.curr_phases)
        magnitudes.append(network.curr_magnitudes)
    time_s: FloatArray = np.linspace(0.0, steps * network.timestep, steps + 1)
    return time_s, np.array(phases), np.array(magnitudes)


def _oscillators(
    time_s: FloatArray,
    phases: FloatArray,
    magnitudes: FloatArray,
    names: Mapping[str, str],
    shades: Sequence[str],
) -> Plot:
    """Phases, within a turn, above magnitudes.

    Parameters
    ----------
    names
        Of each oscillator in the legend, and in the table.
    """
    with panels(2, 1, 4.2, PAPER_STYLE, sharex=True) as (figure, (upper, lower)):
        wrapped = phases % (2 * np.pi)
        # a line that would run back across the panel is broken instead
        wrapped[1:][np.abs(np.diff(wrapped, axis=0)) > np.pi] = np.nan
        _lines(upper, time_s, wrapped, names, shades)
        _lines(lower, time_s, magnitudes, names, shades)
        upper.set_ylabel("phase (rad)")
        upper.set_yticks([0.0, np.pi, 2 * np.pi], ["0", "π", "2π"])
        lower.set_ylabel("magnitude")
        lower.set_ylim(bottom=0.0)
        lower.set_xlabel("time (s)")
        lower.set_xlim(time_s[0], time_s[-1])
        add_legend(figure, loc="outside upper center", ncols=len(names))
    numbers = {
        f"{quantity}_{name}": column
        for quantity, columns in (("phase", phases), ("magnitude", magnitudes))
        for column, name in zip(columns.T, names.values(), strict=True)
    }
    return Plot(figure, pd.DataFrame({"time_s": time_s, **numbers}))


def _lines(
    axes: Axes, x: FloatArray, columns: FloatArray, names: Iterable[str], shades: Sequence[str]
) -> None:
    for column, name, shade in zip(columns.T, names, shades, strict=True):
        axes.plot(x, column, color=shade, linewidth=1.2, label=name)


def _graph(axes: Axes, edges: list[tuple[str, str]], shade: str) -> None:
    """Draw influences of one kind between the legs, seen from above, head up."""
    graph = nx.DiGraph()
    graph.add_nodes_from(LEGS)
    graph.add_edges_from(edges)
    nx.draw_networkx(
        graph,
        _PLACES,
        ax=axes,
        node_color=LINE,
        edge_color=shade,
        font_size=8,
        font_color=INK,
        node_size=420,
        width=1.4,
        connectionstyle="arc3,rad=0.18",
    )
    axes.set_xlim(-0.45, 1.45)
    axes.set_ylim(-0.4, 2.4)
    axes.set_axis_off()
