"""Makes tables of pandas, which is imported at the first use."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from volery.core.extras import import_extra

if TYPE_CHECKING:
    import pandas


def data_frame(columns: Mapping[str, Any], what: str = "to_pandas()") -> pandas.DataFrame:
    """Returns columns as a table. Raises `VoleryError` without pandas; `what` names the caller."""
    table: pandas.DataFrame = import_extra(what, "pandas", "pandas", "pandas").DataFrame(
        dict(columns)
    )
    return table
