"""Tests the packages of Volery's message types for colcon."""

import re
from xml.etree import ElementTree

import pytest
from rosbags.typesys import Stores, get_typestore
from typer.testing import CliRunner

from volery.cli.app import app
from volery.core.errors import GraphError
from volery.graph.codecs import ros1_package
from volery.graph.codecs.definition_files import find_definition_files
from volery.graph.codecs.definition_store import DefinitionStore
from volery.graph.codecs.interface_packages import DEFINITIONS, needs, packages, write_package
from volery.graph.codecs.ros1 import Ros1Codec, ros1_codec


def test_the_package_is_whole(tmp_path):
    folder = write_package("volery_interfaces", tmp_path)
    root = ElementTree.parse(folder / "package.xml").getroot()
    assert root.findtext("name") == "volery_interfaces"
    assert root.findtext("license") == "Apache-2.0"
    assert re.fullmatch(r"\d+\.\d+\.\d+", root.findtext("version"))
    assert root.findtext("member_of_group") == "rosidl_interface_packages"
    depends = [element.text for element in root.findall("depend")]
    assert depends == ["builtin_interfaces", "geometry_msgs", "mavros_msgs", "std_msgs"]
    build = (folder / "CMakeLists.txt").read_text()
    listed = re.findall(r'"((?:msg|srv|action)/\w+\.\w+)"', build)
    there = {str(path.relative_to(folder)) for path in folder.glob("*/*")}
    assert set(listed) == there
    assert len(listed) == len(there)
    for name in depends:
        assert f"find_package({name} REQUIRED)" in build
    for name in there:
        ours = DEFINITIONS / "volery_interfaces" / name
        assert (folder / name).read_bytes() == ours.read_bytes()


def test_every_package_names_what_it_needs():
    found = {name: needs(name) for name in packages()}
    assert found["std_srvs"] == []
    assert "action_msgs" in found["simulation_interfaces"]
    assert all(name not in others for name, others in found.items())


def test_older_packages_are_replaced_only_when_asked(tmp_path):
    folder = write_package("std_srvs", tmp_path)
    (folder / "msg").mkdir()
    with pytest.raises(GraphError, match="already exists"):
        write_package("std_srvs", tmp_path)
    write_package("std_srvs", tmp_path, overwrite=True)
    assert not (folder / "msg").exists()
    (tmp_path / "tf2_msgs").mkdir()
    (tmp_path / "tf2_msgs" / "precious").touch()
    with pytest.raises(GraphError, match="is not a package"):
        write_package("tf2_msgs", tmp_path, overwrite=True)
    with pytest.raises(GraphError, match="no package 'nonsense'"):
        write_package("nonsense", tmp_path)


def test_the_command_says_what_is_needed(tmp_path):
    invoke = CliRunner().invoke
    result = invoke(app, ["interfaces", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert "needs   builtin_interfaces, geometry_msgs, mavros_msgs, std_msgs" in result.output
    assert "lacks mavros_msgs" in result.output
    result = invoke(app, ["interfaces", str(tmp_path / "missing")])
    assert result.exit_code == 2
    assert "mkdir -p" in result.output


def test_a_package_for_ros1_is_whole(tmp_path):
    folder = write_package("volery_interfaces", tmp_path, ros1=True)
    root = ElementTree.parse(folder / "package.xml").getroot()
    assert root.get("format") == "2"
    assert root.findtext("buildtool_depend") == "catkin"
    depends = [element.text for element in root.findall("depend")]
    assert depends == ["geometry_msgs", "mavros_msgs", "std_msgs"]
    build = (folder / "CMakeLists.txt").read_text()
    assert "generate_messages(DEPENDENCIES geometry_msgs mavros_msgs std_msgs)" in build
    there = {path.name for path in folder.glob("*/*")}
    assert set(re.findall(r"^  (\w+\.\w+)$", build, re.MULTILINE)) == there
    assert there == {path.name for path in (DEFINITIONS / "volery_interfaces").glob("*/*")}


def test_definitions_are_spelled_as_in_ros1(tmp_path):
    (tmp_path / "farm" / "srv").mkdir(parents=True)
    path = tmp_path / "farm" / "srv" / "Feed.srv"
    path.write_text(
        "# Of the feeding.\nbuiltin_interfaces/Time stamp\nstring<=10 name\n"
        "uint8 CORN=3  # yellow\n"
        "\nfloat64[<=4] weights [1.0]  # kg\nbool whole true\n---\n# Of the end.\n"
        "std_msgs/Header header\n"
    )
    store = DefinitionStore(get_typestore(Stores.ROS2_JAZZY), "nowhere")
    store.add_folder(tmp_path)
    text = ros1_package.definition(find_definition_files(tmp_path)[0], Ros1Codec(store))
    assert text == (
        "# Of the feeding.\ntime stamp\nstring name\nuint8 CORN=3\n"
        "\nfloat64[] weights\nbool whole\n---\n# Of the end.\nstd_msgs/Header header\n"
    )


@pytest.mark.parametrize("package", ["volery_interfaces", "simulation_interfaces", "std_srvs"])
def test_definitions_of_ros1_mean_the_same(tmp_path, package):
    """Read again as files of the user's own they have the sums that the bridge sends."""
    codec = ros1_codec()
    write_package(package, tmp_path, ros1=True)
    for file in find_definition_files(tmp_path / package):
        lines = file.path.read_text().splitlines()
        own = [line for line in lines if line and not line.startswith("#")]
        wanted = codec.own_definition_text(file.base).splitlines()
        assert sorted(own) == sorted(wanted)


def test_packages_of_ros2_alone_are_refused_for_ros1(tmp_path):
    with pytest.raises(GraphError, match="only in ROS 2"):
        write_package("rcl_interfaces", tmp_path, ros1=True)


def test_the_command_for_ros1_names_the_next_step(tmp_path):
    result = CliRunner().invoke(app, ["interfaces", str(tmp_path), "--ros1"])
    assert result.exit_code == 0, result.output
    assert "needs   geometry_msgs, mavros_msgs, std_msgs" in result.output
    assert f"python3 {tmp_path / 'generate_python.py'}" in result.output.replace("\n", "")
    assert (tmp_path / "generate_python.py").read_text() == ros1_package.GENERATOR.read_text()
