"""`python -m flyrl`: the same as the command `flyrl`."""

import sys

from flyrl.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
