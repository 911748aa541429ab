"""Packages of Volery's message types, as colcon builds them."""

import re
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from volery.cli.app import app
from volery.core.errors import GraphError
from volery.graph.interface_packages import DEFINITIONS, needs, packages, write_package


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
    with pytest.raises(GraphError, match="exists already"):
        write_package("std_srvs", tmp_path)
    write_package("std_srvs", tmp_path, overwrite=True)
    assert not (folder / "msg").exists()
    (tmp_path / "tf2_msgs").mkdir()
    (tmp_path / "tf2_msgs" / "precious").touch()
    with pytest.raises(GraphError, match="no package that could be replaced"):
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
