"""What MUJOCO_GL may say."""

import pytest

from flyrl.gl import settle_gl


def settled(value, found="libEGL.so.1", system="linux"):
    environ = {} if value is None else {"MUJOCO_GL": value}
    wrong = settle_gl(environ, system, lambda name: found)
    return environ.get("MUJOCO_GL"), wrong


@pytest.mark.parametrize("value", [None, "", "glfw", "egl", " EGL ", "osmesa", "disable", "0"])
def test_what_mujoco_can_use_stays(value):
    assert settled(value) == (value, None)


def test_what_mujoco_does_not_know_switches_pictures_off():
    value, wrong = settled("bogus")
    assert value == "disable"
    assert wrong.startswith("MUJOCO_GL is 'bogus'; it must be one of 'glfw', 'egl', 'osmesa'")
    assert settled("egl", system="darwin")[0] == "disable"


def test_a_missing_library_switches_pictures_off():
    value, wrong = settled("osmesa", found=None)
    assert value == "disable"
    assert "no library libOSMesa" in wrong
    # GLFW brings its own
    assert settled("glfw", found=None) == ("glfw", None)
