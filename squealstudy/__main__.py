"""``python -m squealstudy``: the command."""

from squealstudy.cli.app import main

main()
