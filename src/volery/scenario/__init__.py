"""What to simulate, as data: the schema, the loader, the scenarios that ship."""
