"""Wrong command lines of trainings and evaluations end in one line, and write nothing."""

import pytest

TRAINING = [
    ("resume=", "error: resume must be the path of a folder or file, got ''"),
    ("evaluation.folder=", "error: folder must be the path of a folder or file, got ''"),
    ("evaluate_after=[]", "error: evaluate_after must be one of False, True, got []"),
    ("algo.gamma=2", "error: algo.gamma must be a finite number from 0 to 1, got 2"),
    ("resume=runs/a seed=1", "own settings; 'seed' cannot be given with it (allowed are"),
    ("resume=runs/a", "error: runs/a is not the folder of a run: [Errno 2] No such file"),
]
EVALUATION = [
    ("controllers=cgp", "did you mean 'cpg'?"),
    ("folder=/proc/x", "error: [Errno 2] No such file or directory: '/proc/x'"),
    ("camera=side", "camera must be one of 'follow', 'top', 'goal', got 'side'"),
    ("task.decision_interval=0.01", "task.decision_interval must be null in an evaluation"),
    ("task=worm_hang body.profile=my.png", "error: body.profile must be one of 'human'"),
    ("task=worm_hang +controller.name=cpg", "controller"),
    ("task=worm_hang task.time_limit=-3", "error: task.time_limit must be a finite"),
]


@pytest.mark.parametrize(
    ("program", "arguments", "message"),
    [
        *(("train.py", *each) for each in TRAINING),
        *(("evaluate.py", *each) for each in EVALUATION),
    ],
)
def test_wrong_command_lines_end_in_one_line(tmp_path, run_here, program, arguments, message):
    result = run_here(program, *arguments.split())
    assert result.returncode == 2
    (line,) = result.stderr.splitlines()
    assert message in line
    assert list(tmp_path.iterdir()) == []
