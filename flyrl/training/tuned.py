"""Settings that were tried for a task and an algorithm, in `configs/tuned`.

Importing this loads neither torch nor MuJoCo, so that a command line is checked at once.
"""

from typing import Any

from flyrl.files import load_yaml
from flyrl.resources import configs_folder


def tuned_name(task: str | None, algo: str | None) -> str:
    """Name of the settings in `configs/tuned` for a task and an algorithm; not all have some."""
    return f"{task}_{algo}"


def tuned_settings(task: str, algo: str) -> dict[str, dict[str, Any]]:
    """What was tried for a task and an algorithm: `algo` and `training`, each by field.

    Empty where nothing was.
    """
    file = configs_folder() / "tuned" / f"{tuned_name(task, algo)}.yaml"
    given = load_yaml(file) if file.is_file() else {}
    return {"algo": {}, "training": {}, **given}
