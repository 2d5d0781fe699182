"""Where flyrl's assets and configs lie: beside the package, or inside it when installed."""

from pathlib import Path

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
