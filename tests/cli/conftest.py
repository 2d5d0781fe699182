"""A small report."""

import sys

import pytest

from flyrl.cli import evaluate


@pytest.fixture(scope="session")
def report(tmp_path_factory):
    """Its file, beside the others that an evaluation writes."""
    folder = tmp_path_factory.mktemp("report")
    arguments = "controllers=[cpg,zero] episodes=5 task.time_limit=0.2 num_threads=1"
    parts = "videos=false close_ups=false"
    with pytest.MonkeyPatch.context() as patch:
        command = ["evaluate.py", *arguments.split(), *parts.split(), f"folder={folder}"]
        patch.setattr(sys, "argv", command)
        evaluate.main()
    return folder / "report.html"
