"""The stepping rules: the graph, and the coordinator's decisions."""

import numpy as np
import pytest

from flyrl import (
    PreprogrammedSteps,
    RuleBasedSteppingCoordinator,
    construct_rules_graph,
    filter_edges,
)
from tests.controllers import oracle

WEIGHTS = oracle.RULE_WEIGHTS


def coordinator(seed=0, steps="untethered", timestep=1e-4, **arguments):
    arguments = {"rules_graph": construct_rules_graph(), "weights": WEIGHTS, **arguments}
    return RuleBasedSteppingCoordinator(
        timestep=timestep, preprogrammed_steps=PreprogrammedSteps(steps), seed=seed, **arguments
    )


def test_edges_are_filtered_by_rule_and_source():
    graph = construct_rules_graph()
    assert filter_edges(graph, "rule1") == [("LM", "LF"), ("LH", "LM"), ("RM", "RF"), ("RH", "RM")]
    assert filter_edges(graph, "rule3_ipsi", src_node="LM") == [("LM", "LH")]


def test_choices_and_scores_are_those_of_the_specification():
    # Ties after the first step are rare: it takes a wide margin, long time steps and many seeds.
    recording, num_later_choices = oracle.Steps("untethered"), 0
    for seed in range(15):
        expected = oracle.Walknet(5e-3, 0.135, recording.swing_end, seed, margin=1.0)
        actual = coordinator(seed, timestep=5e-3, margin=1.0)
        walked = [[], []]
        for _ in range(400):
            expected.step()
            actual.step()
            walked[0].append((actual.leg_phases, actual.mask_is_stepping))
            walked[1].append((expected.phases.copy(), expected.stepping.copy()))
        np.testing.assert_array_equal(*walked)
        scores = (actual.rule1_scores, actual.rule2_scores, actual.rule3_scores)
        np.testing.assert_allclose(scores, expected.scores, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(actual.combined_scores, scores[0] + scores[1] + scores[2])
        num_later_choices += expected.num_random_choices - 1
    assert num_later_choices > 15


def test_phases_handed_out_before_do_not_change():
    walk = coordinator()
    walk.step()
    before = walk.leg_phases
    kept = before.copy()
    walk.step()
    np.testing.assert_array_equal(before, kept)
    assert (walk.leg_phases != kept).any()


def graph_with(*edge, **label):
    graph = construct_rules_graph()
    graph.add_edge(*edge, **label)
    return graph


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"timestep": -1e-4}, "timestep must be a finite number above 0, got -0.0001"),
        ({"margin": -0.1}, "margin must be a finite number of at least 0, got -0.1"),
        ({"seed": 2**32}, "seed must be an integer from 0 to"),
        ({"weights": {"rule1": -10}}, r"weights must have the keys rule1, .* got \['rule1'\]"),
        ({"weights": WEIGHTS | {"rule1": np.nan}}, r"weights\['rule1'\] must be finite, got nan"),
        (
            {"rules_graph": graph_with("LF", "LX", rule="rule1")},
            "leg of edge LF-LX must be one of .* got 'LX'",
        ),
        ({"rules_graph": graph_with("LF", "LM")}, "rule of edge LF-LM must be one of .* got None"),
    ],
)
def test_coordinator_rejects(arguments, message):
    with pytest.raises(ValueError, match=message):
        coordinator(**arguments)


def test_unknown_rules_and_sources_are_rejected():
    with pytest.raises(ValueError, match=r"rule must be one of 'rule1', .* got 'rule4'"):
        filter_edges(construct_rules_graph(), "rule4")
    with pytest.raises(ValueError, match=r"src_node must be one of .*'LF'.* got 'LX'"):
        filter_edges(construct_rules_graph(), "rule1", src_node="LX")
