"""Compare policies: python evaluate.py policies=[<run folder>] controllers=[cpg,hybrid]."""

from flyrl.cli.evaluate import main

if __name__ == "__main__":
    main()
