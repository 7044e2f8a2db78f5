"""`podusv`, also as `python -m podusv_cli` and `python -m podusv`."""

import os
import sys

from podusv_cli import WITHOUT_DOCSTRINGS


def leave_out_current_folder() -> None:
    """Take the folder where `python -m` begins off `sys.path`, unless podusv itself lies there.

    It may be somebody's, with a file that has the name of a library.
    """
    here, own = os.getcwd(), os.path.dirname(os.path.dirname(os.path.realpath(__file__)))
    if os.path.abspath(sys.path[0]) == here and os.path.realpath(here) != own:
        del sys.path[0]


def main() -> None:
    """Import the command line and run it; Ctrl-C ends what has not begun yet without a word.

    Python's own handler would print where in the imports it was.
    """
    if sys.flags.optimize > 1:
        sys.exit(WITHOUT_DOCSTRINGS)
    import signal

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not so under nohup
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from podusv_cli import cli

    cli.main()


if __name__ == "__main__":
    leave_out_current_folder()
    main()
