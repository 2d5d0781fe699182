"""How a command starts: the command line is checked, Hydra composes, plain values are handed on."""

import sys
from collections.abc import Callable
from typing import Any

import hydra
from omegaconf import DictConfig

from flyrl.cli.arguments import HYDRA_VERSION, UsageError, check_arguments, fail, plain_values
from flyrl.resources import configs_folder


def run_command(config_name: str, run: Callable[[dict[str, Any]], None]) -> None:
    """Check the command line against `configs/`, then run on what Hydra composes of both.

    Parameters
    ----------
    config_name
        Name of the primary config.
    run
        Takes plain values, resolved. Called once per job of a sweep.
    """
    try:
        check_arguments(config_name, sys.argv[1:])
    except UsageError as error:
        fail(error)

    def job(config: DictConfig) -> None:
        run(plain_values(config))

    start = hydra.main(
        version_base=HYDRA_VERSION,
        config_path=str(configs_folder().resolve()),
        config_name=config_name,
    )
    start(job)()
