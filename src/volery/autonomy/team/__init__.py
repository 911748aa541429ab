"""Team search by radio: sectors, their assignment, and the shared state."""
