"""Studies are checked before the first run: each error names file, key and what is allowed."""

import pytest
from studies import TINY, study_file

from volery.cluster import StudyError, load_study
from volery.cluster.runs import runs_of

WIND = "[parameters.wind]\nkey = 'world.wind.velocity_m_s'\n"

BAD = {
    "seeeds = [1]": "unknown key 'seeeds'; did you mean 'seeds'",
    "seeds = [1, 1]": "contains a seed twice",
    "seeds = [1]\nrepetitions = 2": "not both",
    "repetitions = 0": "key 'repetitions': a number of at least 1 is needed",
    "metrics = ['sucess']": "no metric 'sucess'; did you mean 'success'",
    "metrics = []": "key 'metrics'",
    "metrics = ['success', 'success']": "two metrics are named 'success'",
    "metrics = ['gone.py:drift']": "no file",
    "[changes]\n'world.wnd' = 1": r"\[changes\].*unknown key 'world.wnd'; did you mean 'wind'",
    "[parameters.wind]\nkey = 'world.wind.velocty_m_s'\nvalues = [1.0]": (
        "parameters.wind: key 'world.wind.velocty_m_s' = 1.0: .*did you mean 'velocity_m_s'"
    ),
    "[parameters.seed]\nkey = 'sed'\nvalues = [1]": "unknown key 'sed'; did you mean 'seed'",
    f"{WIND}values = []": "key 'parameters.wind.values': a list of at least 1 is needed",
    f"{WIND}values = [[900.0, 0.0, 0.0]]": "parameters.wind: .*900.0",
    WIND: "give one of 'values', 'range' with 'steps', or 'distribution'",
    f"{WIND}range = [0.0, 1.0]": "'range' and 'steps' belong together",
    f"{WIND}distribution = 'normal'\nmean = 0.0": "distribution normal needs 'std'",
    f"{WIND}distribution = 'uniform'\nlow = 2.0\nhigh = 1.0": "must be below high",
    f"{WIND}distribution = 'loguniform'\nlow = 0.0\nhigh = 1.0": "must be above 0",
    f"{WIND}distribution = 'uniform'\nlow = 0.0\nhigh = 1.0": r"add \[sampling\]",
    "[sampling]\nsamples = 4": "needs a parameter with a 'distribution'",
    "[sampling]\nmethod = 'sobol'\nsamples = 6": "power of two, such as 4 or 8",
    "[stop]\nmetric = 'distance'\nhalf_width = 1.0": (
        "key 'stop.metric': 'distance' is not one of the study's metrics; did you mean 'distance_m'"
    ),
    "[worst]\nmetric = 'ate_m'": "key 'worst.metric'",
    "logs = 'some'": "key 'logs'",
    "not toml": "not valid TOML",
}


@pytest.mark.parametrize("text", BAD)
def test_a_bad_study_is_one_clear_line(tmp_path, text):
    path = study_file(tmp_path, text)
    with pytest.raises(StudyError, match=BAD[text]) as caught:
        load_study(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_scenario_that_does_not_exist_is_named(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text('name = "small"\nscenario = "hoover"\n')
    with pytest.raises(StudyError, match=r"key 'scenario': .*did you mean 'hover'"):
        load_study(path)


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    with pytest.raises(StudyError, match="cannot be read: No such file"):
        load_study(tmp_path / "none.toml")
    with pytest.raises(StudyError, match="is a folder"):
        load_study(tmp_path)


def test_code_beside_the_study_needs_trust(tmp_path):
    (tmp_path / "mine.py").write_text("def drift(flight): return 0.0\n")
    for metric in ("mine.py:drift", "mine:drift"):
        path = study_file(tmp_path, f"metrics = ['{metric}']")
        with pytest.raises(StudyError, match=r"runs code of its own .*--trust"):
            load_study(path)
        assert load_study(path, trust=True).study.metrics == (metric,)


def test_a_scenario_file_beside_the_study_is_found(tmp_path, monkeypatch):
    load_study({**TINY})  # from plain data, without a file
    scenario = load_study(TINY).scenario
    scenario.with_(name="own").save(tmp_path / "own.toml")
    path = tmp_path / "study.toml"
    path.write_text('name = "small"\nscenario = "own.toml"\n')
    monkeypatch.chdir("/")
    assert load_study(path).scenario.name == "own"


def test_runs_have_an_identity_of_content_parameters_and_seed():
    runs = list(runs_of(load_study(TINY)))
    assert [(run.point, run.seed) for run in runs] == [(0, 1), (0, 2), (1, 1), (1, 2)]
    assert len({run.id for run in runs}) == 4
    assert [run.id for run in runs_of(load_study(TINY))] == [run.id for run in runs]
    more = list(runs_of(load_study({**TINY, "repetitions": 3})))
    assert {run.id for run in runs} < {run.id for run in more}
    other = {run.id for run in runs_of(load_study({**TINY, "duration_s": 0.6}))}
    assert not other & {run.id for run in runs}


def test_a_run_depends_on_the_files_that_its_scenario_names(tmp_path):
    airframe = tmp_path / "mine.toml"
    airframe.write_text('base = "f450"\n')
    scenario = tmp_path / "own.toml"
    scenario.write_text(
        'name = "own"\n[types.a]\nairframe = "mine.toml"\n[[uavs]]\ntype = "a"\n'
        "position_m = [0.0, 0.0]\n"
    )
    path = tmp_path / "study.toml"
    path.write_text('name = "small"\nscenario = "own.toml"\n')
    from volery.cluster import runs

    first = next(runs_of(load_study(path))).id
    airframe.write_text('base = "f450"\n# heavier\n')
    runs._file_hashes.cache_clear()
    assert next(runs_of(load_study(path))).id != first
