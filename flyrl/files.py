"""Files: written whole or not at all, and recognised by their content."""

import errno
import hashlib
import itertools
import json
import os
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

import yaml

MANIFEST: Final = "manifest.json"
"""Names the files in a folder of results that flyrl wrote."""


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


class OutputFolder:
    """A folder of results: files that flyrl wrote are replaced and removed, all others stay.

    `manifest.json` in the folder names the files that flyrl wrote, with their SHA-256.

    Parameters
    ----------
    path
        Of the folder; it need not exist yet.

    Raises
    ------
    OSError
        Its `manifest.json` is somebody else's, or cannot be read.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._digests = self._read_manifest()

    def check_free(self, *names: str) -> None:
        """Raise FileExistsError if one of these files exists and is not flyrl's."""
        for name in names:
            file = self.path / name
            if name not in self._digests and (file.exists() or file.is_symlink()):
                raise _foreign(file, f"it is not in {MANIFEST}")

    @contextmanager
    def replacing(self, name: str) -> Iterator[Path]:
        """Give a path to write to, as `files.replacing` does, for a file of flyrl's.

        Parameters
        ----------
        name
            Path in the folder, with "/". Folders are made if missing.

        Raises
        ------
        OSError
            There is a file of somebody else's, or it cannot be written.
        """
        self.check_free(name)
        file = self.path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        with replacing(file) as partial:
            yield partial
            self._note({**self._digests, name: file_digest(partial) or ""})

    def write_text(self, name: str, text: str) -> None:
        """Write a file as UTF-8, whole or not at all; raises as `replacing` does."""
        with self.replacing(name) as partial:
            partial.write_text(text, encoding="utf-8", newline="")

    def files(self, folder: str) -> list[str]:
        """Files that flyrl wrote to a folder in this one, by their paths in this one."""
        return [name for name in self._digests if name.rpartition("/")[0] == folder]

    def remove(self, *names: str) -> None:
        """Remove those of these files that flyrl wrote and nobody changed; then empty folders."""
        for name in self._digests.keys() & set(names):
            file = self.path / name
            if not file.is_symlink() and file_digest(file) == self._digests[name]:
                file.unlink()
            self._note({other: self._digests[other] for other in self._digests if other != name})
        for parent in {(self.path / name).parent for name in names} - {self.path}:
            with suppress(OSError):  # it is missing, or holds other files
                parent.rmdir()

    def _note(self, digests: dict[str, str]) -> None:
        self._digests = digests
        write_text(self.path / MANIFEST, json.dumps({"files": digests}, indent=1) + "\n")

    def _read_manifest(self) -> dict[str, str]:
        """Digests by name; of names that lead out of the folder, none."""
        file = self.path / MANIFEST
        try:
            files = json.loads(file.read_text(encoding="utf-8"))["files"]
            names = [name for name in files if self._is_inside(name)]
            return {name: str(files[name]) for name in names}
        except (FileNotFoundError, NotADirectoryError):
            return {}
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            raise _foreign(file, "it lists no files of results") from error

    def _is_inside(self, name: str) -> bool:
        return (self.path / name).parent.resolve().is_relative_to(self.path.resolve())


def _foreign(file: Path, reason: str) -> FileExistsError:
    return FileExistsError(
        errno.EEXIST,
        f"flyrl did not write this file ({reason}); move it away, or choose another folder",
        str(file),
    )


class _PlainLoader(yaml.SafeLoader):
    """Loads YAML without aliases: nested ones make gigabytes of a short file."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("aliases (*name) are not allowed")
        return super().compose_node(parent, index)


def load_yaml(path: Path) -> Any:
    """Read a YAML file of plain values, without aliases.

    Raises
    ------
    OSError
        The file cannot be read.
    ValueError
        It is no such YAML.
    """
    try:
        # a subclass of SafeLoader
        return yaml.load(path.read_text(encoding="utf-8"), Loader=_PlainLoader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise ValueError(f"{path} is no YAML of plain values: {reason}") from error


def load_arrays(path: Path) -> dict[str, Any]:
    """Read all NumPy arrays of an .npz file, without pickles.

    Raises
    ------
    OSError
        The file cannot be read.
    ValueError
        It is no such file, or not whole.
    """
    import numpy as np  # noqa: PLC0415  (slow, and nothing else here needs it)

    damages = (EOFError, KeyError, MemoryError, OverflowError, RuntimeError, TypeError, ValueError)
    try:
        # opened here: np.load would leave a file that is not whole open
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            return dict(arrays)
    except (*damages, zipfile.BadZipFile, zlib.error) as error:
        raise ValueError(f"{path} is no whole file of arrays: {error}") from error


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
    for copy in itertools.count(1):
        path = parent / (name if copy == 1 else f"{name}_{copy}")
        with suppress(FileExistsError):
            path.mkdir()
            break
    return path
