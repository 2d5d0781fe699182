"""Motor pools, from arrays and from images."""

import numpy as np
import pytest
from PIL import Image

from flyrl.muscles import MotorPool
from tests.muscles.creatures import save_profile


@pytest.mark.parametrize("seed", range(2))
def test_recruitment_grows_to_exactly_one(seed):
    rng = np.random.default_rng(seed)
    forces = rng.exponential(size=rng.integers(1, 400)) * rng.integers(0, 2)
    forces[rng.integers(forces.size)] = 10.0 ** rng.integers(-200, 200)
    recruitment = MotorPool(forces).recruitment
    assert recruitment[0] >= 0
    assert (np.diff(recruitment) >= 0).all()
    assert recruitment[-1] == 1.0


def test_a_pool_cannot_change():
    forces = np.array([1.0, 3.0])
    pool = MotorPool(forces)
    forces[0] = 100.0
    assert pool.forces.tolist() == [1.0, 3.0]
    for array in (pool.forces, pool.recruitment):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


@pytest.mark.parametrize(
    ("forces", "message"),
    [
        ([], "have a finite sum above 0"),
        ([[1.0, 2.0]], r"have shape \(2,\), got shape \(1, 2\)"),
        ([1.0, 0.0, -0.5], r"be at least 0, got -0.5 at \[2\]"),
        ([0.0, 0.0], r"have a finite sum above 0, got \[0"),
        ([1e308, 1e308], "have a finite sum above 0"),
    ],
)
def test_bad_forces(forces, message):
    with pytest.raises(ValueError, match=f"forces must .*{message}"):
        MotorPool(forces)


def test_an_image_is_read_by_the_blue_of_its_first_row(tmp_path):
    path = save_profile(tmp_path / "pool.png", [0, 1, 100, 255])
    assert MotorPool.from_image(str(path)).forces.tolist() == [0, 1, 100, 255]


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "L", "LA", "P", "1"])
def test_images_of_all_kinds_are_read(mode, tmp_path):
    """One dark and one light pixel: black is strongest, white has no force."""
    image = Image.new("L", (2, 1), 255)
    image.putpixel((0, 0), 0)
    image.convert(mode).save(tmp_path / "pool.png")
    assert MotorPool.from_image(tmp_path / "pool.png").forces.tolist() == [255, 0]


def test_transparency_does_not_count(tmp_path):
    image = Image.new("P", (2, 1))
    image.putpalette([255, 255, 255, 139, 0, 0])
    image.putpixel((1, 0), 1)
    image.save(tmp_path / "palette.png", transparency=b"\x80\x00")
    assert MotorPool.from_image(tmp_path / "palette.png").forces.tolist() == [0, 255]
    rgba = np.array([[[0, 0, 55, 0], [0, 0, 155, 128]]], np.uint8)
    Image.fromarray(rgba).save(tmp_path / "rgba.png")
    assert MotorPool.from_image(tmp_path / "rgba.png").forces.tolist() == [200, 100]


def test_files_that_are_no_pool(tmp_path):
    (tmp_path / "text.png").write_text("no image")
    whole = save_profile(tmp_path / "whole.png", range(200)).read_bytes()
    (tmp_path / "whole.png").unlink()
    (tmp_path / "half.png").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "no_width.ppm").write_bytes(b"P6 0 1 255\n")
    Image.new("I;16", (2, 1)).save(tmp_path / "deep.png")
    save_profile(tmp_path / "white.png", [0, 0, 0])
    for path in tmp_path.iterdir():
        with pytest.raises(ValueError, match=rf"image of a motor pool .*{path.name}"):
            MotorPool.from_image(path)
    with pytest.raises(FileNotFoundError, match=r"nothing\.png: there is no such file"):
        MotorPool.from_image(tmp_path / "nothing.png")
