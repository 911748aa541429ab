"""Functions of users that read finished runs: metrics of studies, and predicates."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection
from typing import Any

from volery.core.errors import VoleryError
from volery.core.near_names import near_miss
from volery.verdicts.finished_run import GIVEN


def needs_of(function: Callable[..., Any], given: Collection[str]) -> tuple[str, ...]:
    """Returns the names of the parameters that a finished run fills in; see `FinishedRun`.

    given: names of parameters that have values already. Raises `VoleryError`, naming the
    parameter, if the function needs one that is neither, or has no parameter of a given name.
    """
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        raise VoleryError("it is not a function") from None
    names = [p.name for p in parameters if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)]
    needs = tuple(name for name in names if name in GIVEN and name not in given)
    required = {p.name for p in parameters if p.default is p.empty and p.name in names}
    if superfluous := sorted(set(given) - set(names)):
        hint = near_miss(superfluous[0], names)
        raise VoleryError(f"it has no parameter '{superfluous[0]}', which has a value{hint}")
    if unknown := sorted(required - set(needs) - set(given)):
        raise VoleryError(
            f"its parameter '{unknown[0]}' is neither one that a run gives ({', '.join(GIVEN)}) "
            "nor one with a given value"
        )
    return needs
