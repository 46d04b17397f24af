"""The command ``mpm``."""

import signal
import sys


def main() -> int:
    """Runs the program with the arguments of the process and returns its exit code."""
    from mpm._mpm import main as program

    # The program handles Ctrl-C itself; the handler of Python would raise KeyboardInterrupt once the program has ended.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    return program(["mpm", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
