import re

from flyrl.report.style import THEME, colours, marker, stylesheet, themed


def test_fixed_controllers_keep_their_colour_in_any_company():
    alone = colours(["hybrid"])["hybrid"]
    assert colours(["ppo", "cpg", "hybrid", "zero"])["hybrid"] == alone


def test_no_two_of_the_usual_controllers_share_a_colour():
    chosen = colours(["ppo", "sac", "cpg", "rule_based", "hybrid", "pursuit", "zero"])
    assert len(set(chosen.values())) == len(chosen)


def test_marker_colours_become_variables_with_the_light_colour_as_fallback():
    drawn = f'style="stroke: {marker("ink")}; fill: {marker("c0").upper()}"'
    light = {name: values[0] for name, values in THEME.items()}
    assert themed(drawn) == (
        f'style="stroke: var(--ink, {light["ink"]}); fill: var(--c0, {light["c0"]})"'
    )


def test_other_colours_stay():
    assert themed("#ff0000") == "#ff0000"


def test_every_variable_has_a_light_and_a_dark_value():
    light, dark = stylesheet().split("prefers-color-scheme: dark", 1)
    for name in THEME:
        assert re.search(rf"--{name}: #", light)
        assert re.search(rf"--{name}: #", dark)
