"""Environments over one batched core: Gymnasium's Env and VectorEnv, and SB3's VecEnv.

`flyrl.envs.sb3` is imported on its own, since it needs Stable-Baselines3.
"""
