"""Flight logs in the format of PX4 (ULog)."""
