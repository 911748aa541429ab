"""What is said before a recording of images."""

from volery.cli.record_size import warn_of_size

RATES = {"/uav1/front/depth": 12e6, "/uav1/front/image_raw/compressed": 1.5e6, "/b": 10.0}


def test_images_that_fill_a_disk_are_warned_of(capsys):
    warn_of_size(RATES, lambda _: True)
    said = capsys.readouterr().err
    assert "about 810 MB per minute" in said
    assert "/uav1/front/depth 720, /uav1/front/image_raw/compressed 90" in said
    assert "--exclude '/uav1/front/depth'" in said


def test_few_bytes_are_not(capsys):
    warn_of_size(RATES, lambda topic: topic != "/uav1/front/depth")
    assert capsys.readouterr().err == ""
