"""Many runs of one scenario: studies as data, run on all cores, with a table and a report.

    from volery.cluster import run_study

    table = run_study("gusts.toml")
    print(table["success"])

docs/sweeps.md explains it. Nothing heavy is imported until a study runs.
"""

from __future__ import annotations

from volery.cluster.errors import StudyError
from volery.cluster.loading import load_study
from volery.cluster.study import Study
from volery.cluster.study_runs import run_study
from volery.cluster.table import StudyTable

__all__ = ["Study", "StudyError", "StudyTable", "load_study", "run_study"]
