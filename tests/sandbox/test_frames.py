"""The parser of results: what is well formed comes through unchanged, and nothing else does."""

import struct
import tracemalloc

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from grader.domain.run import RunStatus
from grader.sandbox.frames import KINDS, MalformedMessage, Message, parse_message
from grader.sandbox.policy import NAME_CHARS_MAX, NDIM_MAX, RESULT_ARRAYS_MAX

CODES = {"float64": b"d", "float32": b"f", "int64": b"q", "int32": b"i", "uint8": b"B", "bool": b"?"}
Arrays = dict[str, NDArray[np.generic]]


def encode(arrays: Arrays, kind: int = 0, reason: bytes = b"") -> bytes:
    """The writer, once more and on its own, from the description at the top of frames.py."""
    data = b""
    for name, array in arrays.items():
        data += b"A" + bytes([len(name)]) + name.encode() + CODES[array.dtype.name] + bytes([array.ndim])
        data += struct.pack(f"<{array.ndim}I", *array.shape) + struct.pack("<I", array.nbytes) + array.tobytes()
    return data + b"E" + struct.pack("<BH", kind, len(reason)) + reason


def decode_again(message: Message) -> bytes:
    """Only what parsed completely can be written again to the same bytes."""
    assert message.end is not None
    return encode(dict(message.results), KINDS.index(message.end), message.reason.encode())


names = st.from_regex(r"\A[a-zA-Z_][a-zA-Z0-9_]{0,31}\Z")
dtypes = st.sampled_from(sorted(CODES))
arrays = dtypes.flatmap(
    lambda name: hnp.arrays(
        np.dtype(name),
        hnp.array_shapes(min_dims=0, max_dims=NDIM_MAX, min_side=0, max_side=4),
        elements={"allow_nan": False, "allow_infinity": False} if name.startswith("float") else None,
    )
)
messages = st.dictionaries(names, arrays, max_size=5)


@given(messages, st.integers(0, len(KINDS) - 1), st.text(max_size=50))
def test_what_is_well_formed_comes_back_bit_for_bit(sent: Arrays, kind: int, reason: str) -> None:
    message = parse_message(encode(sent, kind, reason.encode()))
    assert (message.end, message.reason) == (KINDS[kind], reason)
    assert list(message.results) == list(sent)
    for name, array in sent.items():
        got = message.results[name]
        assert (got.dtype, got.shape, got.tobytes()) == (array.dtype, array.shape, array.tobytes())
        assert not got.flags.writeable


@settings(max_examples=500)
@given(st.binary(max_size=200))
@example(b"")
@example(b"E\x00\x00\x00")
def test_random_bytes_are_refused_or_are_exactly_a_message(data: bytes) -> None:
    try:
        message = parse_message(data)
    except MalformedMessage:
        return
    if message.end is not None and "\ufffd" not in message.reason:
        assert decode_again(message) == data


@given(messages, st.data())
def test_a_changed_byte_is_refused_or_still_exactly_a_message(sent: Arrays, data: st.DataObject) -> None:
    whole = bytearray(encode(sent))
    at = data.draw(st.integers(0, len(whole) - 1))
    whole[at] = data.draw(st.integers(0, 255))
    test_random_bytes_are_refused_or_are_exactly_a_message.hypothesis.inner_test(bytes(whole))  # type: ignore[attr-defined]


@given(messages, st.data())
def test_what_is_cut_short_has_no_end(sent: Arrays, data: st.DataObject) -> None:
    whole = encode(sent, reason=b"because")
    cut = whole[: data.draw(st.integers(0, len(whole) - 1))]
    try:
        assert parse_message(cut).end is None
    except MalformedMessage as error:
        assert "cut short" in str(error)


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"X", "form"),
        (encode({"x": np.zeros(1)}) + b"A", "end"),
        (encode({}, kind=len(KINDS)), "end"),
        (encode({"x": np.zeros(1)})[:-4] + encode({"x": np.zeros(1)}), "twice"),
        (encode({"x": np.array([np.nan])}), "not finite"),
        (encode({"x": np.array([np.inf], np.float32)}), "not finite"),
        (encode({"1x": np.zeros(1)}), "name"),
        (encode({"x" * (NAME_CHARS_MAX + 1): np.zeros(1)}), "name"),
        (encode({f"x{n}": np.zeros(0) for n in range(RESULT_ARRAYS_MAX + 1)}), "more than"),
        (b"A\x01xd\x05" + bytes(24), "dimensions"),
        (b"A\x01xO\x00" + bytes(12), "type"),
        (b"A\x01x?\x00\x01\x00\x00\x00\x07", "neither true nor false"),
        (b"A\x01xd\x01\x02\x00\x00\x00\x08\x00\x00\x00" + bytes(8), "does not fit"),
    ],
)
def test_each_rule_has_its_sentence(data: bytes, why: str) -> None:
    with pytest.raises(MalformedMessage, match=why):
        parse_message(data)


def test_a_shape_beyond_all_measure_takes_no_memory() -> None:
    data = b"A\x01xd\x04" + b"\xff" * 16 + b"\xff" * 4
    tracemalloc.start()
    try:
        for _ in range(100):
            with pytest.raises(MalformedMessage):
                parse_message(data)
        assert tracemalloc.get_traced_memory()[1] < 200_000
    finally:
        tracemalloc.stop()


def test_an_end_alone_is_a_message() -> None:
    assert parse_message(b"E\x00\x00\x00") == Message({}, {}, RunStatus.RETURNED, "")
