"""Errors of TOML say what is often meant."""

import tomllib

import pytest

from volery.core.toml_text import parse_toml


@pytest.mark.parametrize(
    ("text", "advice"),
    [
        (
            "name: forest\nuavs:\n  - type: f450\n",
            "line 1, column 5): this looks like YAML; TOML has",
        ),
        ("---\nname: forest\n", "looks like YAML"),
        ('{\n  "name": "forest"\n}', "looks like JSON"),
        ("a = 1\nnoise = True\n", "line 2, column 9): write true or false"),
        ("noise = yes", "write true or false"),
        ("height_m = None", "TOML has no such value; leave the key out"),
        ("height_m = .5", "digits on both sides of its point"),
        ("height_m = 5.\n", "digits on both sides of its point"),
        ("name = forest", "a text is in quotes"),
        ('file = "sub\\mesh.stl"', "write / in paths"),
    ],
)
def test_a_usual_error_has_advice(text, advice):
    with pytest.raises(tomllib.TOMLDecodeError) as caught:
        parse_toml(text)
    assert advice in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["a = [1, 2", "[b\n", "a = 'x\n", 'a = "x" b = 3', "= 3", "\0"])
def test_other_errors_have_none(text):
    with pytest.raises(tomllib.TOMLDecodeError) as caught:
        parse_toml(text)
    assert str(caught.value).endswith(")")
