"""The controller inside the engine: the same maths as the classes, and exact bookkeeping."""

import subprocess
import sys
import threading
from dataclasses import replace
from itertools import zip_longest
from typing import Any

import mujoco
import numpy as np
import pytest

from flyrl.anatomy import CONTACT_SEGMENTS
from flyrl.bodies.fly import FlyConfig
from flyrl.bodies.surface import ContactConfig
from flyrl.controllers import CONTROLLERS, Controller
from flyrl.simulation import callback, engine, native
from flyrl.simulation.engine import Layout, check_layout, layout
from flyrl.simulation.flies import FlyBatch
from flyrl.simulation.physics import PhysicsConfig
from flyrl.simulation.randomisation import Randomisation
from flyrl.simulation.scene import SceneConfig, build_scene
from flyrl.tasks import Episode
from flyrl.tasks.episode import draw_oscillators
from flyrl.terrains import TERRAINS, Prop

FINE = PhysicsConfig(timestep=2e-4, contact=ContactConfig())
"""Small steps, and the literature's contact."""


def make_batch(
    controller: Controller | str = "hybrid",
    terrain: str = "flat",
    num_sims: int = 1,
    physics: PhysicsConfig = FINE,
    queue_places: int = 0,
    gait_places: int = 0,
    props: tuple[Prop, ...] = (),
    **body: Any,
) -> FlyBatch:
    """Flies at rest, of the oscillators of the seeds 3, 4, …; `body` are settings of FlyConfig."""
    config = SceneConfig(
        body=FlyConfig(**body),
        terrain=TERRAINS[terrain],
        controller=CONTROLLERS[controller]() if isinstance(controller, str) else controller,
        physics=physics,
        queue_places=queue_places,
        gait_places=gait_places,
        props=props,
    )
    batch = FlyBatch(build_scene(config), num_sims, num_threads=1)
    start(batch)
    return batch


def start(batch: FlyBatch, *changes: dict[str, Any]) -> None:
    """Put flies at rest at the origin; with changes, fly by fly, of their episodes."""
    z = batch.scene.config.terrain.base_height + 0.5
    seeds = range(3, 3 + batch.num_sims)
    usual = [Episode(seed, (0.0, 0.0, z), 0.0, (), *draw_oscillators(seed)) for seed in seeds]
    changed = zip_longest(usual, changes, fillvalue={})
    batch.start(np.arange(len(usual)), [replace(each, **given) for each, given in changed])


def walk(batch: FlyBatch, steps: int = 150) -> np.ndarray:
    """Integration state after a walk in a curve."""
    batch.set_command(np.tile([1.2, 0.4], (batch.num_sims, 1)))
    batch.step(steps)
    return batch.integration_state()


def late(steps: int) -> dict[str, Any]:
    """Change of an episode: latency of the drive, physics steps of `FINE`."""
    return {"randomisation": Randomisation(drive_latency=steps * FINE.timestep)}


def test_latency_without_a_queue_is_refused() -> None:
    with pytest.raises(ValueError, match="queue_places is 0"):
        start(make_batch(), late(1))


@pytest.mark.parametrize("cone", [mujoco.mjtCone.mjCONE_PYRAMIDAL, mujoco.mjtCone.mjCONE_ELLIPTIC])
def test_contact_forces_equal_mujocos(cone: mujoco.mjtCone) -> None:
    """Segment by segment, against mj_contactForce on the same state."""
    batch = make_batch(terrain="blocks")
    walk(batch, 1000)
    model = batch._batch.get_model(0)
    model.opt.cone = cone
    is_elliptic = engine.ENGINE.fields["is_elliptic"][1] // 8
    model.numeric_data[is_elliptic] = float(cone == mujoco.mjtCone.mjCONE_ELLIPTIC)
    data = batch._batch.get_data(0)
    mujoco.mj_forward(model, data)
    expected = np.zeros((36, 3))
    for i, contact in enumerate(data.contact):
        force = np.zeros(6)
        mujoco.mj_contactForce(model, data, i, force)
        force_w = contact.frame.reshape(3, 3).T @ force[:3]
        for geom, sign in ((contact.geom1, -1), (contact.geom2, 1)):
            name = model.body(model.geom_bodyid[geom]).name
            if name in CONTACT_SEGMENTS:
                expected[CONTACT_SEGMENTS.index(name)] += sign * force_w
    summed = data.userdata.view(batch.scene.userdata)[0]["head"]["senses"]["contact_forces_w"]
    assert np.abs(expected).max() > 1.0
    np.testing.assert_allclose(summed, expected, rtol=1e-9, atol=1e-9)


def test_models_of_others_are_left_alone() -> None:
    callback.install()
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><size nuserdata='2000'/>"
        "<custom><numeric name='other' size='2000' data='1 2 3'/></custom>"
        "<worldbody><body><joint name='a'/><geom size='0.1'/></body></worldbody>"
        "<actuator><motor joint='a'/></actuator></mujoco>"
    )
    data = mujoco.MjData(model)
    data.ctrl[0] = 0.5
    mujoco.mj_step(model, data, 10)
    assert data.ctrl[0] == 0.5
    assert not data.userdata.any()


def test_a_model_of_another_process_is_left_alone() -> None:
    """Its kernel's address leads nowhere here: beside it stands another process's number."""
    batch = make_batch()
    model, data = batch._batch.get_model(0), batch._batch.get_data(0)
    process = engine.ENGINE.fields["process"][1] // 8
    assert model.numeric_data[process] == engine.PROCESS
    model.numeric_data[process] += 1.0
    model.numeric_data[engine.ENGINE.fields["kernel"][1] // 8] = 16.0
    before = data.userdata.copy()
    mujoco.mj_step(model, data, 3)
    np.testing.assert_array_equal(data.userdata, before)


def set_callback(place: str, function: object) -> None:
    getattr(mujoco, f"set_mjcb_{place}")(function)


@pytest.mark.parametrize("place", ["control", "sensor", "passive", "contactfilter"])
@pytest.mark.parametrize("moment", ["before", "during"])
def test_somebody_elses_callback_is_an_error_and_is_not_overwritten(place, moment) -> None:
    batch = make_batch()

    def theirs(*_: object) -> int:
        return 0

    set_callback(place, theirs)
    try:
        with pytest.raises(RuntimeError, match=f"MuJoCo's mjcb_{place} is taken by .*theirs"):
            make_batch() if moment == "before" else batch.step()
        assert getattr(mujoco, f"get_mjcb_{place}")() is theirs
    finally:
        set_callback(place, None)


@pytest.mark.parametrize("place", ["control", "sensor"])
def test_a_callback_that_somebody_removed_is_put_back(place) -> None:
    """To the bit: the fly walks as one whose callbacks nobody touched."""
    batch = make_batch()
    walk(batch, 100)
    set_callback(place, None)
    np.testing.assert_array_equal(walk(batch, 100), walk(make_batch(), 200))


def test_mujoco_writes_no_log_into_the_users_folder(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    batch = make_batch()
    batch._qvel[:] = np.nan
    batch.step()
    assert batch.warnings().sum() > 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("compiled", [native.control_callback, native.sensor_callback])
def test_a_callback_is_compiled_once_and_then_read_from_the_disk(compiled) -> None:
    compiled(layout())
    assert compiled(layout()).cache_hits == 1


@pytest.mark.parametrize("field", [name for name in Layout._fields if name != "contact_size"])
def test_a_wrong_offset_is_noticed(field: str) -> None:
    with pytest.raises(RuntimeError, match=f"'{field}'"):
        check_layout(layout()._replace(**{field: 0 if getattr(layout(), field) else 8}))


def test_one_process_compiles_while_the_others_wait() -> None:
    entered = threading.Event()

    def other() -> None:
        with callback.compiling():
            entered.set()

    with callback.compiling():
        thread = threading.Thread(target=other)
        thread.start()
        assert not entered.wait(0.2)
    assert entered.wait(5)
    thread.join()


def test_threads_may_start_together_in_a_new_process():
    code = (
        "from concurrent.futures import ThreadPoolExecutor\n"
        "from flyrl.simulation.callback import install\n"
        "with ThreadPoolExecutor(4) as executor:\n"
        "    list(executor.map(lambda _: install(), range(8)))\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
