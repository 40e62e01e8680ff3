"""The command ``subap``: ``python -m subaperture``."""

from __future__ import annotations

import sys

from subaperture._native import command


def main() -> None:
    """Run the command with the arguments of the process."""
    sys.exit(command(["subap", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
