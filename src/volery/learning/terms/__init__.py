"""Parts of tasks: observations, rewards, terminations and starts, each a small pure function."""
