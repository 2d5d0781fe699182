"""The literature's figures of the controllers: oscillators, recorded steps, rules, a turn.

Nothing here is simulated but the controllers themselves. Sources: Ijspeert et al. 2007
(doi 10.1126/science.1138353), Cruse et al. 1998, Schilling et al. 2013 and Wang-Chen et al. 2024
(doi 10.1038/s41592-024-02497-y).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, Final

import networkx as nx
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from flyrl.anatomy import LEG_DOFS, LEGS
from flyrl.controllers import (
    CPG,
    CPGNetwork,
    PreprogrammedSteps,
    RuleBasedSteppingCoordinator,
    construct_rules_graph,
    filter_edges,
)
from flyrl.controllers.cpg import TRIPOD_FREQUENCY_HZ, modulated, three_oscillators
from flyrl.controllers.rule_based import RULE_WEIGHTS, RULES
from flyrl.controllers.steps import STEPS
from flyrl.report import style
from flyrl.report.close_up import spans
from flyrl.rollouts import BoolArray
from flyrl.validation import FloatArray

TIMESTEP_S: Final = 1e-3
"""Time step of the oscillators and of the tables, s."""

RULES_TIMESTEP_S: Final = 1e-4
"""Time step of the rules, s, as in the literature: they are checked once a step."""

TURN: Final = (1.2, 0.2)
"""The literature's drive to the left and to the right legs."""

CYCLES: Final = 3
"""Step cycles in the figures of recorded steps."""

_PLACES: Final = {leg: ("LR".index(leg[0]), "HMF".index(leg[1])) for leg in LEGS}
"""Place of each leg in the rules' graph: left and right, hind to front."""


def three_oscillators_plot() -> style.Plot:
    """Phases and magnitudes of three coupled oscillators, over 10 s."""
    return _oscillators(three_oscillators(), 10.0, ["1", "2", "3"], style.SHADES, "oscillator ")


def tripod_plot() -> style.Plot:
    """Phases and magnitudes of the six legs' oscillators in the tripod gait, over 1 s."""
    return _oscillators(_tripod(), 1.0, LEGS, style.LEG_SHADES)


def turn_plot() -> style.Plot:
    """Magnitudes and phases of the oscillators, 1 s straight ahead and then 1 s in a turn."""
    plot = _oscillators(_tripod(), 2.0, LEGS, style.LEG_SHADES, turn_s=1.0)
    for axes in plot.figure.axes:
        axes.axvline(1.0, color=style.MUTED, linewidth=0.8, linestyle=":")
    plot.figure.axes[1].set_title(f"drive (1, 1), then {TURN}", loc="right", color=style.MUTED)
    return plot


def steps_plot(*, ramps: bool = False) -> style.Plot:
    """The 42 joint angles over three cycles of both recorded steps; swing is shaded.

    Parameters
    ----------
    ramps
        Whether the magnitude grows from 0, the neutral pose, to 1.
    """
    phase = np.linspace(0.0, 2 * np.pi * CYCLES, 120 * CYCLES + 1)
    magnitude = phase / phase[-1] if ramps else np.ones_like(phase)
    table = pd.DataFrame({"phase": phase, "magnitude": magnitude})
    size = len(LEGS), len(STEPS), 9.5
    with style.panels(*size, sharex=True, sharey=True) as (figure, every):
        for i, recording in enumerate(STEPS):
            column = every[i :: len(STEPS)]
            steps = PreprogrammedSteps(recording)
            column[0].set_title(f"{recording}, {1e3 * steps.duration:.4g} ms a step")
            column[-1].set_xlabel("phase (rad)")
            for leg, axes in zip(LEGS, column, strict=True):
                angles = steps.get_joint_angles(leg, phase, magnitude).T
                table[[f"{recording}_{leg}{dof}" for dof in LEG_DOFS]] = angles
                _lines(axes, phase, np.degrees(angles), LEG_DOFS, style.SHADES)
                for start, end in steps.swing_period[leg] + 2 * np.pi * np.arange(CYCLES)[:, None]:
                    axes.axvspan(start, end, color=style.LINE, alpha=0.6, zorder=0)
        for leg, axes in zip(LEGS, every[:: len(STEPS)], strict=True):
            axes.set_ylabel(f"{leg} (deg)")
        ticks = np.arange(CYCLES + 1)
        every[0].set_xlim(0.0, phase[-1])
        every[0].set_xticks(2 * np.pi * ticks, ["0", *(f"{2 * tick}π" for tick in ticks[1:])])
        style.add_legend(figure, loc="outside upper center", ncols=7)
    return style.Plot(figure, table)


def adhesion_plot() -> style.Plot:
    """Grip of each leg over the phase of its step."""
    steps = PreprogrammedSteps()
    phase = np.linspace(0.0, 2 * np.pi, 721)
    table = pd.DataFrame({"phase": phase})
    size: Any = {"height": 3.6, "width": 0.7 * style.WIDTH_IN}
    with style.panels(len(LEGS), 1, **size, sharex=True) as (figure, every):
        for axes, leg, shade in zip(every, LEGS, style.LEG_SHADES, strict=True):
            grips = np.asarray(steps.get_adhesion_onoff(leg, phase))
            table[leg] = grips.astype(int)
            bars = spans(grips, float(phase[1]))
            axes.broken_barh(bars, (0.0, 1.0), facecolor=shade, linewidth=0)
            axes.set_ylabel(leg, rotation=0, ha="right", va="center")
            axes.set_yticks([0, 1], ["off", "on"], fontsize=7)
        axes.set(xlim=(0.0, 2 * np.pi), xlabel="phase of the step (rad)")
        axes.set_xticks(np.arange(5) * np.pi / 2, ["0", "π/2", "π", "3π/2", "2π"])
    return style.Plot(figure, table)


def rules_graph_plot() -> style.Plot:
    """The legs' influences on each other, a panel for each kind."""
    rows = []
    with style.panels(1, len(RULES), 2.6) as (figure, every):
        for axes, rule in zip(every, RULES, strict=True):
            weight = RULE_WEIGHTS[rule]
            graph = nx.empty_graph(LEGS, nx.DiGraph)
            graph.add_edges_from(filter_edges(construct_rules_graph(), rule))
            rows += [(rule, weight, *edge) for edge in graph.edges]
            # seen from above, head up
            nx.draw_networkx(
                graph,
                _PLACES,
                ax=axes,
                node_color=style.LINE,
                edge_color=style.SHADES[1] if weight < 0 else style.SHADES[2],
                font_size=8,
                font_color=style.INK,
                node_size=420,
                width=1.4,
                connectionstyle="arc3,rad=0.18",
            )
            axes.set(xlim=(-0.45, 1.45), ylim=(-0.4, 2.4))
            axes.set_axis_off()
            axes.set_title(f"{rule.replace('_', ' ')}: {weight:+g}", loc="center")
    return style.Plot(figure, pd.DataFrame(rows, columns=["rule", "weight", "source", "target"]))


def rules_plot() -> style.Plot:
    """Phases of the legs under the rules over 1 s, their total scores, and those of each rule.

    As in the literature, a step takes as long as the recorded one. Every leg has a baseline of its
    own, shaded while it swings.
    """
    steps = PreprogrammedSteps()
    coordinator = RuleBasedSteppingCoordinator(
        RULES_TIMESTEP_S, construct_rules_graph(), RULE_WEIGHTS, steps
    )
    titles = {
        "leg_phases": "phase",
        "combined_scores": "total score",
        "rule1_scores": "rule 1",
        "rule2_scores": "rule 2",
        "rule3_scores": "rule 3",
    }
    samples = []
    for _ in range(round(1.0 / RULES_TIMESTEP_S)):
        coordinator.step()
        samples.append([getattr(coordinator, name) for name in titles])
    stride = round(TIMESTEP_S / RULES_TIMESTEP_S)
    values = np.array(samples)[stride - 1 :: stride]  # (times, titles, legs)
    time_s: FloatArray = np.linspace(TIMESTEP_S, 1.0, len(values))
    swings = (values[:, 0] > 0) & (values[:, 0] < steps.swing_ends)
    with style.panels(len(titles), 1, 9.5, sharex=True) as (figure, every):
        for i, (axes, title) in enumerate(zip(every, titles.values(), strict=True)):
            _baselines(axes, time_s, values[:, i], swings)
            axes.set_ylabel(title)
        axes.set(xlim=(0.0, 1.0), xlabel="time (s); a leg swings where it is shaded")
    columns = [f"{name}_{leg}" for name in titles for leg in LEGS]
    table = pd.DataFrame(values.reshape(len(values), -1), columns=columns)
    table.insert(0, "time_s", time_s)
    return style.Plot(figure, table)


def _baselines(axes: Axes, time_s: FloatArray, values: FloatArray, swings: BoolArray) -> None:
    """Draw values (T, 6) of the legs below one another; all have the scale in the title."""
    low, high = min(0.0, float(values.min())), float(values.max())
    span = (high - low) or 1.0
    for i, (leg, shade) in enumerate(zip(LEGS, style.LEG_SHADES, strict=True)):
        bottom = 1.15 * (len(LEGS) - 1 - i)
        bars = spans(swings[:, i], TIMESTEP_S)
        axes.broken_barh(bars, (bottom, 1.0), facecolor=style.LINE, linewidth=0, zorder=0)
        axes.axhline(bottom - low / span, color=style.MUTED, linewidth=0.4)
        axes.plot(time_s, bottom + (values[:, i] - low) / span, color=shade, label=leg)
    axes.set_yticks([1.15 * (len(LEGS) - 1 - i) - low / span for i in range(len(LEGS))], LEGS)
    axes.grid(visible=False)
    axes.set_title(f"each from {low:.3g} to {high:.3g}", loc="right", color=style.MUTED)


def _tripod() -> CPGNetwork:
    """The fly's oscillators, driven straight ahead."""
    values = CPG().oscillator_values(TIMESTEP_S)
    freqs, amps = values.pop("frequency"), values.pop("amplitude")
    return CPGNetwork(intrinsic_freqs=freqs, intrinsic_amps=amps, **values)


def _oscillators(
    network: CPGNetwork,
    duration_s: float,
    names: Sequence[str],
    shades: Sequence[str],
    label: str = "",
    turn_s: float = math.inf,
) -> style.Plot:
    """Phases of a network that runs, within a turn, above magnitudes.

    Parameters
    ----------
    names
        Of each oscillator, in the table, and in the legend after the `label`.
    turn_s
        Time from which on the drive is `TURN`, s.
    """
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
    wrapped = np.array(phases) % (2 * np.pi)
    # a line that would run back across the panel is broken instead
    wrapped[1:][np.abs(np.diff(wrapped, axis=0)) > np.pi] = np.nan
    labels = [f"{label}{name}" for name in names]
    with style.panels(2, 1, 4.2, sharex=True) as (figure, (upper, lower)):
        _lines(upper, time_s, wrapped, labels, shades)
        _lines(lower, time_s, np.array(magnitudes), labels, shades)
        upper.set_ylabel("phase (rad)")
        upper.set_yticks([0.0, np.pi, 2 * np.pi], ["0", "π", "2π"])
        lower.set(ylabel="magnitude", ylim=(0.0, None))
        lower.set(xlabel="time (s)", xlim=(time_s[0], time_s[-1]))
        style.add_legend(figure, loc="outside upper center", ncols=len(names))
    columns = [f"{quantity}_{name}" for quantity in ("phase", "magnitude") for name in names]
    table = pd.DataFrame(np.hstack([phases, magnitudes]), columns=columns)
    table.insert(0, "time_s", time_s)
    return style.Plot(figure, table)


def _lines(
    axes: Axes, x: FloatArray, columns: FloatArray, names: Iterable[str], shades: Sequence[str]
) -> None:
    for column, name, shade in zip(columns.T, names, shades, strict=False):
        axes.plot(x, column, color=shade, linewidth=1.2, label=name)
