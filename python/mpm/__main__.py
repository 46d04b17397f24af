"""The command ``mpm``."""

import sys


def main() -> int:
    """Runs the program with the arguments of the process and returns its exit code."""
    from mpm._mpm import main as program

    return program(["mpm", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
