"""Verdicts: whether a flight did what its scenario expects of it, and how nearly.

    scenario = load_scenario("hover").expecting("separation", at_least_m=2.0)
    judged = judged_flight(scenario)
    print(judged.is_passed, judged.verdicts[0].margin)

`judging.Judge` judges a finished run by the expectations of a scenario (`scenario.expectations`),
with a check for each kind in `path_checks`, `topic_checks` and `formula_check`; `observing` records
what they need of the messages during the flight. docs/scenario_tests.md explains it.
"""

from volery.verdicts.flights import JudgedFlight, judged_flight
from volery.verdicts.verdict import Outcome, Verdict

__all__ = ["JudgedFlight", "Outcome", "Verdict", "judged_flight"]
