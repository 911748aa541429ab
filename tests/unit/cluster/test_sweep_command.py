"""The command `volery sweep`."""

import pytest
from studies import study_file
from typer.testing import CliRunner

from volery.cli.app import app

pytest.importorskip("pyarrow")
pytest.importorskip("scipy")


def sweep(*words):
    return CliRunner().invoke(app, ["sweep", *map(str, words)])


def test_a_study_is_flown_repeated_recorded_and_reported(tmp_path):
    path, out = study_file(tmp_path, "repetitions = 2\n"), tmp_path / "out"
    inside = ("--out", out, "--workers", 0)
    done = sweep(path, *inside)
    assert done.exit_code == 0, done.output
    assert "small: 2 runs, 0 failed; 2 flown now" in done.output
    assert f"table   {out}/table.parquet" in done.output
    again = sweep(path, *inside, "--report")
    assert "0 flown now" in again.output
    assert f"report  {out}/report/index.html" in again.output
    assert (
        "1 run repeated alone, with all sensors: equal"
        in sweep(path, *inside, "--verify", 1).output
    )
    run = next(out.glob("runs/*/*.json")).stem
    recorded = sweep(path, *inside, "--log", run[:8])
    assert f"log     {out}/logs/{run}.mcap" in recorded.output
    assert (out / "logs" / f"{run}.mcap").exists()


BAD = {
    ("--part", "0/3"): "--part: I/N with I from 1 to N",
    ("--part", "two"): "--part: I/N with I from 1 to N",
    ("--part", "1/2", "--report"): "--report is of all parts",
    ("--log", "abc"): "--log abc: no finished run of this study",
    ("--verify", "1"): "no run has finished yet",
}


@pytest.mark.parametrize("options", BAD, ids=" ".join)
def test_bad_options_are_one_line(tmp_path, options):
    done = sweep(study_file(tmp_path), "--out", tmp_path / "out", *options)
    assert done.exit_code == 2
    assert BAD[options] in done.stderr
    assert done.stderr.count("\n") == 1


def test_code_beside_the_study_is_not_run_without_trust(tmp_path):
    (tmp_path / "mine.py").write_text("raise SystemExit('ran')\n")
    path = study_file(tmp_path, "metrics = ['mine.py:drift']\n")
    done = sweep(path, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert "runs code of its own (mine.py); give --trust if it is yours" in done.stderr


def test_an_interrupted_study_says_how_to_continue(tmp_path, monkeypatch):
    def interrupted(*_arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("volery.cluster.driver.StudyDriver.run", interrupted)
    path = study_file(tmp_path, "repetitions = 2\n")
    done = sweep(path, "--out", tmp_path / "out", "--workers", 0)
    assert done.exit_code == 130
    assert "0 of 2 runs are in" in done.stderr
    assert "the same command flies the others" in done.stderr
