"""Videos of what is played."""

import mujoco
import numpy as np
import pytest

from flyrl.play import recording
from flyrl.play.recording import VideoRecorder
from tests.pictures import decoded

_XML = """
<mujoco>
  <worldbody>
    <light pos="0 0 9"/>
    <body mocap="true"><geom type="box" size="9 9 9" pos="0 0 -99" rgba="{colour} 1"/></body>
    <body>
      <joint type="slide" axis="1 0 0"/>
      <geom type="sphere" size="1" rgba="{colour} 1" mass="1"/>
    </body>
  </worldbody>
</mujoco>
"""


CAMERA = mujoco.MjvCamera()
CAMERA.azimuth, CAMERA.elevation, CAMERA.distance = 90.0, 0.0, 10.0


def started(folder):
    """A recorder that has begun; skips the test where nothing can draw."""
    recorder = VideoRecorder(folder, "ball")
    recorder.start()
    if not recorder.is_on and "GL" in recorder.note:
        pytest.skip(recorder.note)
    return recorder


def scene(colour):
    model = mujoco.MjModel.from_xml_string(_XML.format(colour=colour))
    return model, mujoco.MjData(model)


def test_a_video_shows_the_states_it_was_given(tmp_path):
    recorder = started(tmp_path / "videos")
    red, green = scene("1 0 0"), scene("0 1 0")
    red[1].qpos[0] = -2.0
    recorder.take(*red, CAMERA, 3)
    red[1].qpos[0] = 2.0
    recorder.take(*red, CAMERA, 2)
    # the scene was changed
    recorder.take(*green, CAMERA, 1)
    recorder.stop()
    recorder.close()
    path = tmp_path / "videos" / "ball_1.mp4"
    assert recorder.note == f"Video: {path}"
    assert [file.name for file in path.parent.iterdir()] == ["ball_1.mp4"]
    shown = decoded(path)[1].astype(int)
    assert shown.shape == (6, recording.HEIGHT, recording.WIDTH, 3)
    # azimuth 90 looks along +y, with +x to the right
    middle = recording.WIDTH / 2
    for picture, low, high, channel in (
        (0, 0, middle - 40, 0),
        (2, 0, middle - 40, 0),
        (4, middle + 40, recording.WIDTH, 0),
        (5, middle - 15, middle + 15, 1),
    ):
        strength = shown[picture, :, :, channel] - shown[picture, :, :, 1 - channel]
        column = np.average(np.arange(recording.WIDTH), weights=np.clip(strength, 0, None).sum(0))
        assert low <= column <= high


def test_a_long_video_ends_by_itself_and_no_name_is_used_twice(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "MAX_S", 0.08)
    (tmp_path / "ball_1.mp4").write_bytes(b"")
    recorder = started(tmp_path)
    recorder.take(*scene("1 0 0"), CAMERA, 9)
    assert not recorder.is_on
    recorder.close()
    assert len(decoded(tmp_path / "ball_2.mp4")[1]) == 2


def test_a_folder_that_cannot_be_made_is_told(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    recorder = started(tmp_path / "file" / "videos")
    assert not recorder.is_on
    assert recorder.note.startswith("No video:")
    assert "file" in recorder.note
