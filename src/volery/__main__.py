"""`python -m volery` is the command `volery`."""

from volery.cli.start import main

main()
