"""Tests the names that installed packages register."""

import pytest

from volery.core.entry_points import EntryPoints


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Installs a package that registers names in group `volery.tests`."""

    def add(package, **points):
        info = tmp_path / f"{package}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        lines = "".join(f"{name} = {target}\n" for name, target in points.items())
        (info / "entry_points.txt").write_text("[volery.tests]\n" + lines)

    monkeypatch.syspath_prepend(str(tmp_path))
    return add


def test_names_of_all_packages_are_found(install):
    install("birds", robin="birds.small:Robin")
    install("trees", ash="trees:Ash")
    points = EntryPoints("volery.tests")
    assert points.names() == ["ash", "robin"]
    assert points.find("robin") == "birds.small:Robin"
    assert points.find("oak") is None


@pytest.mark.parametrize("package", ["aaa", "zzz"])
def test_no_other_package_takes_a_name_of_volery(install, package):
    install("mmm", slam="volery.autonomy.slam:Slam")
    install(package, slam="evil:Slam")
    assert EntryPoints("volery.tests").find("slam") == "volery.autonomy.slam:Slam"


def test_the_package_of_a_name_is_known(install):
    install("birds", robin="birds.small:Robin")
    points = EntryPoints("volery.tests")
    assert (points.package("robin"), points.package("oak")) == ("birds", "")


@pytest.mark.parametrize("damage", [b"robin\n", b"\xff = a:b\n"])
def test_a_package_with_damaged_metadata_does_not_break_others(install, tmp_path, caplog, damage):
    install("aaa")
    (tmp_path / "aaa-1.0.dist-info" / "entry_points.txt").write_bytes(b"[volery.tests]\n" + damage)
    install("birds", robin="birds.small:Robin")
    assert EntryPoints("volery.tests").names() == ["robin"]
    assert "package aaa: its entry points cannot be read" in caplog.text
