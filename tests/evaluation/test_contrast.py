"""Which episode shows best where a learned entrant differs from the reference."""

import pytest

from flyrl.evaluation.contrast import contrasts
from flyrl.evaluation.episodes import episode_table
from tests.evaluation.test_summary import timed
from tests.synthetic import TASK, judged_by

KINDS = {"mine": "learned", "other": "learned", "own": "own", "law": "fixed", "cpg": "fixed"}


def chosen(*walked, decisive=("success", "time_to_goal_s")):
    """Choice among the rows of some entrants, of whom `law` is the reference."""
    rows = [row for own in walked for row in own]
    protocol = {
        **judged_by(TASK),
        "decisive": decisive,
        "reference": "law",
        "entrants": [{"name": name, "kind": kind} for name, kind in KINDS.items()],
        "terrains": [{"name": "flat"}],
    }
    return contrasts(episode_table(rows), protocol)


@pytest.mark.parametrize(
    ("mine", "law", "metric", "episode", "values"),
    [
        # the first in which the policy alone succeeds: in 0 the reference alone does, in 2 both
        ([None, None, 1.0, 0.5, 1.5], [1.0, None, 1.0, None, None], "success", 3, [1.0, 0.0]),
        # both always succeed: the largest difference, whoever is ahead; the first of equal ones
        ([1.0, 2.0, 0.5], [1.25, 1.0, 1.5], "time_to_goal_s", 1, [2.0, 1.0]),
        # the reference alone succeeds
        ([1.0, None, None], [1.0, 1.0, 0.5], "success", 1, [0.0, 1.0]),
    ],
)
def test_the_episode_in_which_they_differ_most(mine, law, metric, episode, values):
    # rows may stand in any order
    assert chosen(timed("mine", mine)[::-1], timed("law", law)) == {
        "flat": {
            "episode": episode,
            "controller": "mine",
            "reference": "law",
            "metric": metric,
            "values": values,
        }
    }


def test_the_task_says_in_what_they_differ():
    far = [{**row, "advance_mm": 9.0 + row["episode"]} for row in timed("mine", [None] * 3)]
    near = [{**row, "advance_mm": 5.0} for row in timed("law", [None, None, 1.0])]
    found = chosen(far, near, decisive=["advance_mm"])["flat"]
    assert (found["metric"], found["episode"], found["values"]) == ("advance_mm", 2, [11.0, 5.0])


LOSS, WIN = [None] * 3, [1.0] * 3


@pytest.mark.parametrize(
    ("walked", "expected"),
    [
        # only episodes that both walked count
        ([timed("mine", WIN), timed("law", LOSS)[1:]], ("mine", 1)),
        # a policy of one's own counts as learned
        ([timed("own", [None, 1.0]), timed("law", [None, None])], ("own", 1)),
        # the best over all terrains is shown on each
        (
            [
                *(timed("mine", WIN, "flat"), timed("mine", WIN, "gapped")),
                *(timed("other", [0.5] * 3, "flat"), timed("other", LOSS, "gapped")),
                *(timed("law", [1.0, None, 1.0], ground) for ground in ("flat", "gapped")),
                timed("cpg", LOSS),
            ],
            ("mine", 1),
        ),
        # without a contrast it is episode 0: alone, nobody learned, all the same, crashed on flat
        ([timed("law", [None, 1.0])], (None, 0)),
        ([timed("cpg", [1.0, 1.0]), timed("law", [None, 1.0])], (None, 0)),
        ([timed("mine", [1.0, None]), timed("law", [1.0, None])], (None, 0)),
        ([timed("mine", [1.0, 1.0], "gapped"), timed("law", [None, 1.0])], (None, 0)),
    ],
)
def test_whose_episode_it_is(walked, expected):
    found = chosen(*walked)["flat"]
    assert (found.get("controller"), found["episode"]) == expected
