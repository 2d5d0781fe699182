"""The trained policies that come with flyrl, by name."""

from pathlib import Path
from typing import Final

from flyrl.resources import assets_folder

SUFFIX: Final = ".safetensors"


def policies_folder() -> Path:
    """Folder of the policies that come with flyrl, each beside its model card (<name>.md)."""
    return assets_folder() / "policies"


def named_policies() -> dict[str, Path]:
    """Files of the policies that come with flyrl, by name, in alphabetical order."""
    return {path.stem: path for path in sorted(policies_folder().glob(f"*{SUFFIX}"))}


def policy_name(file: Path) -> str | None:
    """Name of a policy file that comes with flyrl; None for any other file."""
    for name, path in named_policies().items():
        if file == path:
            return name
    return None
