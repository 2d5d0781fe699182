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


@pytest.fixture
def camera():
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = 90.0, 0.0, 10.0
    return camera


def scene(colour):
    model = mujoco.MjModel.from_xml_string(_XML.format(colour=colour))
    return model, mujoco.MjData(model)


def test_a_video_shows_the_states_it_was_given(tmp_path, camera):
    recorder = VideoRecorder(tmp_path / "videos", "ball")
    recorder.start()
    if not recorder.is_on and "GL" in recorder.note:
        pytest.skip(recorder.note)
    red, green = scene("1 0 0"), scene("0 1 0")
    red[1].qpos[0] = -2.0
    recorder.take(*red, camera, 3)
    red[1].qpos[0] = 2.0
    recorder.take(*red, camera, 2)
    # the scene was changed
    recorder.take(*green, camera, 1)
    recorder.stop()
    recorder.close()
    path = tmp_path / "videos" / "ball_1.mp4"
    assert recorder.note == f"Video: {path}"
    assert [file.name for file in path.parent.iterdir()] == ["ball_1.mp4"]
    shown = decoded(path)[1].astype(int)
    assert shown.shape == (6, recording.HEIGHT, recording.WIDTH, 3)
    # azimuth 90 looks along +y, with +x to the right
    for picture, is_right, channel in ((0, False, 0), (2, False, 0), (4, True, 0), (5, None, 1)):
        strength = shown[picture, :, :, channel] - shown[picture, :, :, 1 - channel]
        column = np.average(np.arange(recording.WIDTH), weights=np.clip(strength, 0, None).sum(0))
        if is_right is None:
            assert column == pytest.approx(recording.WIDTH / 2, abs=15)
        else:
            assert (column > recording.WIDTH / 2 + 40) == is_right
            assert abs(column - recording.WIDTH / 2) > 40


def test_a_long_video_ends_by_itself_and_no_name_is_used_twice(tmp_path, camera, monkeypatch):
    monkeypatch.setattr(recording, "MAX_S", 0.08)
    (tmp_path / "ball_1.mp4").write_bytes(b"")
    recorder = VideoRecorder(tmp_path, "ball")
    recorder.start()
    if not recorder.is_on and "GL" in recorder.note:
        pytest.skip(recorder.note)
    recorder.take(*scene("1 0 0"), camera, 9)
    assert not recorder.is_on
    recorder.close()
    assert len(decoded(tmp_path / "ball_2.mp4")[1]) == 2


def test_a_folder_that_cannot_be_made_is_told(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    recorder = VideoRecorder(tmp_path / "file" / "videos", "ball")
    recorder.start()
    assert not recorder.is_on
    assert recorder.note.startswith("No video:")
    assert "file" in recorder.note
