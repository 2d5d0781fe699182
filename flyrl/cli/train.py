"""flyrl-train: train a policy, and compare it with the fixed controllers if asked to."""

import sys
from typing import Any

import hydra
from omegaconf import DictConfig

from flyrl.cli.arguments import HYDRA_VERSION, UsageError, check_arguments, fail, plain_values
from flyrl.resources import configs_folder

CONFIG_NAME = "train"


def main() -> None:
    """Check the command line, then run; the last line printed is `run: <folder>`."""
    try:
        check_arguments(CONFIG_NAME, sys.argv[1:])
    except UsageError as error:
        fail(error)
    _main()


@hydra.main(
    version_base=HYDRA_VERSION,
    config_path=str(configs_folder().resolve()),
    config_name=CONFIG_NAME,
)
def _main(config: DictConfig) -> None:
    run(plain_values(config))


def run(record: dict[str, Any]) -> None:
    """Train as a composed `configs/train.yaml` says.

    Parameters
    ----------
    record
        Plain values, resolved.
    """
    # Imported here so that a mistyped key is reported at once, before torch and MuJoCo load.
    from flyrl.cli.config import training_config  # noqa: PLC0415
    from flyrl.training.learn import train  # noqa: PLC0415

    try:
        config = training_config(record)
    except ValueError as error:
        fail(error)
    finished = train(config, record["runs_folder"], [sys.executable, *sys.argv])
    print(f"run: {finished.folder}")
    if finished.interrupted_by is not None:
        raise SystemExit(128 + finished.interrupted_by)
