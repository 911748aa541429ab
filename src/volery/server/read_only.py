"""Services that change nothing: viewers may call them, and they command no UAV."""

from __future__ import annotations

from volery.core.data_tables import read_table

READ_ONLY_SERVICES = frozenset(read_table(__file__, "read_only_services.toml")["services"])
