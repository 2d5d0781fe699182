"""Results as a stranger's files can make them."""

from tests.synthetic import make_results

HOSTILE = (
    "</script><script>document.title=666</script>",
    "../../\"><img src=x onerror='document.title=666'>",
    "{{ 7 * 7 }}{% raw %}${7*7}$\\frac$",
    "</style></svg>]]><!--",
    "a\n\u202eb\x00\x1b[31m\udc80",
)
"""Texts of a stranger's file, as short as names of entrants are."""


def hostile_results():
    """Results in which every text that a file of a stranger's can hold is hostile, and all names.

    Terrains, tasks and outcomes are a stranger's where a `results.json` is.
    """
    names = dict(zip(("target-ppo", "cpg", "hybrid"), HOSTILE, strict=False))
    results = make_results(tuple(names), terrains=("flat",), episodes=6)
    long = HOSTILE[0] + "<b>" * 1700
    protocol = results.protocol
    for entrant in protocol["entrants"]:
        entrant.update(
            dict.fromkeys(("leg_controller", "policy", "source", "sha256"), long), kind="learned"
        )
        entrant["training"] = {
            **{"algo": long, "decisions": HOSTILE[1], "seed": HOSTILE[4], "notes": long},
            "settings": {"algo": {HOSTILE[0]: HOSTILE[1]}, "training": {"num_envs": HOSTILE[2]}},
        }
    protocol |= {
        "command": long,
        "settings": {HOSTILE[0]: [HOSTILE[1], {HOSTILE[3]: HOSTILE[4]}]},
        "created_utc": HOSTILE[0],
        "versions": dict.fromkeys(("flyrl", *HOSTILE), HOSTILE[1]),
        "outcomes": [*protocol["outcomes"], *HOSTILE],
        "crashes": [dict.fromkeys(("controller", "terrain", "condition", "error"), long)],
        "physics": {HOSTILE[0]: HOSTILE[1]},
        "body": {"name": HOSTILE[0]},
    }
    for part in ("reward", "observation"):
        for term in protocol["table"][part]:
            term.update(name=HOSTILE[0], description=HOSTILE[1])
    protocol["table"]["success"] = HOSTILE[3]
    results.drawn[HOSTILE[1]] = results.drawn.pop("flat")
    text = str.maketrans({"\x00": "", "\udc80": ""})  # figures are no XML with these: not loaded
    names = {"flat": HOSTILE[1], **{old: new.translate(text) for old, new in names.items()}}
    for rows in (protocol["entrants"], protocol["terrains"], results.summaries):
        for row in rows:
            keys = row.keys() & {"name", "controller", "terrain"}
            row.update({key: names[row[key]] for key in keys})
    for row in results.summaries:
        row["outcomes"] = dict.fromkeys(HOSTILE, 1)
        if row["paired"]:
            row["paired"]["reference"] = names[row["paired"]["reference"]]
    protocol["reference"] = names[protocol["reference"]]
    for column in ("controller", "terrain"):
        results.episodes[column] = results.episodes[column].cat.rename_categories(
            lambda name: names.get(name, name)
        )
    results.episodes["outcome"] = results.episodes["outcome"].cat.rename_categories(
        lambda name: {"timeout": HOSTILE[2]}.get(name, name)
    )
    return results
