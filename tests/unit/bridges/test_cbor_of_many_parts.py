"""Lists of many message parts are encoded in C, with the values of the encoder in Python."""

import math

import cbor2
import numpy as np
import pytest

from volery.bridges.rosbridge import cbor_codec
from volery.bridges.rosbridge.cbor_codec import decode_cbor, encode_cbor
from volery.core.errors import BridgeError


def parts(count, **more):
    return [
        {
            "name": f"uav{k}",
            "mode": "HÖLD",
            "age": -k,
            "battery": k / 7,
            "flies": k % 2 == 0,
            **more,
        }
        for k in range(count)
    ]


def in_python(value, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(cbor_codec, "_MANY", math.inf)
        return encode_cbor(value)


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"position": {"x": math.nan, "y": -0.0, "z": math.inf}},
        {"big": 2**63, "small": -(2**63), "none": None, "empty": [], "pair": (1, "a")},
        {"data": b"\x00\xff"},
        {"lone": "\ud800"},
        {"values": np.arange(4.0)},
        {"nested": parts(40)},
    ],
)
def test_values_are_the_same(more, monkeypatch):
    value = {"op": "publish", "msg": {"vehicles": parts(64, **more)}}
    data = encode_cbor(value)
    # NaN and infinities are shorter; a NaN equals none, so that texts are compared
    assert repr(decode_cbor(data)) == repr(decode_cbor(in_python(value, monkeypatch)))
    assert len(decode_cbor(data)["msg"]["vehicles"]) == 64


def test_c_encodes_them(monkeypatch):
    encoded = []
    dumps = cbor2.dumps
    monkeypatch.setattr(cbor_codec.cbor2, "dumps", lambda v: encoded.append(len(v)) or dumps(v))
    encode_cbor({"few": parts(31), "many": parts(32), "numbers": list(range(64))})
    assert encoded == [32]


def test_what_has_no_cbor_is_refused_as_ever():
    with pytest.raises(BridgeError, match="object"):
        encode_cbor({"vehicles": parts(64, unknown=object())})
