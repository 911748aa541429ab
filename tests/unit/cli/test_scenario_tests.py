"""`volery test`: exit codes, reports, what failed flights leave, and bad input."""

from __future__ import annotations

import json
import re
import shlex
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from volery.cli.app import app

HOP = """
name = "hop"
duration_s = {seconds}
[world.wind]
velocity_m_s = [1.0, 0.0, 0.0]
turbulence = "light"
[types.bird]
airframe = "f450"
[types.bird.flight]
take_off_altitude_m = 2.0
[[types.bird.sensors]]
kind = "odometry"
[[uavs]]
type = "bird"
count = 2
position_m = [0.0, 0.0]
last_position_m = [4.0, 0.0]
on_start = "take_off"
[[expect]]
kind = "no_contact"
"""
FAST = '[[expect]]\nkind = "speed"\nat_most_m_s = {limit}\n'
ON_TOPIC = '[[expect]]\nkind = "topic_rate"\ntopic = "odom"\nat_least_hz = 45\n'


def test(*words):
    """Runs the command in this process."""
    return CliRunner().invoke(app, ["test", *map(str, words)])


test.__test__ = False


@pytest.fixture
def hop(tmp_path, monkeypatch):
    """Writes scenarios below an empty working folder."""
    monkeypatch.chdir(tmp_path)

    def write(more="", seconds=3.0, name="hop.toml"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(HOP.format(seconds=seconds) + more)
        return path

    return write


def test_flights_that_pass(hop, tmp_path):
    path = hop(ON_TOPIC)
    done = test(path, "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert f"{path}  .  " in done.output
    assert re.search(r"^1 flight passed in \d+\.\d s$", done.output, re.MULTILINE)
    assert re.search(r"[\d.]+ Hz +odom >= 45 Hz \(seed 1\)", done.output)
    assert not list((tmp_path / "out").rglob("*.mcap"))


def test_a_failed_flight_can_be_repeated(hop, tmp_path):
    path = hop(FAST.format(limit=0.5))
    done = test(path, "--seeds", 2, "--jobs", 1, "--out", tmp_path / "out")
    assert done.exit_code == 1, done.output
    assert f"{path}  FF  " in done.output
    assert "2 of 2 flights failed" in done.output
    assert f"FAILED {path}, seed 2" in done.output
    second = done.output[done.output.index(f"FAILED {path}, seed 2") :]
    failed = re.search(r"failed +speed .*: ([\d.]+) m/s \(uav\d at ([\d.]+) s\)", second)
    assert float(failed[1]) > 0.5
    (replay,) = re.findall(r"replay +(volery run .* --seed 2 .*)", done.output)
    words = shlex.split(replay)[1:-1]  # without --page
    assert words[:2] == ["run", str(path)]
    assert float(words[words.index("--seconds") + 1]) > float(failed[2])
    again = CliRunner().invoke(app, [*words, "--fail-on", "expectation"])
    assert again.exit_code == 1, again.output
    assert failed[0].removeprefix("failed").strip() in again.output
    logs = re.findall(r"log +(\S+\.mcap)", done.output)
    from volery.logs import open_log

    assert len(logs) == 2
    assert open_log(logs[0])["/uav1/odom"]["pose.pose.position.z"].max() > 1.0
    fewer = test(path, "--no-logs", "--out", tmp_path / "out")
    assert "log  " not in fewer.output
    assert not list((tmp_path / "out").rglob("*.mcap"))


def test_verdicts_as_json_are_the_same_with_more_processes(hop, tmp_path):
    path = hop(FAST.format(limit=0.5) + ON_TOPIC, seconds=1.0)
    options = "--seeds", 3, "--no-logs", "--json", "--out"
    one = json.loads(test(path, "--jobs", 1, *options, tmp_path / "one").stdout)
    two = json.loads(test(path, "--jobs", 2, *options, tmp_path / "two").stdout)
    assert [flight["seed"] for flight in one["scenarios"][0]["flights"]] == [1, 2, 3]
    assert not one["passed"]
    pairs = [flights["scenarios"][0]["flights"] for flights in (one, two)]
    for first, second in zip(*pairs, strict=True):
        assert first["digest"] == second["digest"]
        assert first["verdicts"] == second["verdicts"]
    digests = {flight["digest"] for flight in one["scenarios"][0]["flights"]}
    assert len(digests) == 3


def test_values_are_drawn_for_each_seed(hop, tmp_path):
    path = hop(FAST.format(limit=0.5), seconds=1.5)
    vary = "--vary", "wind=2:8", "--vary", "types.bird.flight.take_off_altitude_m=1:2"
    options = "--json", "--jobs", 1, "--out", tmp_path / "out"
    many = json.loads(test(path, *vary, "--seeds", 3, *options).stdout)
    flights = many["scenarios"][0]["flights"]
    winds = [flight["changes"]["wind"][0] for flight in flights]
    assert len(set(winds)) == 3
    assert all(2.0 < wind < 8.0 for wind in winds)
    assert len({flight["digest"] for flight in flights}) == 3
    alone = json.loads(test(path, *vary, "--seeds", 1, "--first-seed", 3, *options).stdout)
    assert alone["scenarios"][0]["flights"][0]["changes"] == flights[2]["changes"]
    assert alone["scenarios"][0]["flights"][0]["digest"] == flights[2]["digest"]
    replay = shlex.split(alone["scenarios"][0]["flights"][0]["replay"])
    again = CliRunner().invoke(app, [*replay[1:-1], "--fail-on", "expectation"])
    assert again.exit_code == 1, again.output
    (failed,) = [v for v in flights[2]["verdicts"] if v["outcome"] == "failed"]
    assert failed["text"] in again.output


def test_a_replay_goes_on_until_the_failure_is_final(hop, tmp_path):
    """The nearest approach is at the start; the deadline, and the end, come later."""
    arrival = '[[expect]]\nkind = "arrives"\nposition_m = [0.0, -90.0]\n'

    def replay(more, *words):
        out = "--out", tmp_path / "out"
        done = test(hop(arrival + more), "--no-logs", *words, *out)
        return re.search(r"replay +volery run \S+ --seed 1(.*) --page", done.output)[1]

    assert replay("by_s = 1.5\n") == " --seconds 2.5"
    assert replay("") == ""
    assert replay("", "--seconds", 2) == " --seconds 2.0"
    assert replay("by_s = 1.5\n" + FAST.format(limit=0.3)) == " --seconds 2.5"
    always = '[[expect]]\nkind = "formula"\nformula = "always(speed < 0.3 and z < 9)"\n'
    assert 1.0 < float(replay("by_s = 0.5\n" + always).split()[1]) < 3.0


def test_files_of_a_test_are_no_tests(hop, tmp_path):
    hop(FAST.format(limit=0.3), seconds=1.0)
    words = "--vary", "wind=2:4", "--jobs", 1
    first = test(".", *words)
    assert "1 of 1 flight failed" in first.output
    (saved,) = (tmp_path / "runs" / "test").rglob("seed_1.toml")
    assert "1 of 1 flight failed" in test(".", *words).output
    assert "1 of 1 flight failed" in test(saved.parent, "--no-logs", "--out", "x").output
    test("hop.toml", "--no-logs")
    assert not saved.exists()


def test_saved_scenarios_find_the_code_beside_the_test(hop, tmp_path, monkeypatch):
    path = hop('[[expect]]\nkind = "predicate"\nfunction = "own_limits:is_low"\n', name="a/b.toml")
    (tmp_path / "a" / "own_limits.py").write_text(
        "from limits_of_own import LIMIT\n"
        "def is_low(flight):\n"
        "    return LIMIT - float(flight.position_map[:, :, 2].max())\n"
    )
    (tmp_path / "a" / "limits_of_own.py").write_text("LIMIT = 0.5\n")
    vary = "--vary", "wind=0:3", "--trust", "--jobs", 1, "--out", tmp_path / "out"

    def check(replay):
        for name in ("own_limits", "limits_of_own"):
            monkeypatch.delitem(sys.modules, name)
        again = CliRunner().invoke(app, [*shlex.split(replay)[1:-1], "--fail-on", "expectation"])
        assert again.exit_code == 1, again.output
        assert "own_limits:is_low: -" in again.output

    drawn = json.loads(test(path, "--json", *vary).stdout)
    check(drawn["scenarios"][0]["flights"][0]["replay"])
    searched = json.loads(test(path, "--json", "--search", 3, "--sampler", "random", *vary).stdout)
    assert "found.toml" in searched[0]["failure"]["replay"]
    check(searched[0]["failure"]["replay"])


def test_a_shortened_run_leaves_pending_what_may_still_come(hop):
    path = hop('[[expect]]\nkind = "arrives"\nposition_m = [0.0, -90.0]\n' + FAST.format(limit=0.3))
    words = ["run", str(path), "--seconds", "1.5"]
    short = CliRunner().invoke(app, words)
    assert short.exit_code == 0
    assert re.search(r"pending +arrives", short.output)
    assert re.search(r"failed +speed", short.output)
    strict = CliRunner().invoke(app, [*words, "--fail-on", "expectation"])
    assert strict.exit_code == 1
    assert re.search(r"failed +arrives", strict.output)
    assert "failed: arrives" in strict.stderr


def test_a_run_fails_by_an_expectation_that_cannot_be_judged(hop):
    path = hop('[[expect]]\nkind = "speed"\nat_most_m_s = 9.0\nuavs = ["uav7"]\n')
    done = CliRunner().invoke(app, ["run", str(path), "--fail-on", "expectation"])
    assert done.exit_code == 1
    assert "error: speed <= 9 m/s (uav7): " in done.stderr


def test_whole_numbers_are_varied(hop, tmp_path):
    path = hop(seconds=0.1)
    words = "--vary", "uavs[0].count=1:3", "--seeds", 12, "--jobs", 1, "--no-logs", "--json"
    done = test(path, *words)
    assert done.exit_code == 0, done.output
    flights = json.loads(done.stdout)["scenarios"][0]["flights"]
    assert {flight["changes"]["uavs[0].count"] for flight in flights} == {1, 2, 3}


def test_what_a_function_prints_is_not_in_the_json(hop, tmp_path):
    path = hop('[[expect]]\nkind = "predicate"\nfunction = "prints:prints"\n', seconds=0.1)
    (tmp_path / "prints.py").write_text(
        "def prints(flight):\n    print('words')\n    return True\n"
    )
    done = test(path, "--trust", "--json")
    assert json.loads(done.stdout)["passed"]
    assert "words" in done.stderr


def test_a_function_that_exits_fails_its_flight_alone(hop, tmp_path):
    hop('[[expect]]\nkind = "predicate"\nfunction = "exits:exits"\n', seconds=0.1, name="a.toml")
    hop(seconds=0.1, name="b.toml")
    (tmp_path / "exits.py").write_text("import sys\ndef exits(flight):\n    sys.exit(0)\n")
    done = test("a.toml", "b.toml", "--trust", "--no-logs")
    assert done.exit_code == 1
    assert "SystemExit: 0 (exits.py:3)" in done.output
    assert "1 of 2 flights failed" in done.output


def test_a_folder_holds_tests_and_other_files(hop, tmp_path):
    hop(seconds=0.5, name="suite/a.toml")
    hop(FAST.format(limit=0.01), seconds=0.5, name="suite/deep/b.toml")
    hop(name="suite/other.toml").write_text("[tool]\nname = 'x'\n")
    (tmp_path / "suite" / "broken.toml").write_text("= 3")
    done = test(tmp_path / "suite", "--no-logs", "--junit", tmp_path / "new" / "out.xml")
    assert done.exit_code == 1, done.output
    root = ElementTree.parse(tmp_path / "new" / "out.xml").getroot()
    suites = {suite.get("name").rpartition("/")[2]: suite for suite in root}
    assert sorted(suites) == ["a.toml", "b.toml"]
    assert (suites["a.toml"].get("tests"), suites["a.toml"].get("failures")) == ("1", "0")
    assert (suites["b.toml"].get("tests"), suites["b.toml"].get("failures")) == ("2", "1")
    failure = suites["b.toml"].find("testcase/failure")
    assert failure.get("type") == "speed"
    assert "replay  volery run" in failure.text


def test_junit_is_read_by_others(hop, tmp_path):
    junitparser = pytest.importorskip("junitparser")
    path = hop(FAST.format(limit=0.01), seconds=0.5)
    test(
        path, "--seeds", 2, "--no-logs", "--junit", tmp_path / "out.xml", "--out", tmp_path / "out"
    )
    (suite,) = junitparser.JUnitXml.fromfile(str(tmp_path / "out.xml"))
    assert (suite.tests, suite.failures, suite.errors) == (4, 2, 0)
    results = [result for case in suite for result in case.result]
    assert [type(result) for result in results] == [junitparser.Failure] * 2
    assert all("speed <= 0.01 m/s" in result.message for result in results)


def test_a_node_that_fails_is_an_error_of_its_flight(hop, tmp_path):
    (tmp_path / "own_nodes.py").write_text(
        "from volery import Node\n"
        "class Breaks(Node):\n"
        "    def __init__(self, **options):\n"
        "        super().__init__('breaks', **options)\n"
        "        self.create_timer(0.2, self.on_timer)\n"
        "    def on_timer(self):\n"
        "        raise RuntimeError('a <reason>')\n"
    )
    path = hop('[[nodes]]\nnode = "own_nodes:Breaks"\n')
    untrusted = test(path)
    assert untrusted.exit_code == 2
    assert "give --trust" in untrusted.stderr
    junit = tmp_path / "out.xml"
    done = test(path, "--trust", "--no-logs", "--junit", junit, "--out", tmp_path / "out")
    assert done.exit_code == 1, done.output
    assert f"{path}  E  " in done.output
    assert f"volery run {path} --seed 1 --trust --page" in done.output
    assert "a <reason>" in done.output
    case = ElementTree.parse(junit).getroot().find("testsuite/testcase")
    assert "a <reason>" in case.find("error").get("message")


def test_a_search_saves_a_scenario_that_fails(hop, tmp_path):
    pytest.importorskip("optuna")
    path = hop(FAST.format(limit=1.6))  # a take-off reaches 1.4 m/s, in a wind of 14 m/s 1.9
    words = "--vary", "wind=0:14", "--search", 60, "--jobs", 1, "--out", tmp_path / "out"
    done = test(path, *words)
    assert done.exit_code == 1, done.output
    assert re.search(r"a failure after \d+ flights?", done.output)
    (saved,) = re.findall(r"saved +(\S+\.toml)", done.output)
    again = test(saved, "--no-logs", "--json")
    assert again.exit_code == 1
    (flight,) = json.loads(again.stdout)["scenarios"][0]["flights"]
    (failed,) = [v for v in flight["verdicts"] if v["outcome"] == "failed"]
    assert failed["text"] in done.output
    assert failed["margin"] > -0.1  # the wind is hardly stronger than needed
    calm = test(path, "--vary", "wind=0:0.5", "--search", 3, "--json", *words[4:])
    assert calm.exit_code == 0
    (searched,) = json.loads(calm.stdout)
    assert searched["failure"] is None
    margins = [verdict["margin"] for verdict in searched["nearest"]["verdicts"]]
    assert all(margin > 0.0 for margin in margins)


def test_a_search_keeps_what_a_test_keeps(hop, tmp_path):
    path, junit = hop(FAST.format(limit=0.3)), tmp_path / "out.xml"
    words = "--vary", "wind=0:3", "--search", 3, "--sampler", "random", "--jobs", 1
    done = test(path, *words, "--junit", junit, "--out", tmp_path / "out")
    log, image = (re.search(rf"{kind} +(\S+)", done.output)[1] for kind in ("log", "image"))
    from volery.logs import open_log

    assert open_log(log)["/uav1/odom"]["pose.pose.position.z"].max() > 0.5
    info = CliRunner().invoke(app, ["info", log])
    assert re.search(r"passed +no contact: .*\nfailed +speed", info.output)
    assert Path(image).read_bytes().startswith(b"\x89PNG")
    cases = ElementTree.parse(junit).getroot().findall("testsuite/testcase")
    assert [case.find("failure") is None for case in cases] == [True, False]
    path = hop(FAST.format(limit=9.0))
    calm = test(path, *words, "--junit", junit, "--out", tmp_path / "out")
    assert "no failure in 3 flights; nearest to one: seed 1, wind = [" in calm.output
    cases = ElementTree.parse(junit).getroot().findall("testsuite/testcase")
    assert [case.find("failure") is None for case in cases] == [True, True]


def test_a_flight_that_never_ends_is_ended(hop, tmp_path):
    (tmp_path / "endless.py").write_text(
        "from volery import Node\n"
        "class Endless(Node):\n"
        "    def __init__(self, **options):\n"
        "        super().__init__('endless', **options)\n"
        "        self.create_timer(0.5, self.on_timer)\n"
        "    def on_timer(self):\n"
        "        while True:\n"
        "            pass\n"
    )
    path = hop('[[nodes]]\nnode = "endless:Endless"\n')
    done = test(path, "--trust", "--no-logs", "--timeout", 5, "--out", tmp_path / "out")
    assert done.exit_code == 1, done.output
    assert f"{path}  E  " in done.output


BAD = {
    ("hop.toml", "--search", "5"): "--search needs --vary KEY=LOW:HIGH or --seeds N",
    ("nothing",): "no scenario, file or folder 'nothing'",
    ("hovr",): "did you mean 'hover'?",
    ("hop.toml", "--sampler", "random"): "--sampler proposes values for --search, which is not",
    ("hop.toml", "--vary", "wind"): "--vary: KEY=LOW:HIGH, such as wind=0:6, not 'wind'",
    ("hop.toml", "--vary", "wind=3:1"): "3 must be below 1",
    ("hop.toml", "--vary", "wand=1:3"): "--vary wand=1: hop: unknown key 'wand'; did you mean",
    ("hop.toml", "--vary", "wind=0:inf"): "--vary wind=0:inf: the range must be finite",
    ("hop.toml", "--vary", "wind=1:3", "--vary", "wind=0:2"): "'wind' is given more than once",
    ("hop.toml", "--vary", "types.brid.mass_kg=1:2"): "no type 'brid'; did you mean 'bird'?",
    ("hop.toml", "--vary", "seed=1:9"): "--seeds N --first-seed M varies the seed",
    ("empty.toml",): "expects nothing: add [[expect]]",
    ("none",): "no .toml file in this folder has [[expect]]",
    ("broken",): "broken/hop.toml: not valid TOML",
    ("unknown.toml",): "did you mean 'no_contact'?",
    ("hop.toml", "--junit", "none"): "cannot be written",
    ("hop.toml", "--seconds", "0"): "duration_s",
}


@pytest.mark.parametrize("words", BAD, ids=" ".join)
def test_bad_input_is_one_line(hop, tmp_path, words):
    path = hop(seconds=0.1)
    text = path.read_text()
    (tmp_path / "empty.toml").write_text(text[: text.index("[[expect]]")])
    (tmp_path / "unknown.toml").write_text(text.replace("no_contact", "no_contacts"))
    (tmp_path / "none").mkdir()
    hop(name="broken/hop.toml").write_text(text.replace("2.0", "2.0.0"))
    done = test(*words)
    assert done.exit_code == 2, done.output
    assert BAD[words] in done.stderr
    assert done.stderr.count("\n") == 1
