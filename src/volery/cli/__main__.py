"""`python -m volery.cli` is the command `volery`."""

from volery.cli.start import main

main()
