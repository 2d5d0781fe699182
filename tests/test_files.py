import hashlib
import json
import resource

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flyrl.files import MANIFEST, OutputFolder, load_arrays, replacing, usable_folder, write_text


def test_an_error_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "one")
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


def test_only_files_that_flyrl_wrote_are_written_over_and_removed(tmp_path):
    output = OutputFolder(tmp_path)
    for name in ("figures/a.svg", "figures/edited.svg", "parts/a.txt"):
        output.write_text(name, "old")
    (tmp_path / "figures" / "edited.svg").write_text("by the user")
    foreign = tmp_path / "figures" / "foreign.svg"
    foreign.write_text("a user's")
    again = OutputFolder(tmp_path)
    with pytest.raises(FileExistsError, match=r"flyrl did not write this file .*foreign\.svg"):
        again.write_text("figures/foreign.svg", "flyrl's")
    assert foreign.read_text() == "a user's"
    again.write_text("parts/a.txt", "new")
    assert (tmp_path / "parts" / "a.txt").read_text() == "new"
    again.remove(*again.files("figures"), "figures/foreign.svg", "parts/a.txt")
    # folders that are empty go
    assert {path.name for path in tmp_path.iterdir()} == {"figures", MANIFEST}
    left = {path.name for path in (tmp_path / "figures").iterdir()}
    assert left == {"edited.svg", "foreign.svg"}


@pytest.mark.parametrize("name", ["../thesis.txt", "{outside}", "link/thesis.txt", "thesis_link"])
def test_a_manifest_leads_to_nothing_outside_of_its_folder(tmp_path, name):
    outside = tmp_path / "thesis.txt"
    outside.write_text("a user's")
    folder = tmp_path / "results"
    folder.mkdir()
    (folder / "link").symlink_to(tmp_path)
    (folder / "thesis_link").symlink_to(outside)
    name = name.format(outside=outside)
    digest = hashlib.sha256(b"a user's").hexdigest()
    (folder / MANIFEST).write_text(json.dumps({"files": {name: digest}}))
    OutputFolder(folder).remove(name)
    assert outside.read_text() == "a user's"


@pytest.mark.parametrize("text", ["", "[]", '{"files": [1]}', '{"icons": []}', "[" * 10**5])
def test_a_manifest_of_others_is_not_written_over(tmp_path, text):
    (tmp_path / MANIFEST).write_text(text)
    with pytest.raises(FileExistsError, match=r"flyrl did not write this file .*manifest\.json"):
        OutputFolder(tmp_path)
    assert (tmp_path / MANIFEST).read_text() == text


def test_a_folder_that_files_can_be_written_to(tmp_path):
    assert usable_folder(tmp_path / "a" / "b").is_dir()
    assert list((tmp_path / "a" / "b").iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(FileExistsError, match="file"):
        usable_folder(tmp_path / "file")


@settings(max_examples=100, derandomize=True, database=None, deadline=None)
@given(st.data())
def test_a_damaged_file_of_arrays_is_a_value_error_or_read(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("arrays") / "a.npz"
    np.savez_compressed(path, a=np.arange(40), b=np.frombuffer(b"flies" * 40, np.uint8))
    contents = bytearray(path.read_bytes())
    contents[data.draw(st.integers(0, len(contents) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(contents[: data.draw(st.sampled_from([None, len(contents) // 2, 0]))])
    try:
        load_arrays(path)
    except ValueError as error:
        assert str(error).startswith(f"{path} is no whole file of arrays: ")


def test_a_single_array_is_no_file_of_arrays(tmp_path):
    np.save(tmp_path / "a.npy", np.arange(3))
    with pytest.raises(ValueError, match="is no whole file of arrays"):
        load_arrays(tmp_path / "a.npy")
