import resource

import pytest

from flyrl.files import replacing, usable_folder, write_folder, write_text


def test_writes_and_replaces(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "one")
    write_text(path, "two")
    assert path.read_text() == "two"
    assert list(tmp_path.iterdir()) == [path]


def test_an_error_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with pytest.raises(RuntimeError), replacing(path) as partial:
        partial.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_an_error_of_the_system_names_the_file_that_was_asked_for(tmp_path):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8, limits[1]))  # as a full disk: names no file
    try:
        with pytest.raises(OSError, match=r"File too large: '.*/a\.txt'$") as full:
            write_text(tmp_path / "a.txt", "more than eight")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert full.value.filename == str(tmp_path / "a.txt")
    with pytest.raises(FileNotFoundError, match=r"'.*/none/a\.txt'$"):
        write_text(tmp_path / "none" / "a.txt", "")


def test_what_an_earlier_writing_left_goes_and_all_else_stays(tmp_path):
    folder = tmp_path / "figures"
    write_folder(folder, {"a.svg": "old", "b.svg": "old"})
    (folder / "a.pdf").write_text("a user's")
    (folder / "kept.svg").mkdir()
    write_folder(folder, {"a.svg": "new"})
    assert {path.name for path in folder.iterdir()} == {"a.svg", "a.pdf", "kept.svg"}
    assert (folder / "a.svg").read_text() == "new"


def test_a_folder_that_files_can_be_written_to(tmp_path):
    assert usable_folder(tmp_path / "a" / "b").is_dir()
    assert list((tmp_path / "a" / "b").iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(FileExistsError, match="file"):
        usable_folder(tmp_path / "file")
