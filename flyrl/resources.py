"""What is installed: assets and configs (beside the package, or inside it), the distribution."""

from importlib import metadata
from pathlib import Path
from typing import Final

DISTRIBUTION: Final = "fly-walking-rl"
"""Name of flyrl on package indexes, where `flyrl` is another project."""

_PACKAGE = Path(__file__).resolve().parent


def _folder(name: str) -> Path:
    installed = _PACKAGE / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


def assets_folder() -> Path:
    """Folder of figures and meshes (`assets/`)."""
    return _folder("assets")


def configs_folder() -> Path:
    """Folder of Hydra config groups (`configs/`)."""
    return _folder("configs")


def version(package: str) -> str | None:
    """Version of a package, `flyrl` or the distribution of another; None if it is not installed."""
    try:
        return metadata.version(DISTRIBUTION if package == "flyrl" else package)
    except metadata.PackageNotFoundError:
        return None


def install_command(extra: str) -> str:
    """Command that installs one of flyrl's extras, for an error message."""
    return f"pip install -e '.[{extra}]' in flyrl's checkout"
