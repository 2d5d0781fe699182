"""Installed files: assets and configs (beside the package, or inside it), the distribution."""

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


def tuned_name(task: str | None, algo: str | None) -> str:
    """Name of the settings in `configs/tuned` for a task and an algorithm; not all have some.

    Those of a task whose actions are whole numbers hold for its variant with a box of numbers.
    """
    return f"{(task or '').removesuffix('_box')}_{algo}"


def muscle_profile(key: str, profile: str) -> Path:
    """Image of a muscle's motor pool: one of `assets/muscles` by its name, or a file by its path.

    Parameters
    ----------
    key
        Where it stands in a config, for messages.
    profile
        Name with or without ".png", or a path.

    Raises
    ------
    ValueError
        If there is no such image.
    """
    folder = assets_folder() / "muscles"
    built_in = folder / f"{profile.removesuffix('.png')}.png"
    if built_in.parent == folder and built_in.is_file():
        return built_in
    path = Path(profile).expanduser()
    if not path.is_file():
        from flyrl.validation import did_you_mean  # noqa: PLC0415 - completion does without NumPy

        names = sorted(image.stem for image in folder.glob("*.png"))
        raise ValueError(
            f"{key} must be one of {', '.join(map(repr, names))}, or the path of an image, got "
            f"{profile!r}{did_you_mean(profile, names)}"
        )
    return path.resolve()


def recorded_profile(key: str, profile: str) -> str:
    """`profile` of `muscle_profile` as it holds in any folder: a name, or an absolute path."""
    path = muscle_profile(key, profile)
    return profile if path.parent == assets_folder() / "muscles" else str(path)


def version(package: str) -> str | None:
    """Version of a package, `flyrl` or the distribution of another; None if it is not installed."""
    from importlib import metadata  # noqa: PLC0415 - slow to import

    try:
        return metadata.version(DISTRIBUTION if package == "flyrl" else package)
    except metadata.PackageNotFoundError:
        return None


def install_command(extra: str) -> str:
    """Command that installs one of flyrl's extras, for an error message."""
    return f"pip install -e '.[{extra}]' in flyrl's checkout"
