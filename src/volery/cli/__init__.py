"""The command `volery`. Heavy imports are inside the commands, so that `--help` is quick."""
