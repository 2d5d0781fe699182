"""Hydra's config groups, as the folders of `configs/` hold them."""

from flyrl.resources import configs_folder


def config_groups() -> dict[str, list[str]]:
    """Config groups and their choices, in alphabetical order."""
    folders = (path for path in configs_folder().iterdir() if path.is_dir())
    return {path.name: sorted(file.stem for file in path.glob("*.yaml")) for path in folders}
