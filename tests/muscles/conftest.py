import pytest

from tests.muscles.creatures import save_profile


@pytest.fixture
def profiles(tmp_path):
    """Folder with a steep profile, of shares 0, 1/4 and 3/4, and an even one of two neurons."""
    folder = tmp_path / "profiles"
    folder.mkdir()
    save_profile(folder / "steep.png", [0, 1, 3])
    save_profile(folder / "even.png", [2, 2])
    return folder
