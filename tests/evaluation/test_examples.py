import dataclasses

import numpy as np

from flyrl.evaluation import EvaluationConfig, evaluate, walk_examples
from flyrl.tasks import TASKS

SHORT = dataclasses.replace(TASKS["target"](), time_limit_s=0.2)


def test_examples_are_the_episodes_that_were_evaluated():
    config = EvaluationConfig(
        task=SHORT, controllers=("cpg", "hybrid"), episodes=3, film=(2, 0), num_threads=1
    )
    results = evaluate(config)
    examples = walk_examples(config)
    kept = walk_examples(config, results.examples)
    assert set(map(id, kept)) == set(map(id, results.examples))
    for record, again in zip(kept, examples, strict=True):
        np.testing.assert_array_equal(record.position_w, again.position_w)
        np.testing.assert_array_equal(record.gait.stance, again.gait.stance)
    assert [(record.index, record.controller) for record in examples] == [
        *((2, "cpg"), (2, "hybrid")),
        *((0, "cpg"), (0, "hybrid")),
    ]
    paths = [results.trajectories[row] for row in (2, 5, 0, 3)]
    for record, path in zip(examples, paths, strict=True):
        np.testing.assert_array_equal(record.position_w.astype(np.float32), path.position_w)
        assert len(record.gait.stance) == 250
