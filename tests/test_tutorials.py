"""docs/tutorials: every notebook runs from top to bottom, and shows what it was stored with.

What is stored comes from tools/run_notebooks.py, with a fresh kernel for each. Here one kernel
runs them all, each in an empty namespace and an empty folder: its start and the imports take as
long as half a tutorial. Only the kinds of outputs are compared: another processor rounds
differently, and the ways of two flies part after a few strides. So fewer episodes and decisions
do, and fewer points of a curve.
"""

import asyncio
import re

import nbformat
import pytest
from jupyter_client.manager import AsyncKernelManager

from flyrl.cli.main import main
from tools.run_notebooks import KERNEL, LARGEST_BYTES, TUTORIALS, check_private, cleaned, execute

NOTEBOOKS = [pytest.param(path, id=path.stem) for path in sorted(TUTORIALS.glob("*.ipynb"))]

SHORTER = {
    r"episodes=\d+": "episodes=2",
    r"seed=0,1": "seed=0",
    r" n_steps=16": " n_steps=8",
    r"total_timesteps=1024": "total_timesteps=256",
    r"evaluation_interval=512": "evaluation_interval=256",
    r"(total_timesteps|evaluation_interval)=(\d)_000": r"\1=\g<2>00",
    r"decision_s, horizon_s = 0\.02, 1\.0": "decision_s, horizon_s = 0.02, 0.1",
    r"model\.learn\(384\)": "model.learn(32)",
    r"n_steps=128, batch_size=64, n_epochs=4": "n_steps=32, batch_size=16, n_epochs=1",
    r"for seed in range\(4\)": "for seed in range(2)",
    r"for height in \(0\.1, 0\.3, 0\.5\)": "for height in (0.1, 0.5)",
    r"TERRAINS\[\"flat\"\], size=5": 'TERRAINS["flat"], size=2, starts=2',
    r"every=0\.02": "every=0.02, seconds=0.2",
    r"seconds=1(\.\d)?\b": "seconds=0.3",
    r"seconds=0\.[56]": "seconds=0.1",
    r"round\(0\.5 / TIMESTEP\)": "round(0.1 / TIMESTEP)",
    r"\"time_limit\": [13]\.[05]": '"time_limit": 0.3',
    r"(time_limit: Annotated\[float, Within\(0\.1, 60\)\]) = \d+\.0": r"\1 = 0.5",
    r"(evaluate\([^()]*task=)\"(traverse|target)\"": r'\1{"name": "\2", "time_limit": 0.5}',
    r"(flyrl\.train\(\s*|, )\"target\"(?=,)": r'\1{"name": "target", "time_limit": 0.5}',
}
"""What is long in the tutorials: what does instead."""


@pytest.fixture(scope="module")
def kernel():
    main(["compile"])  # nobody is to be told on stderr that it happens
    manager = AsyncKernelManager(kernel_name=KERNEL["name"])
    yield manager
    asyncio.run(manager.shutdown_kernel(now=True))


def code(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def kinds(cell):
    """What a cell shows: names of its streams, and formats of the rest."""
    return [output.get("name") or sorted(output["data"]) for output in cell.outputs]


def test_all_that_is_made_shorter_is_there():
    notebooks = [nbformat.read(path.values[0], as_version=4) for path in NOTEBOOKS]
    sources = "\n".join(cell.source for notebook in notebooks for cell in code(notebook))
    assert [size for size in SHORTER if not re.search(size, sources)] == []
    assert len(notebooks) == 11


def test_a_path_of_the_machine_is_not_stored():
    output = nbformat.v4.new_output("stream", text="wrote /home/fly/tutorial/run.csv\n")
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(outputs=[output])])
    check_private(notebook, ["/home/worm"])
    with pytest.raises(ValueError, match=r"got 'wrote /home/fly/tutorial/run.csv"):
        check_private(notebook, ["/home/worm", "/home/fly/tutorial"])


@pytest.mark.parametrize("path", NOTEBOOKS)
def test_it_is_stored_as_one_whole_run_left_it(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert path.stat().st_size <= LARGEST_BYTES
    assert notebook == cleaned(notebook)
    cells = code(notebook)
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    assert all(output.output_type != "error" for cell in cells for output in cell.outputs)
    assert "stderr" not in [kind for cell in cells for kind in kinds(cell)]


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS)
def test_it_runs_and_shows_what_is_stored(path, kernel, tmp_path):
    stored = nbformat.read(path, as_version=4)
    run = nbformat.from_dict(stored)
    for cell in code(run):
        cell.outputs = []
        for size, less in SHORTER.items():
            cell.source = re.sub(size, less, cell.source)
    # what is left then, is imported: it lasts, and is no longer looked through for garbage
    empty = f"%reset -f\n__import__('gc').freeze()\n%cd -q {tmp_path}"
    start = nbformat.v4.new_code_cell(empty)
    run.cells.insert(0, start)
    execute(run, tmp_path, kernel)
    run.cells.remove(start)
    for was, now in zip(code(stored), code(cleaned(run)), strict=True):
        if "needs-gl" not in was.metadata.get("tags", []):  # without GL, it says so instead
            assert kinds(now) == kinds(was), now.source
