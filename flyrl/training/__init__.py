"""From a training config to a run folder: build, learn, evaluate on the way, keep the best.

The modules that need Stable-Baselines3 are imported on their own: `flyrl.training.learn`.
"""
