"""Hydra's launcher `ray`: every job of a sweep a task of Ray, here or on a cluster.

Hydra finds its launchers in the namespace `hydra_plugins`, so this is no part of flyrl's package.
"""

import os
import signal
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hydra.core.config_store import ConfigStore
from hydra.core.hydra_config import HydraConfig
from hydra.core.singleton import Singleton
from hydra.core.utils import JobReturn, run_job, setup_globals
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig, open_dict

from flyrl.cli.terminal import reported
from flyrl.resources import install_command


@dataclass
class RayLauncherConf:
    """Settings of the launcher, as `configs/launcher/ray.yaml` explains them."""

    _target_: str = "hydra_plugins.flyrl_ray_launcher.RayLauncher"
    address: str | None = None
    num_cpus: int = 1
    max_retries: int = 3


ConfigStore.instance().store(group="hydra/launcher", name="ray", node=RayLauncherConf)


class RayLauncher(Launcher):
    """Runs jobs as tasks of Ray.

    Parameters
    ----------
    address
        Of the cluster, `auto` for the one that this machine is in; None starts Ray here, which then
        listens on the loopback interface only.
    num_cpus
        CPUs of a job.
    max_retries
        How often a job is run again whose worker was lost.
    """

    def __init__(self, address: str | None, num_cpus: int, max_retries: int) -> None:
        self._address = address
        self._num_cpus = num_cpus
        self._max_retries = max_retries

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        """Take what all jobs have in common."""
        self._common = (hydra_context, task_function, config)

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        """Run the jobs, and wait for all of them, also where one fails.

        Raises
        ------
        Failure
            A job asks for more CPUs than this machine has, or there is no cluster at the address;
            reported here, since Hydra would print a traceback.
        ray.exceptions.RayError
            A worker was lost more often than `max_retries`.
        """
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        if self._address is None:
            os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"  # loopback, on Linux too
        with reported():
            try:
                import ray  # noqa: PLC0415
            except ModuleNotFoundError:
                raise ValueError(f"launcher=ray needs ray: {install_command('ray')}") from None

        at_sigterm = signal.getsignal(signal.SIGTERM)  # which Ray replaces
        try:
            with reported():
                is_local = not self._address
                ray.init(self._address or "local", include_dashboard=False if is_local else None)
                available = ray.cluster_resources().get("CPU", 0)  # type: ignore[no-untyped-call]
                if is_local and self._num_cpus > available:
                    raise ValueError(
                        f"hydra.launcher.num_cpus must be at most {available:g}, the CPUs of this "
                        f"machine, got {self._num_cpus}"
                    )
            signal.signal(signal.SIGTERM, at_sigterm)
            run = ray.remote(num_cpus=self._num_cpus, max_retries=self._max_retries)(_run)
            common = ray.put((*self._common, Singleton.get_state()))
            tasks = [
                run.remote(common, list(overrides), number)
                for number, overrides in enumerate(job_overrides, start=initial_job_idx)
            ]
            try:
                ray.wait(tasks, num_returns=len(tasks), fetch_local=False)
            except KeyboardInterrupt:
                # shutdown kills after a second: too soon for a run to save what it has learned
                for task in tasks:
                    ray.cancel(task)
                ray.wait(tasks, num_returns=len(tasks), fetch_local=False)
                raise
            returned: list[JobReturn] = ray.get(tasks)
            return returned
        finally:
            ray.shutdown()


def _run(common: tuple[Any, ...], overrides: list[str], number: int) -> JobReturn:
    """Run one job, in a worker."""
    context, task_function, config, singletons = common
    setup_globals()
    Singleton.set_state(singletons)
    job = context.config_loader.load_sweep_config(config, overrides)
    with open_dict(job):
        job.hydra.job.id, job.hydra.job.num = str(number), number
    HydraConfig.instance().set_config(job)
    return run_job(
        hydra_context=context,
        config=job,
        task_function=task_function,
        job_dir_key="hydra.sweep.dir",
        job_subdir_key="hydra.sweep.subdir",
    )
