"""Where rospy is looked for, and what is said where there is none."""

from __future__ import annotations

import importlib.util
import sys

import pytest

from volery.bridges.ros1 import environment as ros1_environment
from volery.bridges.ros1.master import Ros1Master
from volery.bridges.ros1.node import _check_master
from volery.bridges.shared_names import SharedNames
from volery.core.errors import BridgeError, UnreachableError


@pytest.fixture
def elsewhere(monkeypatch, tmp_path):
    """A folder instead of Debian's, for an environment without rospy."""
    monkeypatch.setattr(ros1_environment, "_DEBIAN", tmp_path)
    monkeypatch.setenv("ROS_DISTRO", "none_such")
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    for name in ("rospy", "rosgraph", "rosgraph.network", "netifaces"):
        monkeypatch.setitem(sys.modules, name, None)  # comes back, whatever a test imports
        del sys.modules[name]
    return tmp_path


def package(folder, name, text=""):
    (folder / name).mkdir()
    (folder / name / "__init__.py").write_text(text)
    return folder / name


def test_what_to_install_is_said(elsewhere, monkeypatch):
    monkeypatch.setitem(sys.modules, "rospy", None)
    assert not ros1_environment.rospy_is_installed()
    with pytest.raises(BridgeError, match=r"apt-get install .*python3-rospy"):
        ros1_environment._load.__wrapped__()


def test_debians_folder_is_on_the_path_only_while_rospy_is_imported(elsewhere):
    package(elsewhere, "rospy", "import sys\nPATH = list(sys.path)\nimport numpy\n")
    (package(elsewhere, "rosgraph") / "network.py").write_text("")
    assert ros1_environment.rospy_is_installed()
    loaded = ros1_environment._load.__wrapped__()
    assert loaded.PATH[-1] == str(elsewhere)
    assert str(elsewhere) not in sys.path


def test_a_master_may_come_later():
    """So that nodes in processes of their own wait for it."""
    with pytest.raises(UnreachableError, match="no ROS master answers at"):
        _check_master(Ros1Master("http://127.0.0.1:9", "/node"))


def test_which_topics_are_taken_from_ros1():
    sharing = SharedNames(("/uav*", "/clock", "/rosout"), ("*/cmd_vel",))
    assert sharing.has("/uav1/odom")
    assert not sharing.has("/rosout")
    assert not sharing.has("/private")
    assert sharing.takes("/uav1/image", publishers=0, subscribers=1)
    assert not sharing.takes("/uav1/image", publishers=0, subscribers=0)
    assert not sharing.takes("/uav1/odom", publishers=1, subscribers=2)
    assert sharing.takes("/uav1/cmd_vel", publishers=1, subscribers=1)


def test_what_rosgraph_imports_later_is_imported_with_rospy(elsewhere):
    """Debian's folder is off the path when a node with ROS_HOSTNAME=localhost first connects."""
    package(elsewhere, "rospy")
    netifaces = package(elsewhere, "netifaces")
    ros1_environment._load.__wrapped__()
    assert sys.modules["netifaces"].__file__ == str(netifaces / "__init__.py")


def test_rosgraph_does_without_netifaces(elsewhere, monkeypatch):
    package(elsewhere, "rospy")
    network = package(elsewhere, "rosgraph") / "network.py"
    network.write_text("get_local_addresses = None\n")
    monkeypatch.setitem(sys.modules, "netifaces", None)
    ros1_environment._load.__wrapped__()
    assert "127.0.0.1" in sys.modules["rosgraph.network"].get_local_addresses()
