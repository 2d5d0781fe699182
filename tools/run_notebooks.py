"""Run the tutorials, each in a fresh kernel, and store them with their outputs.

    python tools/run_notebooks.py                # all of docs/tutorials
    python tools/run_notebooks.py 03 muscles     # those whose name has one of these in it

A tutorial is stored whole or not at all: one that raises an error, prints a path of this machine or
gets too large for a page stays as it was.
"""

from __future__ import annotations

import argparse
import copy
import itertools
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import nbformat
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from flyrl.files import write_text  # noqa: E402

TUTORIALS: Final = ROOT / "docs" / "tutorials"
LARGEST_BYTES: Final = 500_000
"""Of a tutorial; whoever opens its page downloads it."""

TIMEOUT_S: Final = 600
"""Of a cell, s."""

KERNEL: Final = {"display_name": "Python 3", "language": "python", "name": "python3"}


def main(arguments: Sequence[str] | None = None) -> None:
    """Read the command line, then run and store."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("name", nargs="*", help="part of the name of a tutorial; all without one")
    given = parser.parse_args(arguments)
    chosen = [
        path
        for path in sorted(TUTORIALS.glob("*.ipynb"))
        if not given.name or any(name in path.name for name in given.name)
    ]
    if not chosen:
        parser.error(f"name: no tutorial has {' or '.join(given.name)} in its name")
    for path in chosen:
        start = time.perf_counter()
        try:
            size = store(path)
        except (CellExecutionError, ValueError) as error:
            sys.exit(f"{path.name}: {error}")
        print(f"{path.name}: {time.perf_counter() - start:.1f} s, {size / 1000:.0f} kB")


def store(path: Path) -> int:
    """Run a notebook in a fresh kernel and write it with what it showed; return its size in bytes.

    Parameters
    ----------
    path
        Of the notebook; its working directory is an empty folder that is gone afterwards.

    Raises
    ------
    CellExecutionError
        A cell raised an error.
    ValueError
        An output names a path of this machine, or the file gets larger than `LARGEST_BYTES`.
    OSError
        The file cannot be written.
    """
    notebook = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call]
    with tempfile.TemporaryDirectory() as folder:
        execute(notebook, Path(folder))
    notebook = cleaned(notebook)
    check_private(notebook, [folder, str(ROOT), sys.prefix])
    text = nbformat.writes(notebook) + "\n"  # type: ignore[no-untyped-call]
    size = len(text.encode())
    if size > LARGEST_BYTES:
        raise ValueError(f"a notebook must have at most {LARGEST_BYTES} bytes, got {size}")
    write_text(path, text)
    return size


def execute(
    notebook: nbformat.NotebookNode, folder: Path, kernel: AsyncKernelManager | None = None
) -> None:
    """Run all cells of a notebook in place, from top to bottom.

    Parameters
    ----------
    notebook
        Gets the outputs.
    folder
        Working directory of a kernel that is started for it.
    kernel
        Runs the cells where it is, and goes on running; None starts one and ends it.

    Raises
    ------
    CellExecutionError
        A cell raised an error; those below it did not run.
    """
    client = NotebookClient(
        notebook,
        km=kernel,
        kernel_name=KERNEL["name"],
        timeout=TIMEOUT_S,
        resources={"metadata": {"path": str(folder)}},
        record_timing=False,
        # the kernel warns that it can be spoken to, which only this machine can
        extra_arguments=["--log-level=ERROR"],
    )
    try:
        client.execute()
    finally:
        if kernel is not None and client.kc is not None:
            client.kc.stop_channels()


def cleaned(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """The notebook without what another machine or another moment would have otherwise.

    Text that was printed in several pieces becomes one; of metadata, only tags stay.
    """
    kept = copy.deepcopy(notebook)
    kept.metadata = {"kernelspec": dict(KERNEL), "language_info": {"name": KERNEL["language"]}}
    for cell in kept.cells:
        tags = cell.metadata.get("tags", [])
        cell.metadata = {"tags": tags} if tags else {}
        if cell.cell_type == "code":
            cell.outputs = _joined(cell.outputs)
    return kept


def check_private(notebook: nbformat.NotebookNode, folders: Sequence[str]) -> None:
    """Raise ValueError if anything that a notebook shows as text names one of these folders."""
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            texts = [output.get("text", ""), data.get("text/plain", ""), data.get("text/html", "")]
            for folder, text in itertools.product(folders, texts):
                if folder in text:
                    raise ValueError(f"outputs must name no path of this machine, got {text!r}")


def _joined(outputs: Sequence[nbformat.NotebookNode]) -> list[nbformat.NotebookNode]:
    joined: list[nbformat.NotebookNode] = []
    for output in outputs:
        last = joined[-1] if joined else None
        is_stream = output.output_type == "stream"
        if last and is_stream and last.output_type == "stream" and last.name == output.name:
            last.text += output.text
        else:
            joined.append(output)
    return joined


if __name__ == "__main__":
    main()
