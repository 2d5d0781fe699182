"""flyrl: reinforcement learning on top of a fly-locomotion environment."""
