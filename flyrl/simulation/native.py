"""Many simulations of one model, stepped on MuJoCo's native threads: what all bodies share."""

import os
import weakref
from typing import Final

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from flyrl.simulation.callback import install
from flyrl.validation import whole_number

Ids = NDArray[np.intp]

MOST_SIMS: Final = 100_000
"""A fly takes some 40 kB, so more of them would fill the memory before the first step."""

MOST_THREADS: Final = 1024

_WITH_THREADS: "Final[weakref.WeakSet[Batch]]" = weakref.WeakSet()
_OF_PARENT: Final[list[Batch]] = []
"""Batches whose threads stayed behind in a fork: to free one would wait for its threads forever."""

os.register_at_fork(after_in_child=lambda: _OF_PARENT.extend(_WITH_THREADS))


class NativeBatch:
    """`num_sims` simulations of one model, each a row of MuJoCo's integration state.

    The result does not depend on the number of threads or of other simulations, to the bit.

    Parameters
    ----------
    model
        Compiled.
    num_sims
        Number of simulations.
    num_threads
        Native threads that share them; 0 takes one per CPU.

    Raises
    ------
    ValueError
        If one of the numbers is out of its range.
    """

    def __init__(self, model: mujoco.MjModel, num_sims: int = 1, num_threads: int = 0) -> None:
        self.num_sims = whole_number("num_sims", num_sims, 1, MOST_SIMS)
        whole_number("num_threads", num_threads, 0, MOST_THREADS)
        install()
        self._batch = Batch(model, self.num_sims, num_threads)
        self._process = os.getpid()
        if self.num_threads > 1:
            _WITH_THREADS.add(self._batch)
        self._qpos = self._batch.bind("qpos")
        self._qvel = self._batch.bind("qvel")
        self._time = self._batch.bind("time")
        self._userdata = self._batch.bind("userdata")
        self._is_unstable = np.zeros(num_sims, dtype=bool)
        self._warned = self.warnings().sum(axis=1)

    @property
    def num_threads(self) -> int:
        """Number of native threads in use."""
        return int(self._batch.nthread)

    def step(self, num_steps: int = 1, ids: Ids | None = None) -> None:
        """Advance by physics steps, holding the commands.

        A simulation that diverges is marked unstable and keeps a finite state; the others go on.

        Raises
        ------
        RuntimeError
            If it has threads and was made before a fork, in another process; or if MuJoCo's
            callbacks are somebody else's. So do reset and `restore`.
        """
        self._check_process()
        try:
            self._batch.step(ids, num_steps, stage=mujoco.mjtStage.mjSTAGE_POS.value)
        except SimulationError as error:
            self._is_unstable[error.ids] = True
        warned = self.warnings().sum(axis=1)
        self._is_unstable |= warned > self._warned
        self._warned = warned

    def warnings(self) -> NDArray[np.intp]:
        """How often MuJoCo warned of each simulation since its reset, (n, mjNWARNING)."""
        return np.array(self._batch.warning[:, :, 1], dtype=np.intp)

    def integration_state(self) -> NDArray[np.float64]:
        """Everything that determines the future of each simulation, one row each (a copy).

        What differs among the simulations' models does so too: see `Batch.ground` and
        `Batch.vary`.
        """
        return np.array(self._batch.state)

    def restore(self, rows: NDArray[np.float64]) -> None:
        """Put back what `integration_state` returned; the models stay as they are."""
        self._batch.state[:] = rows
        self._is_unstable[:] = False
        self._forward()

    def copy_into(self, sim: int, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Pose a model of the same body as simulation `sim`, for rendering.

        The model may have more in it than the batch's (meshes, a target marker) as long as the
        joints are the same.
        """
        data.qpos[:] = self._qpos[sim]
        data.qvel[:] = self._qvel[sim]
        data.time = self._time[sim]
        mujoco.mj_kinematics(model, data)

    def _clear(self, ids: Ids) -> None:
        """Put simulations back to the model's defaults, which are to be written over, as stable."""
        self._check_process()
        self._batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        self._is_unstable[ids] = False
        self._warned = self.warnings().sum(axis=1)

    def _forward(self, ids: Ids | None = None) -> None:
        """Bring places of bodies up to date with what was written."""
        self._check_process()
        self._batch.forward(ids, stage=mujoco.mjtStage.mjSTAGE_POS.value)

    def _check_process(self) -> None:
        """Raise RuntimeError unless simulations can run here and now; put back our callbacks."""
        if self._process != os.getpid() and self.num_threads > 1:
            raise RuntimeError(
                f"the environment was made in process {self._process} with {self.num_threads} "
                f"threads, which are not in this one, {os.getpid()}: make it in the process that "
                "uses it, or with num_threads=1"
            )
        install()
