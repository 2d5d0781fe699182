"""The built-in tasks by name."""

from typing import Final

from flyrl.tasks.function import TASKS
from flyrl.tasks.heading import heading
from flyrl.tasks.hybrid_turning import hybrid_turning, joints, joints_box
from flyrl.tasks.path import path
from flyrl.tasks.target import target, target_goal
from flyrl.tasks.traverse import traverse
from flyrl.tasks.velocity import velocity
from flyrl.tasks.worm import worm_crawl, worm_crawl_box, worm_hang, worm_hang_box

TASKS.update(
    {
        function.__name__: function
        for function in (
            target,
            target_goal,
            velocity,
            path,
            traverse,
            heading,
            hybrid_turning,
            joints,
            joints_box,
            worm_hang,
            worm_hang_box,
            worm_crawl,
            worm_crawl_box,
        )
    }
)

TASK_NAMES: Final = tuple(TASKS)
"""Of the built-in tasks."""
