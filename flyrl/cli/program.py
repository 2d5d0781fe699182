"""How this process was started, for records that say how to repeat it."""

import sys
from pathlib import Path


def program() -> tuple[str, ...]:
    """Interpreter and program, without arguments."""
    script = Path(sys.argv[0])
    if script.name == "__main__.py":  # as python -m: the file by itself would not find its package
        return (sys.executable, "-m", script.parent.name)
    return (sys.executable, sys.argv[0])
