"""Words that a shell completes: commands, options, names, folders and files.

argcomplete's own command, `register-python-argcomplete flyrl`, makes the shell ask; Hydra itself
completes the settings of `train.py` and `evaluate.py`.
"""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Iterable
from typing import Any, Final, cast

_TABLES: Final = {
    "body": "flyrl.envs.config:BODIES",
    "controller": "flyrl.controllers:CONTROLLERS",
    "physics": "flyrl.simulation.physics:PHYSICS_PRESETS",
    "task": "flyrl.tasks:TASKS",
    "terrain": "flyrl.terrains:TERRAINS",
}
"""Option -> the table of its values, imported when it is asked for."""


def answer(parser: argparse.ArgumentParser) -> None:
    """Tell the shell what can stand at its cursor, and end the process."""
    import argcomplete  # noqa: PLC0415

    argcomplete.autocomplete(parser, default_completer=cast(Any, offered))


def offered(
    prefix: str, action: argparse.Action, parser: argparse.ArgumentParser, **_: Any
) -> Iterable[str]:
    """Values of an argument without choices of its own, or else files, as argcomplete asks."""
    from argcomplete.completers import FilesCompleter  # noqa: PLC0415

    from flyrl.cli.figures import FIGURES  # noqa: PLC0415
    from flyrl.cli.play import NAMES  # noqa: PLC0415
    from flyrl.resources import assets_folder, configs_folder  # noqa: PLC0415

    command = parser.prog.rpartition(" ")[2]
    if action.dest in _TABLES:
        module, table = _TABLES[action.dest].split(":")
        return [*map(str, getattr(importlib.import_module(module), table))]
    if action.dest == "search":
        return [file.stem for file in (configs_folder() / "search").glob("*.yaml")]
    if (command, action.dest) == ("figures", "names"):
        return FIGURES
    if (command, action.dest) == ("play", "name"):
        return NAMES
    files = [*FilesCompleter()(prefix)]
    if action.dest == "policy":
        files += [file.stem for file in (assets_folder() / "policies").glob("*.safetensors")]
    return files
