"""Studies run in this process: results, resuming, failures, logs, equality of all executors."""

import json
import os
from pathlib import Path

import pytest
from studies import TINY, FakeExecutor, study_file

from volery.cluster import StudyError, load_study, run_study
from volery.cluster.report_page import write_study_report
from volery.cluster.results_folder import ResultsFolder
from volery.cluster.study_runs import (
    SweepOptions,
    fingerprints_of,
    fly_study,
    stored_plan,
    worst_runs,
)
from volery.cluster.verification import record_runs, verify_study

pytest.importorskip("pyarrow")
pytest.importorskip("scipy")


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """The tiny study, flown in this process: its folder and table."""
    folder = tmp_path_factory.mktemp("results")
    return folder, run_study(TINY, folder, workers=0)


def fake_study(answer, folder, obstacle="one by one", **options):
    """Flies a study by an executor that answers without flights; returns executor and table."""
    loaded = load_study(options.pop("study", TINY))
    executor = FakeExecutor(answer, obstacle)
    executor.fingerprints = fingerprints_of(loaded)
    return executor, fly_study(loaded, SweepOptions(folder, executor=executor, **options))


def metrics(run):
    return {"success": 1.0, "distance_m": float(run.seed)}


def refuse(_run):
    raise AssertionError("no run is missing")


def test_the_table_has_a_row_for_each_run(flown):
    folder, table = flown
    assert len(table) == 4
    assert table["seed"] == [1, 2, 1, 2]
    assert table["wind"] == ["[2.0, 0.0, 0.0]"] * 2 + ["[6.0, 0.0, 0.0]"] * 2
    assert table["status"] == ["done"] * 4
    assert table["success"] == [1.0] * 4
    assert len(set(table["distance_m"])) == 4
    assert next(iter(table))["point"] == 0
    import pyarrow.parquet

    stored = pyarrow.parquet.read_table(folder / "table.parquet")
    assert stored.to_pydict() == table.columns
    with pytest.raises(Exception, match="no column 'drift'"):
        table["drift"]


def test_runs_together_equal_runs_alone_with_all_their_sensors(flown):
    folder, table = flown
    alone = run_study({**TINY, "vectorized": False, "sensors": "all"}, folder / "alone", workers=0)
    assert alone.repeatable == table.repeatable
    options = SweepOptions(folder, 0)
    assert verify_study(load_study(TINY), options, 2) == (2, [])


def test_a_changed_result_is_found_by_the_verification(flown, tmp_path):
    table = run_study({**TINY, "parameters": {}, "repetitions": 1}, tmp_path, workers=0)
    path = ResultsFolder(tmp_path).file_of(table["run"][0])
    path.write_text(path.read_text().replace('"digest": "', '"digest": "0'))
    loaded = load_study({**TINY, "parameters": {}, "repetitions": 1})
    count, found = verify_study(loaded, SweepOptions(tmp_path, 0), 5)
    assert count == 1
    assert found[0].what.startswith("digests 0")


def test_finished_runs_are_not_flown_again(flown):
    folder, table = flown
    executor, again = fake_study(refuse, folder)
    assert not executor.batches
    assert again.columns == table.columns


def test_more_repetitions_fly_only_the_new_runs(tmp_path):
    fake_study(metrics, tmp_path)
    more = {**TINY, "repetitions": 3}
    executor, table = fake_study(metrics, tmp_path, study=more)
    assert [run.seed for batch in executor.batches for run in batch.runs] == [3, 3]
    assert table["seed"] == [1, 2, 3] * 2


def test_a_damaged_result_is_flown_again(tmp_path):
    _, table = fake_study(metrics, tmp_path)
    path = ResultsFolder(tmp_path).file_of(table["run"][2])
    path.write_text(path.read_text()[:40])
    executor, again = fake_study(metrics, tmp_path)
    assert [run.id for batch in executor.batches for run in batch.runs] == [table["run"][2]]
    assert again.repeatable == table.repeatable


def test_another_metric_flies_all_runs_again(tmp_path):
    fake_study(metrics, tmp_path)
    study = {**TINY, "metrics": ["success", "distance_m", "crashed"]}
    executor, _ = fake_study(metrics, tmp_path, study=study)
    assert sum(len(batch.runs) for batch in executor.batches) == 4


def test_environments_are_shared_out_by_parameter_point(tmp_path):
    study = {**TINY, "repetitions": 9}
    executor, _ = fake_study(metrics, tmp_path, study=study, obstacle="")
    sizes = [(batch.vectorized, len(batch.runs)) for batch in executor.batches]
    assert sizes == [(True, 4), (True, 4), (False, 1)] * 2  # 4 fit into memory


def test_a_run_whose_worker_dies_twice_has_failed(tmp_path):
    def answer(run):
        return "was killed by signal 9" if run.seed == 2 else metrics(run)

    executor, table = fake_study(answer, tmp_path, obstacle="")
    assert table["status"] == ["done", "failed"] * 2
    assert table["error"][1] == "its worker was killed by signal 9"
    assert table["distance_m"] == [1.0, None] * 2
    # together, then alone, and the culprit once more
    flown = [[run.seed for run in batch.runs] for batch in executor.batches]
    assert flown.count([2]) == 4
    assert flown.count([1]) == 2
    _, again = fake_study(refuse, tmp_path)
    assert again.num_failed == 2
    _, retried = fake_study(metrics, tmp_path, retry_failed=True)
    assert retried.num_failed == 0


def test_a_run_that_exceeds_its_time_has_failed_at_once(tmp_path):
    def answer(run):
        return "exceeded the timeout of 1 s" if run.seed == 2 else metrics(run)

    executor, table = fake_study(answer, tmp_path)
    assert table.num_failed == 2
    assert sum(run.seed == 2 for batch in executor.batches for run in batch.runs) <= 4


def test_parts_share_all_runs(tmp_path):
    seeds = []
    for part in ((1, 3), (2, 3), (3, 3)):
        executor, table = fake_study(metrics, tmp_path, part=part)
        seeds += [run.id for batch in executor.batches for run in batch.runs]
        assert not (tmp_path / "table.parquet").exists()
    assert len(seeds) == len(set(seeds)) == 4
    _, table = fake_study(refuse, tmp_path)
    assert table.num_failed == 0
    assert len(table) == 4
    with pytest.raises(StudyError, match="a part is 1/3 to 3/3"):
        fake_study(refuse, tmp_path, part=(4, 3))


def test_a_stop_rule_wants_the_same_runs_after_an_interruption(tmp_path):
    def answer(run):
        noise = 0.01 if run.point == 0 else 3.0
        return {"success": 1.0, "distance_m": 5.0 + noise * (run.seed % 3)}

    study = {
        **TINY,
        "repetitions": 40,
        "stop": {"metric": "distance_m", "half_width": 0.5, "min_repetitions": 4, "every": 4},
    }
    _, table = fake_study(answer, tmp_path / "whole", study=study)
    runs = [table["point"].count(point) for point in (0, 1)]
    assert runs[0] == 4
    assert runs[1] == 40  # it never gets narrow enough

    calls = []

    def interrupted(run):
        calls.append(run)
        if len(calls) > 9:
            raise KeyboardInterrupt
        return answer(run)

    for _ in range(9):
        calls.clear()
        try:
            _, again = fake_study(interrupted, tmp_path / "cut", study=study)
        except KeyboardInterrupt:
            continue
    assert again.columns == table.columns


def test_a_full_disk_leaves_whole_files_only(tmp_path, monkeypatch):
    replaced = []

    def full(source, target):
        replaced.append(target)
        if len(replaced) == 3:
            raise OSError(28, "No space left on device")
        os.rename(source, target)

    monkeypatch.setattr("volery.core.whole_files.os.replace", full)
    with pytest.raises(StudyError, match="no space is left on the disk; finished runs are kept"):
        fake_study(metrics, tmp_path)
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert sorted(path.suffix for path in files) == [".json", ".json", ".parquet"]
    for path in files:
        if path.suffix == ".json":
            json.loads(path.read_text())
    executor, table = fake_study(metrics, tmp_path)
    assert sum(len(batch.runs) for batch in executor.batches) == 2
    assert table.num_failed == 0


MINE = '''
def first(flight):
    """Fails for one seed."""
    return 1.0 / (flight.seed - 2)

def both(simulation, events):
    return {"uavs": len(simulation.uavs), "events": len(events)}

def sizes(log, factor):
    return factor * log.stat().st_size

def text():
    return "five"
'''


def test_metrics_of_the_user_may_raise_and_return_several_numbers(tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    text = """repetitions = 2
    metrics = ['mine.py:first', 'mine.py:both', 'ate_m',
               {name = 'kb', function = 'mine.py:sizes', parameters = {factor = 0.001}}]
    """
    path = study_file(tmp_path, text)
    table = run_study(path, tmp_path / "out", workers=0, trust=True)
    assert table.metrics == ("first", "both.uavs", "both.events", "ate_m", "kb")
    assert table["status"] == ["done", "failed"]
    assert table["first"] == [-1.0, None]
    assert table["both.uavs"][0] == 1.0
    assert 0.0 <= table["ate_m"][0] < 0.1
    assert table["kb"][0] > 1.0
    assert table["error"][1] == "ZeroDivisionError: float division by zero"
    assert "mine.py" in table.tracebacks[table["run"][1]]
    assert not list((tmp_path / "out" / "logs").iterdir())  # no log is kept


@pytest.mark.parametrize(
    ("metric", "words"),
    [
        ("mine.py:gone", "has no function 'gone'"),
        ("mine.py:sizes", "mine.py:sizes: its parameter 'factor'"),
        ("broken.py:f", "broken.py cannot be imported: SyntaxError"),
    ],
)
def test_a_metric_that_cannot_be_called_ends_the_study_at_once(tmp_path, metric, words):
    (tmp_path / "mine.py").write_text(MINE)
    (tmp_path / "broken.py").write_text("def f(:\n")
    path = study_file(tmp_path, f"metrics = ['{metric}']")
    with pytest.raises(StudyError, match=words):
        run_study(path, tmp_path / "out", workers=0, trust=True)


def test_a_metric_of_text_fails_its_run(tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    path = study_file(tmp_path, "metrics = ['mine.py:text']")
    table = run_study(path, tmp_path / "out", workers=0, trust=True)
    assert "returned str; return a number" in table["error"][0]


def test_logs_of_the_worst_runs_are_kept(tmp_path):
    study = {
        **TINY,
        "logs": "worst",
        "worst": {"metric": "distance_m", "count": 1},
        "parameters": {},
        "metrics": ["success", "distance_m"],
    }
    table = run_study(study, tmp_path, workers=0)
    worst = max(range(2), key=lambda row: table["distance_m"][row])
    logs = [f"logs/{run}.mcap" if row == worst else "" for row, run in enumerate(table["run"])]
    assert table["log"] == logs
    assert [path.name for path in (tmp_path / "logs").iterdir()] == [Path(logs[worst]).name]
    digests = table["digest"]
    loaded = load_study(study)
    plan = stored_plan(loaded, tmp_path)
    assert [run.id for run in worst_runs(loaded, plan)] == [table["run"][worst]]
    other = next(run for run in plan.wanted() if run.id != table["run"][worst])
    record_runs(loaded, SweepOptions(tmp_path, 0), [other])
    again = stored_plan(loaded, tmp_path).results
    assert [again[run].digest for run in table["run"]] == digests
    assert again[other.id].log


def test_the_report_has_all_parts_and_the_command_for_logs(flown):
    folder, table = flown
    loaded = load_study(TINY)
    plan = stored_plan(loaded, folder)
    page = write_study_report(loaded, table, plan, Path("tiny.toml")).read_text()
    for words in ("Distributions", "Sensitivity", "Parameter points", "Worst runs by success"):
        assert f"<h2>{words}</h2>" in page
    assert f"volery sweep tiny.toml --out {folder}" in page
    assert f"--log {table['run'][0][:12]}" in page
    assert page.count("<svg") == 2  # distance_m: its distribution, and over the wind


def test_vectorized_runs_that_cannot_be_are_refused(tmp_path):
    study = {**TINY, "vectorized": True, "metrics": ["ate_m"]}
    with pytest.raises(StudyError, match="key 'vectorized': metric 'ate_m' needs a simulation"):
        run_study(study, tmp_path, workers=0)


def test_a_scenario_that_cannot_be_built_ends_the_study_at_once(tmp_path):
    study = {**TINY, "changes": {"types.f450.airframe": "no_such"}}
    with pytest.raises(StudyError, match=r"study 'tiny': .*no_such"):
        run_study(study, tmp_path, workers=0)
