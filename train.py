"""Train a policy: python train.py task=target terrain=flat algo=ppo seed=0."""

from flyrl.cli.train import main

if __name__ == "__main__":
    main()
