import dataclasses

import numpy as np

from flyrl.evaluation import EvaluationConfig, evaluate, walk_examples
from flyrl.tasks import TASKS

SHORT = dataclasses.replace(TASKS["target"], time_limit_s=0.2)


def test_an_example_is_the_episode_that_was_evaluated():
    config = EvaluationConfig(task=SHORT, controllers=("cpg", "hybrid"), episodes=3, num_threads=1)
    results = evaluate(config)
    examples = walk_examples(config, 2)
    assert [record.controller for record in examples] == ["cpg", "hybrid"]
    paths = [results.trajectories[row] for row in (2, 5)]
    for record, path in zip(examples, paths, strict=True):
        assert record.index == 2
        np.testing.assert_array_equal(record.position_w.astype(np.float32), path.position_w)
        assert len(record.gait.stance) == 200
