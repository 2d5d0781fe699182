"""The literature's figures of the controllers: oscillators, recorded steps, rules, a turn.

Nothing here is simulated but the controllers themselves. Sources: Ijspeert et al. 2007
(doi 10.1126/science.1138353), Cruse et al. 1998, Schilling et al. 2013 and Wang-Chen et al. 2024
(doi 10.1038/s41592-024-02497-y).
"""

from __future__ import annotations

import math
from typing import Any, Final

import matplotlib as mpl
import networkx as nx
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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
    three_oscillators,
    tripod_coupling_weights,
    tripod_phase_biases,
)
from flyrl.controllers.turning import modulated
from flyrl.controllers.walknet import RULE_WEIGHTS, RULES
from flyrl.report.close_up import spans
from flyrl.report.paper import LEG_COLOURS, PAPER_STYLE, Plot, light
from flyrl.report.style import WIDTH_IN
from flyrl.validation import FloatArray

TIMESTEP_S: Final = 1e-3
"""Of what is integrated here, s."""

TURN: Final = (1.2, 0.2)
"""The literature's drive to the left and to the right legs."""

CYCLES: Final = 3
"""Step cycles in the figures of recorded steps."""

_PLACES: Final = {leg: ("LR".index(leg[0]), "HMF".index(leg[1])) for leg in LEGS}
"""Where the legs stand in the rules' graph: left and right, hind to front."""


def three_oscillators_plot() -> Plot:
    """Phases and magnitudes of three coupled oscillators, over 10 s."""
    network = three_oscillators()
    time_s, phases, magnitudes = _course(network, 10.0)
    names = [f"oscillator {i + 1}" for i in range(network.num_cpgs)]
    figure = _oscillators(time_s, phases, magnitudes, names, ("c0", "c1", "c2"))
    return Plot(figure, _oscillator_table(time_s, phases, magnitudes, range(1, 4)))


def tripod_plot() -> Plot:
    """Phases and magnitudes of the six legs' oscillators in the tripod gait, over 1 s."""
    time_s, phases, magnitudes = _course(_tripod(), 1.0)
    figure = _oscillators(time_s, phases, magnitudes, LEGS, LEG_COLOURS)
    return Plot(figure, _oscillator_table(time_s, phases, magnitudes, LEGS))


def turn_plot() -> Plot:
    """Magnitudes and phases of the oscillators, 1 s straight ahead and then 1 s in a turn."""
    network = _tripod()
    straight = _course(network, 1.0)
    network.intrinsic_freqs, network.intrinsic_amps = modulated(TURN, TRIPOD_FREQUENCY_HZ)
    turning = _course(network, 1.0)
    time_s = np.concatenate([straight[0], straight[0][-1] + turning[0][1:]])
    phases, magnitudes = (
        np.concatenate([before, after[1:]])
        for before, after in zip(straight[1:], turning[1:], strict=True)
    )
    figure = _oscillators(time_s, phases, magnitudes, LEGS, LEG_COLOURS)
    for axes in figure.axes:
        axes.axvline(straight[0][-1], color=light("muted"), linewidth=0.8, linestyle=":")
    figure.axes[1].set_title(f"drive (1, 1), then {TURN}", loc="right", color=light("muted"))
    return Plot(figure, _oscillator_table(time_s, phases, magnitudes, LEGS))


def steps_plot() -> Plot:
    """The 42 joint angles over three cycles of the recorded step; swing is shaded."""
    return _steps(ramps=False)


def steps_magnitude_plot() -> Plot:
    """The same with the magnitude growing from 0, the neutral pose, to 1."""
    return _steps(ramps=True)


def adhesion_plot() -> Plot:
    """Whether each leg grips, over the phase of its step."""
    steps = PreprogrammedSteps()
    phase = np.linspace(0.0, 2 * np.pi, 721)
    grips = {leg: np.asarray(steps.get_adhesion_onoff(leg, phase)) for leg in LEGS}
    with mpl.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(0.7 * WIDTH_IN, 3.6), layout="constrained")
        for axes, leg, colour in zip(
            figure.subplots(len(LEGS), 1, sharex=True), LEGS, LEG_COLOURS, strict=True
        ):
            bars = spans(grips[leg], float(phase[1]))
            axes.broken_barh(bars, (0.0, 1.0), facecolor=light(colour), linewidth=0)
            axes.set_ylabel(leg, rotation=0, ha="right", va="center")
            axes.set_yticks([0, 1], ["off", "on"], fontsize=7)
        axes.set_xlim(0.0, 2 * np.pi)
        axes.set_xticks(np.arange(5) * np.pi / 2, ["0", "π/2", "π", "3π/2", "2π"])
        axes.set_xlabel("phase of the step (rad)")
    table = pd.DataFrame({"phase": phase})
    for leg in LEGS:
        table[leg] = grips[leg].astype(int)
    return Plot(figure, table)


def rules_graph_plot() -> Plot:
    """The legs' influences on each other, a panel for each kind."""
    graph = construct_rules_graph()
    rows = []
    with mpl.rc_context({**PAPER_STYLE, "axes.grid": False}):
        figure = Figure(figsize=(WIDTH_IN, 2.6), layout="constrained")
        for axes, rule in zip(figure.subplots(1, len(RULES)), RULES, strict=True):
            edges = filter_edges(graph, rule)
            weight = RULE_WEIGHTS[rule]
            rows += [(rule, weight, *edge) for edge in edges]
            _graph(axes, edges, "c1" if weight < 0 else "c2")
            axes.set_title(f"{rule.replace('_', ' ')}: {weight:+g}")
    return Plot(figure, pd.DataFrame(rows, columns=["rule", "weight", "source", "target"]))


def rules_plot() -> Plot:
    """Phases of the legs under the rules over 1 s, their total scores, and those of each rule."""
    coordinator = RuleBasedSteppingCoordinator(
        TIMESTEP_S, construct_rules_graph(), RULE_WEIGHTS, PreprogrammedSteps(duration=1 / 12)
    )
    shown = {
        "phase (rad)": "leg_phases",
        "total score": "combined_scores",
        "rule 1": "rule1_scores",
        "rule 2": "rule2_scores",
        "rule 3": "rule3_scores",
    }
    samples: dict[str, list[FloatArray]] = {title: [] for title in shown}
    time_s: FloatArray = np.linspace(TIMESTEP_S, 1.0, 1000)
    for _ in time_s:
        coordinator.step()
        for title, name in shown.items():
            samples[title].append(getattr(coordinator, name))
    columns = {title: np.array(values) for title, values in samples.items()}
    with mpl.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(WIDTH_IN, 7.0), layout="constrained")
        panels = figure.subplots(len(shown), 1, sharex=True)
        for axes, (title, values) in zip(panels, columns.items(), strict=True):
            _lines(axes, time_s, values, LEGS, LEG_COLOURS)
            axes.set_ylabel(title)
        panels[-1].set_xlabel("time (s)")
        panels[-1].set_xlim(0.0, 1.0)
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=6)
    table = pd.DataFrame({"time_s": time_s})
    for title, name in shown.items():
        for i, leg in enumerate(LEGS):
            table[f"{name}_{leg}"] = columns[title][:, i]
    return Plot(figure, table)


def _tripod() -> CPGNetwork:
    """The fly's oscillators, driven straight ahead."""
    count = len(LEGS)
    return CPGNetwork(
        timestep=TIMESTEP_S,
        intrinsic_freqs=np.full(count, TRIPOD_FREQUENCY_HZ),
        intrinsic_amps=np.full(count, TRIPOD_AMPLITUDE),
        coupling_weights=tripod_coupling_weights(),
        phase_biases=tripod_phase_biases(),
        convergence_coefs=np.full(count, TRIPOD_CONVERGENCE_RATE),
    )


def _course(network: CPGNetwork, duration_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Let a network run: times (T,), phases and magnitudes (T, N), from now on."""
    steps = math.ceil(duration_s / network.timestep - 1e-9)
    phases, magnitudes = [network.curr_phases], [network.curr_magnitudes]
    for _ in range(steps):
        network.step()
        phases.append(network.curr_phases)
        magnitudes.append(network.curr_magnitudes)
    time_s: FloatArray = np.linspace(0.0, steps * network.timestep, steps + 1)
    return time_s, np.array(phases), np.array(magnitudes)


def _oscillators(
    time_s: FloatArray,
    phases: FloatArray,
    magnitudes: FloatArray,
    names: Any,
    shades: tuple[str, ...],
) -> Figure:
    """Phases, within a turn, above magnitudes."""
    with mpl.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(WIDTH_IN, 4.2), layout="constrained")
        upper, lower = figure.subplots(2, 1, sharex=True)
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
        handles = lower.get_legend_handles_labels()
        figure.legend(*handles, loc="outside upper center", ncols=len(names))
    return figure


def _lines(
    axes: Axes, x: FloatArray, columns: FloatArray, names: Any, shades: tuple[str, ...]
) -> None:
    for column, name, shade in zip(columns.T, names, shades, strict=True):
        axes.plot(x, column, color=light(shade), linewidth=1.2, label=name)


def _oscillator_table(
    time_s: FloatArray, phases: FloatArray, magnitudes: FloatArray, names: Any
) -> pd.DataFrame:
    table = pd.DataFrame({"time_s": time_s})
    for quantity, columns in (("phase", phases), ("magnitude", magnitudes)):
        for column, name in zip(columns.T, names, strict=True):
            table[f"{quantity}_{name}"] = column
    return table


def _steps(*, ramps: bool) -> Plot:
    steps = PreprogrammedSteps()
    phase = np.linspace(0.0, 2 * np.pi * CYCLES, 120 * CYCLES + 1)
    time_s = phase / (2 * np.pi) * steps.duration
    magnitude = phase / phase[-1] if ramps else np.ones_like(phase)
    table = pd.DataFrame({"time_s": time_s, "phase": phase, "magnitude": magnitude})
    with mpl.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(WIDTH_IN, 6.6), layout="constrained")
        panels = figure.subplots(3, 2, sharex=True, sharey=True)
        shades = ("c0", "c1", "c2", "c3", "c4", "c5", "c6")
        for i, leg in enumerate(LEGS):
            axes = panels[i % 3, i // 3]
            angles = steps.get_joint_angles(leg, phase, magnitude).T
            _lines(axes, time_s, np.degrees(angles), LEG_DOFS, shades)
            start, end = steps.swing_period[leg] / (2 * np.pi) * steps.duration
            for cycle in range(CYCLES):
                shift = cycle * steps.duration
                axes.axvspan(shift + start, shift + end, color=light("line"), alpha=0.6, zorder=0)
            axes.set_title(leg, loc="left")
            for dof, column in zip(LEG_DOFS, angles.T, strict=True):
                table[f"{leg}{dof}"] = column
        for axes in panels[:, 0]:
            axes.set_ylabel("angle (deg)")
        for axes in panels[-1]:
            axes.set_xlabel("time (s)")
        panels[0, 0].set_xlim(0.0, time_s[-1])
        handles = panels[0, 0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside upper center", ncols=7)
    return Plot(figure, table)


def _graph(axes: Axes, edges: list[tuple[str, str]], shade: str) -> None:
    """Draw influences of one kind between the legs, seen from above, head up."""
    graph = nx.DiGraph()
    graph.add_nodes_from(LEGS)
    graph.add_edges_from(edges)
    nx.draw_networkx(
        graph,
        _PLACES,
        ax=axes,
        node_color=light("line"),
        edge_color=light(shade),
        font_size=8,
        font_color=light("ink"),
        node_size=420,
        width=1.4,
        connectionstyle="arc3,rad=0.18",
    )
    axes.set_xlim(-0.45, 1.45)
    axes.set_ylim(-0.4, 2.4)
    axes.set_axis_off()
