"""The command: ``squealstudy`` and ``python -m squealstudy``."""

import os
import signal


def main() -> None:
    """Import the command and run it: Ctrl-C during the import ends it without a traceback."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    # processes that it starts import nothing from the current directory, which may be anybody's
    os.environ.setdefault("PYTHONSAFEPATH", "1")
    from squealstudy.cli.app import main as command

    command()


if __name__ == "__main__":
    main()
