"""The list of policies in the documentation."""

import re

import pytest

from flyrl.policies import load_bundle, named_policies
from tests.docs.pages import PAGES

LISTED = dict(
    re.findall(
        r"^\| \[([a-z-]+)\]\(\S+\) \|.*\| ([^|]* \| [^|]*) \|$",
        PAGES["docs/policies.md"].read_text(encoding="utf-8"),
        re.MULTILINE,
    )
)


def test_every_policy_is_listed():
    assert set(LISTED) == set(named_policies())


@pytest.mark.parametrize("name", named_policies())
def test_successes_are_those_of_the_policy_s_file(name):
    rows = load_bundle(name).training["held_out"]["results"]  # the policy first
    best = max(rows[1:], key=lambda row: row["success_rate"]["value"])
    success, fixed = (
        f"{round(100 * row['success_rate']['value'], 1):g}" for row in (rows[0], best)
    )
    assert LISTED[name] == f"{success} | {fixed}, `{best['controller']}`"
