"""The command ``mpm``."""

import os
import signal
import sys


def main() -> int:
    """Runs the program with the arguments of the process and returns its exit code."""
    if sys.argv[1:2] == ["picture"]:
        from mpm._picture import main as picture

        return picture(sys.argv[2:])
    from mpm._mpm import main as program

    # `mpm run --picture` draws with the package of this interpreter.
    os.environ["MPM_PYTHON"] = sys.executable
    # The program handles Ctrl-C itself; the handler of Python would raise KeyboardInterrupt once the program has ended.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    return program(["mpm", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
