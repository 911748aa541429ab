"""`python -m volery.cli` is the command `volery`."""

from volery.cli.app import main

main()
