"""`podusv`, also as `python -m podusv_cli` and `python -m podusv`."""

import signal
import sys

from podusv_cli import WITHOUT_DOCSTRINGS

ELSEWHERE = "podusv runs on Linux; on Windows use WSL, on macOS a container or virtual machine"


def main() -> None:
    """Import the command line and run it; Ctrl-C ends what has not begun yet without a word.

    Python's own handler would print where in the imports it was.
    """
    if sys.platform != "linux":
        sys.exit(ELSEWHERE)
    if sys.flags.optimize > 1:
        sys.exit(WITHOUT_DOCSTRINGS)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not so under nohup
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from podusv_cli import cli

    cli.main()


if __name__ == "__main__":
    main()
