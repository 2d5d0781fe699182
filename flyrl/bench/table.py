"""Results as text."""

from collections.abc import Callable, Sequence
from typing import Any, Final

from flyrl.bench.results import PARTS, Results, Row


def table(results: Results) -> str:
    """One table per part, headed by what was measured; and where it changes, when and on what."""
    blocks, machine = [], None
    for name, part in results.items():
        if part["machine"] != machine:
            machine = part["machine"]
            blocks.append(about(machine))
        blocks.append(f"{name}: {PARTS[name]}\n{_TABLES[name](part['rows'])}")
    return "\n\n".join(blocks) or "nothing measured yet"


def about(machine: dict[str, Any]) -> str:
    """Date, processor and versions in one line."""
    versions = ", ".join(f"{name} {version}" for name, version in machine["versions"].items())
    return f"{machine['date']}, {machine['cpu']}, cores: {machine['cores']}, {versions}"


def aligned(head: Sequence[str], rows: Sequence[Sequence[str]], labels: int = 1) -> str:
    """Lines of aligned columns, the first `labels` to the left, the others to the right."""
    lines = [head, *rows]
    widths = [max(len(line[k]) for line in lines) for k in range(len(head))]
    return "\n".join(
        "  "
        + "  ".join(
            cell.ljust(width) if k < labels else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )


def engine_table(rows: Sequence[Row]) -> str:
    """A row per preset, terrain and number of threads; a column per number of flies."""
    batches = sorted({row["flies"] for row in rows})
    cells: dict[tuple[str, str, str], dict[int, str]] = {}
    for row in rows:
        key = (row["physics"], row["terrain"], str(row["threads"]))
        mark = "!" if row["unstable"] else ""
        text = f"{row['steps_per_s']:,.0f} ({row['real_time']:.2f}){mark}"
        cells.setdefault(key, {})[row["flies"]] = text
    head = ["physics", "terrain", "threads", *(_flies(number) for number in batches)]
    body = [[*key, *(found.get(number, "-") for number in batches)] for key, found in cells.items()]
    text = aligned(head, body, labels=3)
    if any(row["unstable"] for row in rows):
        text += "\n  ! a fly blew up on the way"
    return text


def _threads_table(rows: Sequence[Row]) -> str:
    return aligned(
        ["flies", "median ratio", "of"],
        [
            [
                str(row["flies"]),
                f"{row['ratio']:.2f}",
                " ".join(f"{each:.2f}" for each in row["ratios"]),
            ]
            for row in rows
        ],
    )


def _overhead_table(rows: Sequence[Row]) -> str:
    names = ("bare", "controller", "environment")
    head = ["physics", "terrain", "bare steps/s", "controller", "ratio", "environment", "ratio"]
    body = []
    for row in rows:
        line = [row["physics"], row["terrain"]]
        for name in names:
            line.append(f"{row[name]:,.0f}")
            if name != "bare":
                line.append(f"{row[f'{name}_ratio']:.3f}")
        body.append(line)
    return aligned(head, body, labels=2)


def _environment_table(rows: Sequence[Row]) -> str:
    return aligned(
        ["threads", "flies", "ms per step", "engine", "resets", "rest"],
        [
            [
                str(row["threads"]),
                str(row["flies"]),
                f"{row['ms_per_step']:.1f}",
                *(f"{row[name]:.1%}" for name in ("engine", "resets", "rest")),
            ]
            for row in rows
        ],
    )


def _scale_table(rows: Sequence[Row]) -> str:
    return aligned(
        ["flies", "construction s", "compilations", "MB per fly", "reset of 2, ms", "compilations"],
        [
            [
                str(row["flies"]),
                f"{row['construction_s']:.2f}",
                str(row["compilations_in_construction"]),
                f"{row['mb_per_fly']:.3f}",
                f"{row['reset_two_ms']:.2f}",
                str(row["compilations_in_resets"]),
            ]
            for row in rows
        ],
    )


def _single_table(rows: Sequence[Row]) -> str:
    return aligned(
        ["physics", "steps/s"], [[row["physics"], f"{row['steps_per_s']:,.0f}"] for row in rows]
    )


def _ppo_table(rows: Sequence[Row]) -> str:
    shares = ("physics", "environment", "policy", "update", "rest", "collection")
    return aligned(
        ["flies", "decisions/s", *shares],
        [
            [
                str(row["flies"]),
                f"{row['decisions_per_s']:,.0f}",
                *(f"{row[name]:.1%}" for name in shares),
            ]
            for row in rows
        ],
    )


def _worm_table(rows: Sequence[Row]) -> str:
    text = aligned(
        ["worm", "worms", "steps/s", "simulated s/s"],
        [
            [
                row["worm"],
                str(row["worms"]),
                f"{row['steps_per_s']:,.0f}" + ("!" if row["unstable"] else ""),
                f"{row['real_time']:.1f}",
            ]
            for row in rows
        ],
    )
    if any(row["unstable"] for row in rows):
        text += "\n  ! a worm blew up on the way"
    return text


def rendering_table(rows: Sequence[Row]) -> str:
    """A row per terrain and camera; or why there is none."""
    if rows and "note" in rows[0]:
        return f"  {rows[0]['note']}"
    body = [
        [
            row["terrain"],
            row["camera"],
            f"{row['pictures_per_s']:.1f}",
            f"{row['wall_ms']:.1f}",
            f"{row['processor_ms']:.1f}",
        ]
        for row in rows
    ]
    head = ["terrain", "camera", "pictures/s", "ms each", "ms of processor time"]
    return aligned(head, body, labels=2)


def peers_table(rows: Sequence[Row]) -> str:
    """A row per terrain and simulator, then what was not measured."""
    body = [
        [
            row["terrain"],
            row["simulator"],
            row["what"],
            f"{row['steps_per_s']:,.0f}",
            f"{row['real_time']:.3f}",
            f"{row['ratio']:.1f}" if "ratio" in row else "-",
        ]
        for row in rows
        if "note" not in row
    ]
    head = ["terrain", "simulator", "what", "steps/s", "simulated s/s", "flyrl balanced over it"]
    notes = [f"  {row['simulator']}: {row['note']}" for row in rows if "note" in row]
    return "\n".join([aligned(head, body, labels=3), *notes])


def _flies(number: int) -> str:
    return f"{number:,} {'fly' if number == 1 else 'flies'}"


_TABLES: Final[dict[str, Callable[[Sequence[Row]], str]]] = {
    "engine": engine_table,
    "threads": _threads_table,
    "overhead": _overhead_table,
    "environment": _environment_table,
    "scale": _scale_table,
    "single": _single_table,
    "ppo": _ppo_table,
    "worm": _worm_table,
    "rendering": rendering_table,
    "peers": peers_table,
}
