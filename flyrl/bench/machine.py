"""What ran a measurement."""

from datetime import date
from typing import Any, Final

from flyrl.training.provenance import provenance

_PACKAGES: Final = ("mujoco", "numpy", "numba", "torch", "stable-baselines3")


def machine() -> dict[str, Any]:
    """Describe what runs this: versions, processor, date."""
    origin = provenance()
    return {
        "versions": {
            "python": origin["python"],
            **{name: origin["packages"][name] for name in _PACKAGES},
        },
        "cpu": origin["cpu"]["model"],
        "cores": origin["num_cpus"],
        "date": date.today().isoformat(),
    }
