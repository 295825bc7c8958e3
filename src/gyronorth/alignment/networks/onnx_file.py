"""What an ONNX file holds, as far as it must be known before ONNX Runtime opens it: whether it names other files.

The wire format of protocol buffers: https://protobuf.dev/programming-guides/encoding/; the fields: onnx.proto3 of
ONNX 1.16 (ModelProto, GraphProto, NodeProto, AttributeProto, TensorProto, SparseTensorProto, FunctionProto).
"""

from __future__ import annotations

from collections.abc import Iterator

#: Message -> field number -> the message that the field holds; other fields are passed over.
_FIELDS = {
    "model": {7: "graph", 20: "training", 25: "function"},
    "training": {1: "graph", 2: "graph"},
    "graph": {1: "node", 5: "tensor", 15: "sparse"},
    "function": {7: "node"},
    "node": {5: "attribute"},
    "attribute": {5: "tensor", 6: "graph", 10: "tensor", 11: "graph", 22: "sparse", 23: "sparse"},
    "sparse": {1: "tensor", 2: "tensor"},
}
#: Of a tensor: entries of a file beside it, and where its data lie (0: in the tensor).
_EXTERNAL, _LOCATION = 13, 14
#: Graphs within graphs that are looked into.
_DEEPEST = 100
#: Fields that are looked at; the networks of the paper have some thousand, and a second is enough for these.
_MOST_FIELDS = 500_000


class DamagedOnnx(ValueError):
    """The file is no protocol buffer of a model."""


def names_other_files(content: bytes) -> bool:
    """Whether a tensor of the model lies outside of its file.

    Raises
    ------
    DamagedOnnx
        If the file cannot be walked through.
    """
    return _external(memoryview(content), "model", 0, iter(range(_MOST_FIELDS)))


def _external(content: memoryview, kind: str, depth: int, left: Iterator[int]) -> bool:
    if depth > _DEEPEST:
        raise DamagedOnnx("graphs within graphs without end")
    for number, value in _fields(content):
        if next(left, None) is None:
            raise DamagedOnnx(f"more than {_MOST_FIELDS} fields")
        if kind == "tensor":
            if number == _EXTERNAL or (number == _LOCATION and value != 0):
                return True
            continue
        inner = _FIELDS[kind].get(number)
        if inner is not None and isinstance(value, memoryview) and _external(value, inner, depth + 1, left):
            return True
    return False


def _fields(content: memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """Number and value of each field: a whole number, or the bytes."""
    place = 0
    while place < len(content):
        key, place = _varint(content, place)
        wire, value = key & 7, 0
        if key < 8:
            raise DamagedOnnx("a field without number")
        if wire == 0:
            value, place = _varint(content, place)
        elif wire in (1, 5):
            place += 8 if wire == 1 else 4
        elif wire == 2:
            size, place = _varint(content, place)
            value, place = content[place : place + size], place + size
        else:
            raise DamagedOnnx(f"a field of wire type {wire}")
        if place > len(content):
            raise DamagedOnnx("it ends within a field")
        yield key >> 3, value


def _varint(content: memoryview, place: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        if place >= len(content):
            raise DamagedOnnx("it ends within a number")
        byte = content[place]
        value, place = value | (byte & 0x7F) << shift, place + 1
        if byte < 0x80:
            return value, place
    raise DamagedOnnx("a number of more than 64 bits")
