"""Which episode shows best where a learned entrant differs from the reference."""

import pytest

from flyrl.evaluation.contrast import contrasts
from flyrl.evaluation.episodes import episode_table
from tests.evaluation.test_summary import timed
from tests.synthetic import TASK, judged_by, make_results

KINDS = {"mine": "learned", "other": "learned", "own": "own", "law": "fixed", "cpg": "fixed"}


def chosen(*walked, terrains=("flat",), decisive=("success", "time_to_goal_s")):
    """Choice among the rows of some entrants, of whom `law` is the reference."""
    rows = [row for own in walked for row in own]
    protocol = {
        **judged_by(TASK),
        "decisive": decisive,
        "reference": "law",
        "entrants": [{"name": name, "kind": kind} for name, kind in KINDS.items()],
        "terrains": [{"name": name} for name in terrains],
    }
    return contrasts(episode_table(rows), protocol)


def test_the_first_in_which_the_policy_succeeds_and_the_reference_fails():
    # in episode 0 the reference alone succeeds, in 2 both; rows may stand in any order
    rows = timed("mine", [None, None, 1.0, 0.5, 1.5])[::-1]
    assert chosen(rows, timed("law", [1.0, None, 1.0, None, None])) == {
        "flat": {
            "episode": 3,
            "controller": "mine",
            "reference": "law",
            "metric": "success",
            "values": [1.0, 0.0],
        }
    }


@pytest.mark.parametrize(
    ("mine", "law", "metric", "episode", "values"),
    [
        # both always succeed: the largest difference, whoever is ahead; the first of equal ones
        ([1.0, 2.0, 0.5], [1.25, 1.0, 1.5], "time_to_goal_s", 1, [2.0, 1.0]),
        # the reference alone succeeds
        ([1.0, None, None], [1.0, 1.0, 0.5], "success", 1, [0.0, 1.0]),
    ],
)
def test_else_the_first_in_which_they_differ_most(mine, law, metric, episode, values):
    found = chosen(timed("mine", mine), timed("law", law))["flat"]
    assert (found["metric"], found["episode"], found["values"]) == (metric, episode, values)


def test_the_task_says_in_what_they_differ():
    far = [{**row, "advance_mm": 9.0 + row["episode"]} for row in timed("mine", [None] * 3)]
    near = [{**row, "advance_mm": 5.0} for row in timed("law", [None, None, 1.0])]
    found = chosen(far, near, decisive=["advance_mm"])["flat"]
    assert (found["metric"], found["episode"], found["values"]) == ("advance_mm", 2, [11.0, 5.0])


def test_only_episodes_that_both_walked_count():
    found = chosen(timed("mine", [1.0, 1.0]), timed("law", [None, None])[1:])
    assert found["flat"]["episode"] == 1


def test_the_best_policy_over_all_terrains_is_shown_on_each():
    found = chosen(
        *(
            timed("mine", times, ground)
            for times, ground in (([1.0] * 3, "flat"), ([1.0] * 3, "g"))
        ),
        *(
            timed("other", times, ground)
            for times, ground in (([0.5] * 3, "flat"), ([None] * 3, "g"))
        ),
        *(timed("law", [1.0, None, 1.0], ground) for ground in ("flat", "g")),
        timed("cpg", [None] * 3),
        terrains=("flat", "g"),
    )
    assert [(each["controller"], each["episode"]) for each in found.values()] == [("mine", 1)] * 2


def test_a_policy_of_ones_own_counts_as_learned():
    found = chosen(timed("own", [None, 1.0]), timed("law", [None, None]))["flat"]
    assert (found["controller"], found["episode"]) == ("own", 1)


@pytest.mark.parametrize(
    "walked",
    [
        [timed("law", [None, 1.0])],
        [timed("cpg", [1.0, 1.0]), timed("law", [None, 1.0])],
        [timed("mine", [1.0, None]), timed("law", [1.0, None])],
        # excluded on flat
        [timed("mine", [1.0, 1.0], "gapped"), timed("law", [None, 1.0])],
    ],
    ids=["alone", "nobody learned", "all the same", "crashed"],
)
def test_without_a_contrast_it_is_episode_0(walked):
    assert chosen(*walked) == {"flat": {"episode": 0}}


def test_it_follows_from_the_rows_alone():
    results = make_results(terrains=("flat", "gapped"), reference="pursuit")
    found = contrasts(results.episodes, results.protocol)
    for terrain, own in results.episodes.groupby("terrain", observed=True):
        ends = own.pivot(index="episode", columns="controller", values="success")
        alone = ends["target-ppo"] & ~ends["pursuit"]
        assert (found[terrain]["episode"], found[terrain]["metric"]) == (alone.idxmax(), "success")
    assert len({choice["episode"] for choice in found.values()}) == 2
