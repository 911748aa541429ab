"""Message packages that a scenario names."""

from __future__ import annotations

import pytest

from volery.core.errors import ScenarioError
from volery.graph.messages import message_type
from volery.runtime.construction.start_check import learn_messages
from volery.scenario.access import ScenarioAccess
from volery.scenario.load import load_scenario


@pytest.fixture
def scenario(tmp_path):
    """A function that makes a scenario with folders of messages."""

    def make(*folders):
        made = load_scenario("hover").model_copy(update={"message_packages": folders})
        return made.with_access(ScenarioAccess(tmp_path))

    return make


def test_types_of_a_folder_are_known(scenario, tmp_path):
    package = tmp_path / "packages" / "lab_msgs"
    (package / "msg").mkdir(parents=True)
    (package / "srv").mkdir()
    (package / "msg" / "Level.msg").write_text("std_msgs/Header header\nfloat64 level_m\n")
    (package / "srv" / "Fill.srv").write_text("Level wanted\n---\nbool done\n")
    learned = learn_messages(scenario("packages"))
    assert learned == [
        "lab_msgs/msg/Level",
        "lab_msgs/srv/Fill_Request",
        "lab_msgs/srv/Fill_Response",
    ]
    assert message_type("lab_msgs/srv/Fill_Response")(True).done
    assert learn_messages(scenario("packages")) == learned  # again: nothing is wrong with that


def test_a_folder_that_is_not_there_is_named(scenario):
    with pytest.raises(ScenarioError, match=r"hover: message_packages\[0\]: no folder 'none'"):
        learn_messages(scenario("none"))


def test_a_broken_definition_is_named_with_its_line(scenario, tmp_path):
    (tmp_path / "bad_msgs" / "msg").mkdir(parents=True)
    (tmp_path / "bad_msgs" / "msg" / "X.msg").write_text("int32 a\nno_such/Type b\n")
    with pytest.raises(ScenarioError, match=r"message_packages\[0\]: .*X\.msg:2: unknown type"):
        learn_messages(scenario("bad_msgs"))
