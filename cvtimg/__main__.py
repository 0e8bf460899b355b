"""``python -m cvtimg`` is ``cvtimg``."""

import sys

from cvtimg.cli.app import main

if __name__ == "__main__":
    sys.exit(main())
