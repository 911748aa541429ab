"""Tests definition files: shipped, user-defined, and broken ones."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path

import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from volery.core.errors import GraphError
from volery.graph import messages
from volery.graph.codecs.definition_files import (
    find_definition_files,
    parse_definition,
    read_definition_file,
)
from volery.graph.codecs.definition_store import DefinitionStore
from volery.graph.typestore import typestore

SHIPPED = Path(messages.__file__).parent / "definitions"


@pytest.fixture
def store() -> DefinitionStore:
    return DefinitionStore(get_typestore(Stores.ROS2_JAZZY), "nowhere")


def write(folder: Path, **files: str) -> Path:
    """Files by `package__kind__Name`."""
    for key, text in files.items():
        package, kind, name = key.split("__")
        path = folder / package / kind / f"{name}.{kind}"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder


def test_every_shipped_file_loads_and_codes() -> None:
    store = typestore()
    files = find_definition_files(SHIPPED)
    assert len(files) > 90
    for file in files:
        for name in file.names:
            assert store.types[name].__msgtype__ == name  # type: ignore[attr-defined]
            store.get_msgdef(name)
            store.hash_rihs01(name)


def test_shipped_files_are_plain() -> None:
    for file in find_definition_files(SHIPPED):
        text = file.path.read_bytes()
        assert text.isascii()
        assert text.endswith(b"\n")


def test_reader_agrees_with_rosbags() -> None:
    for file in find_definition_files(SHIPPED):
        if file.kind == "msg":
            (ours,) = read_definition_file(file)
            constants, fields = get_types_from_msg(file.path.read_text(), ours.name)[ours.name]
            assert ours.fields == fields
            assert ours.constants == constants


@pytest.mark.parametrize(
    "name",
    [
        "std_srvs/srv/SetBool_Request",
        "mavros_msgs/msg/State",
        "mavros_msgs/srv/CommandTOL_Response",
        "octomap_msgs/msg/OctomapWithPose",
        "simulation_interfaces/srv/SpawnEntity_Request",
        "simulation_interfaces/action/SimulateSteps_Goal",
        "simulation_interfaces/action/SimulateSteps_SendGoal_Request",
        "simulation_interfaces/action/SimulateSteps_GetResult_Response",
        "rosapi_msgs/srv/MessageDetails_Response",
        "action_msgs/srv/CancelGoal_Request",
    ],
)
def test_types_load_on_demand(name: str) -> None:
    assert messages.message_type(name).__msgtype__ == name
    assert name in typestore().names()


def test_type_hash_of_a_standard_service_part() -> None:
    """The same definition gives the same hash in another type store."""
    ours = typestore().hash_rihs01("mavros_msgs/msg/ParamValue")
    other = get_typestore(Stores.ROS2_JAZZY)
    other.register(get_types_from_msg("int64 integer\nfloat64 real", "mavros_msgs/msg/ParamValue"))
    assert ours == other.hash_rihs01("mavros_msgs/msg/ParamValue")


def test_action_messages() -> None:
    fields = typestore().fielddefs
    base = "simulation_interfaces/action/SimulateSteps"
    assert [name for name, _ in fields[f"{base}_Goal"][1]] == ["steps"]
    assert fields[f"{base}_SendGoal_Request"][1] == [
        ("goal_id", (Nodetype.NAME, "unique_identifier_msgs/msg/UUID")),
        ("goal", (Nodetype.NAME, f"{base}_Goal")),
    ]
    assert [name for name, _ in fields[f"{base}_SendGoal_Response"][1]] == ["accepted", "stamp"]
    assert [name for name, _ in fields[f"{base}_GetResult_Response"][1]] == ["status", "result"]
    assert [name for name, _ in fields[f"{base}_FeedbackMessage"][1]] == ["goal_id", "feedback"]


def test_messages_of_files_can_be_pickled() -> None:
    message = messages.message_type("std_srvs/srv/SetBool_Response")(True, "on")
    assert pickle.loads(pickle.dumps(message)) == message


def test_unknown_names() -> None:
    with pytest.raises(KeyError):
        messages.message_type("std_srvs/srv/Nothing_Request")
    with pytest.raises(AttributeError):
        messages.std_srvs__srv__Nothing  # noqa: B018
    assert "std_srvs/srv/Nothing" not in typestore().types


def test_import_reads_no_definition_file() -> None:
    """What start-up pays for is what it uses."""
    code = (
        "import volery.graph.messages\n"
        "from volery.graph.typestore import typestore\n"
        "loaded = [n for n in dict.keys(typestore().types) if n.startswith('mavros')]\n"
        "assert not loaded, loaded\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_own_folder(tmp_path: Path, store: DefinitionStore) -> None:
    folder = write(
        tmp_path,
        farm_msgs__msg__Crop=(
            "# what grows\n"
            "uint8 MAIZE=1 # a comment\n"
            "string NAME=maize # all of it\n"
            "string QUOTED='a # b'\n"
            "float32 HALF = 0.5\n"
            "int32 MASK=0x10\n"
            "Header header\n"
            "time planted\n"
            "string<=8 kind 'corn'\n"
            "float64[<=3] heights [1.0, 2.5]\n"
            "geometry_msgs/Point[2] corners\n"
            "Row[] rows\n"
            "bool ripe true\n"
            "uint64 count 3\n"
            "float64 from\n"
        ),
        farm_msgs__msg__Row="float32[4] seeds\n",
        farm_msgs__srv__Harvest="farm_msgs/msg/Crop crop\n---\nbool done\n",
        farm_msgs__action__Sow="Crop crop\n---\nbool done\n---\nfloat32 part\n",
    )
    names = store.add_folder(folder)
    assert len(names) == 2 + 2 + 8
    crop = "farm_msgs/msg/Crop"
    constants, fields = store.fielddefs[crop]
    assert {name: value for name, _, value in constants} == {
        "MAIZE": 1,
        "NAME": "maize # all of it",
        "QUOTED": "a # b",
        "HALF": 0.5,
        "MASK": 16,
    }
    assert store.constant_text(crop, "MASK") == "0x10"
    assert dict(fields)["header"] == (Nodetype.NAME, "std_msgs/msg/Header")
    assert dict(fields)["planted"] == (Nodetype.NAME, "builtin_interfaces/msg/Time")
    assert dict(fields)["kind"] == (Nodetype.BASE, ("string", 8))
    assert dict(fields)["corners"][1] == ((Nodetype.NAME, "geometry_msgs/msg/Point"), 2)
    assert store.default_of(crop, "heights") == [1.0, 2.5]
    assert store.default_of(crop, "kind") == "corn"
    assert store.default_of(crop, "ripe") is True
    assert store.default_of(crop, "from") is None
    assert store.add_folder(folder) == names  # a second time changes nothing


def test_flat_folder_and_workspace(tmp_path: Path, store: DefinitionStore) -> None:
    (tmp_path / "src" / "farm").mkdir(parents=True)
    (tmp_path / "src" / "farm" / "Row.msg").write_text("float32 seeds")
    (tmp_path / "README.txt").write_text("not a definition")
    assert store.add_folder(tmp_path) == ["farm/msg/Row"]


BROKEN = {
    "cannot read 'float32'": "float32\n",
    "'b c=' is not a float32": "float32 a b c=\n",
    "unknown type 'farm/msg/Nothing'": "\nNothing n\n",
    "unknown type 'other/msg/Nothing'": "\nother/Nothing n\n",
    "'a' is defined twice": "int8 a\nint8 a\n",
    "300 does not fit uint8": "\nuint8 X=300\n",
    "'x' is not a int8": "\nint8 X=x\n",
    "wstring is not supported": "\nwstring w\n",
    "fixed array": "\nint8[0] w\n",
    "fixed array of float64": "\nfloat64[99999999999] w\n",
    "only a string may have a length limit": "\nint8<=3 w\n",
    "must be a number, a bool or a string": "\nint8[] X=3\n",
    "cannot have a default": "\ngeometry_msgs/Point p 3\n",
    "the default of an array must be a list": "\nint8[] p 3\n",
    "the default has 1 element, the array 2": "\nint8[2] p [3]\n",
    "not the name of a type": "\na/b/c/d p\n",
}


@pytest.mark.parametrize("text", BROKEN)
def test_broken_definitions_name_file_and_line(
    tmp_path: Path, store: DefinitionStore, text: str
) -> None:
    folder = write(tmp_path, farm__msg__Broken=BROKEN[text], farm__msg__Whole="int8 a\n")
    with pytest.raises(GraphError, match=r"Broken\.msg:[12]: ") as error:
        store.add_folder(folder)
    assert text in str(error.value)
    assert "farm/msg/Whole" not in store.types  # all or none


@pytest.mark.parametrize(
    ("files", "text"),
    [
        ({"farm__srv__S": "int8 a\n"}, "1 line"),
        ({"farm__srv__S": "---\n---\n"}, r"S\.srv:2: .*1 line '---'; this line is one too many"),
        ({"farm__action__A": "---\n"}, "2 line"),
        ({"farm__msg__A": "B b\n", "farm__msg__B": "A[] a\n"}, "contains itself"),
        ({"std_msgs__msg__String": "int8 data\n"}, "already known with other fields"),
        ({"far-m__msg__A": "int8 a\n"}, "name of a ROS package"),
        ({"farm__msg__A-B": "int8 a\n"}, "name of a ROS type"),
    ],
)
def test_folders_that_do_not_fit(
    tmp_path: Path, store: DefinitionStore, files: dict[str, str], text: str
) -> None:
    with pytest.raises(GraphError, match=text):
        store.add_folder(write(tmp_path, **files))


def test_duplicates_in_one_folder(tmp_path: Path, store: DefinitionStore) -> None:
    write(tmp_path / "a", farm__msg__A="int8 a\n")
    write(tmp_path / "b", farm__msg__A="int8 a\n")
    with pytest.raises(GraphError, match=r"is also defined in "):
        store.add_folder(tmp_path)


def test_missing_empty_and_misplaced(tmp_path: Path, store: DefinitionStore) -> None:
    with pytest.raises(GraphError, match="does not exist"):
        store.add_folder(tmp_path / "none")
    with pytest.raises(GraphError, match=r"contains no \.msg"):
        store.add_folder(tmp_path)
    (tmp_path / "farm" / "msg").mkdir(parents=True)
    (tmp_path / "farm" / "msg" / "S.srv").write_text("---")
    with pytest.raises(GraphError, match=r"belongs in a folder srv/"):
        store.add_folder(tmp_path)
    (tmp_path / "farm" / "msg" / "S.srv").rename(tmp_path / "farm" / "msg" / "S.msg")
    (tmp_path / "farm" / "msg" / "S.msg").write_bytes(b"\xff")
    with pytest.raises(GraphError, match="not UTF-8"):
        store.add_folder(tmp_path)


def test_ros1_and_ros2_spellings_of_nested_types() -> None:
    (ours,) = parse_definition(
        "farm/Row a\nfarm/msg/Row b\nRow c\nduration[] d\n", "farm/msg/A", "A.msg"
    )
    assert [described for _, described in ours.fields[:3]] == [(Nodetype.NAME, "farm/msg/Row")] * 3
    assert ours.nested[3] == ("builtin_interfaces/msg/Duration", 4)
