"""Services that the metrics of a run can be sent to, beside its folder; none by default."""

from typing import Final

from flyrl.training.loggers.base import LoggerConfig, LoggerError, Session
from flyrl.training.loggers.mlflow import MlflowConfig
from flyrl.training.loggers.wandb import WandbConfig

LOGGERS: Final[dict[str, type[LoggerConfig]]] = {
    config.name: config for config in (WandbConfig, MlflowConfig)
}
"""Name -> settings."""

__all__ = ["LOGGERS", "LoggerConfig", "LoggerError", "MlflowConfig", "Session", "WandbConfig"]
