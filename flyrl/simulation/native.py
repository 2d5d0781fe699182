"""Many simulations of one model, stepped on MuJoCo's native threads: what all bodies share."""

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from flyrl.simulation.callback import install

Ids = NDArray[np.intp]


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
        If one of the numbers is too small.
    """

    def __init__(self, model: mujoco.MjModel, num_sims: int = 1, num_threads: int = 0) -> None:
        if num_sims < 1:
            raise ValueError(f"num_sims is {num_sims}; it must be >= 1")
        if num_threads < 0:
            raise ValueError(f"num_threads is {num_threads}; it must be >= 0 (0: one per CPU)")
        install()
        self.num_sims = num_sims
        self._batch = Batch(model, num_sims, num_threads)
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
        """
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

        What differs among the simulations' models does so too: see `FlyBatch.ground` and
        `FlyBatch.vary`.
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
        self._batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        self._is_unstable[ids] = False
        self._warned = self.warnings().sum(axis=1)

    def _forward(self, ids: Ids | None = None) -> None:
        """Bring places of bodies up to date with what was written."""
        self._batch.forward(ids, stage=mujoco.mjtStage.mjSTAGE_POS.value)
