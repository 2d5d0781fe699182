"""Files: written whole or not at all, and told apart."""

import hashlib
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a path to write to, which takes the place of `path` once the block ends well.

    An interruption, an error or a full disk leaves what stood at `path` as it was.

    Parameters
    ----------
    path
        File to write or replace; its folder exists.

    Raises
    ------
    OSError
        Naming `path`, also where the system names no file (a full disk) or the one in its place.
    """
    # The suffix stays last: some writers add their own to a name without it.
    partial = path.with_name(f".partial-{os.getpid()}-{path.name}")
    try:
        yield partial
        with partial.open("rb") as file:
            os.fsync(file.fileno())
        partial.replace(path)
    except OSError as error:
        if error.errno is None or error.filename not in (None, partial, str(partial)):
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        partial.unlink(missing_ok=True)


def write_bytes(path: Path, data: bytes) -> None:
    """Write `data` to `path`, whole or not at all."""
    with replacing(path) as partial:
        partial.write_bytes(data)


def write_text(path: Path, text: str) -> None:
    """Write `text` to `path` as UTF-8, whole or not at all."""
    write_bytes(path, text.encode())


def write_folder(folder: Path, texts: Mapping[str, str]) -> None:
    """Write files to a folder, and drop what an earlier writing left there.

    Parameters
    ----------
    folder
        Made if missing.
    texts
        Name of a file -> its text. Each is written whole or not at all. Other files with their
        suffixes are dropped; all else in the folder stays.

    Raises
    ------
    OSError
        The folder cannot be written to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        write_text(folder / name, text)
    suffixes = {Path(name).suffix for name in texts}
    for path in list(folder.iterdir()):
        if path.suffix in suffixes and path.name not in texts and path.is_file():
            path.unlink()


def file_digest(path: Path) -> str | None:
    """SHA-256 of a file, in hexadecimal; None where it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None


def usable_folder(path: Path) -> Path:
    """Make a folder if it is missing; return it.

    Raises
    ------
    OSError
        It cannot be made, or written to.
    """
    path.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=path):
        return path


def new_folder(parent: Path, name: str) -> Path:
    """Make a folder that did not exist: `parent/name`, or `name_2`, `name_3`, … if that is taken.

    Parameters
    ----------
    parent
        Made if missing.
    name
        Wanted name.
    """
    parent.mkdir(parents=True, exist_ok=True)
    path, copies = parent / name, 1
    while True:
        try:
            path.mkdir()
        except FileExistsError:
            copies += 1
            path = parent / f"{name}_{copies}"
        else:
            return path
