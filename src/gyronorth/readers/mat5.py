"""Matrices of numbers in MATLAB files of level 5 (versions 5 to 7).

Written out here since `scipy.io.loadmat` brings the whole process down on some damaged files
(a segmentation fault in its compiled part, scipy 1.17). Only real two-dimensional arrays of
numbers are decoded, alone or as fields of structs; everything else is named and skipped. Sizes are
checked against the file's before anything is allocated.

References
----------
.. [1] MathWorks, "MAT-File Format", 2023: level 5 header (p. 1-6), data elements (1-8),
   arrays (1-15), compressed elements (1-14).
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

#: Table 1-1 of [1]: data types of elements that hold numbers, and the two that hold others.
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_MATRIX, _COMPRESSED = 14, 15
#: Table 1-3 of [1]: array classes.
_CLASSES = {
    1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 6: "double", 7: "single", 8: "int8", 9: "uint8",
    10: "int16", 11: "uint16", 12: "int32", 13: "uint32", 14: "int64", 15: "uint64", 16: "function", 17: "opaque",
}  # fmt: skip
NUMERIC = frozenset(range(6, 16))
#: How the kind of an object begins; its class follows.
OBJECT = "object of class"
_COMPLEX, _LOGICAL = 0x0800, 0x0200
#: Class of tables, timetables and all other objects: what is in them only MATLAB knows.
_OBJECT = 17
_HEADER = 128
#: Bytes of an array that hold its flags, sizes and name; a name has at most 63 characters.
_HEAD = 1024
#: Deflate packs at most 1032 bytes into one (zlib's technical details).
DEFLATE_RATIO = 1032
#: Structs within structs, and fields of one; more is damage.
_DEEPEST, _MOST_FIELDS = 8, 1000
#: The format's own limit on one array, bytes.
_LARGEST = 1 << 31


class MatError(Exception):
    """The file is not what the format asks for; the message says where."""


@dataclass(frozen=True)
class Variable:
    """One array of the file, not yet decoded."""

    name: str
    shape: tuple[int, ...]
    kind: str  # class in words
    numeric: bool  # real numbers
    element: memoryview  # its element, behind the tag; compressed or not
    compressed: bool
    data: int  # where its numbers or fields begin in the (inflated) element


def is_level5(content: bytes) -> bool:
    """Whether the header is that of level 5: version 1 and the endian mark."""
    return len(content) >= _HEADER and content[124:128] in (b"\x00\x01IM", b"\x01\x00MI")


def variables(content: bytes) -> dict[str, Variable]:
    """All named arrays of a level 5 file.

    Raises
    ------
    MatError
        If an element is damaged or cut off.
    """
    order = "<" if content[126:128] == b"IM" else ">"
    found: dict[str, Variable] = {}
    place = _HEADER
    while place + 8 <= len(content):
        kind, size = struct.unpack_from(order + "II", content, place)
        element = memoryview(content)[place + 8 : place + 8 + size]
        if len(element) < size:
            raise MatError(f"the element at byte {place} claims {size} bytes, {len(element)} are left")
        if kind == _COMPRESSED:
            head = _inflated(element, _HEAD)
            if len(head) < 8 or struct.unpack_from(order + "I", head)[0] != _MATRIX:
                raise MatError(f"the element at byte {place} holds no array")
            variable = _described(head[8:], element, order, compressed=True)
        elif kind == _MATRIX:
            variable = _described(bytes(element[:_HEAD]), element, order, compressed=False)
        else:
            raise MatError(f"the element at byte {place} is of type {kind}; an array is expected")
        if variable.name:
            found[variable.name] = variable
        place += 8 + size
    if place != len(content):
        raise MatError(f"{len(content) - place} bytes behind the last element")
    return found


def matrix(content: bytes, variable: Variable) -> NDArray[np.float64]:
    """The numbers of a variable, as float64 of its shape.

    Raises
    ------
    MatError
        If they are damaged, or more or fewer than its shape says.
    """
    order = "<" if content[126:128] == b"IM" else ">"
    count = math.prod(variable.shape)
    if 8 * count > min(_LARGEST, 8 * DEFLATE_RATIO * len(content)):
        raise MatError(f"{variable.name} claims {count} numbers, more than the file can hold")
    element = variable.element
    if variable.compressed:
        element = _whole(variable, order, most=variable.data + 8 * count + 16, what=f"{count} numbers")
    kind, data = next(_elements(element[variable.data :], order), (0, b""))
    if kind not in _TYPES:
        raise MatError(f"the numbers of {variable.name} are of type {kind}")
    dtype = np.dtype(order + _TYPES[kind])
    if len(data) != count * dtype.itemsize:
        raise MatError(f"{variable.name} holds {len(data)} bytes of numbers, {count * dtype.itemsize} are expected")
    with np.errstate(invalid="ignore"):  # a signalling NaN of a damaged file
        return np.frombuffer(data, dtype).reshape(variable.shape, order="F").astype(float)


def fields(content: bytes, variable: Variable, *, most: int, depth: int = 0) -> dict[str, Variable]:
    """The arrays in a struct of one element by their paths, as in imu.gyro, those of structs in it too.

    Parameters
    ----------
    content : bytes
        The file.
    variable : Variable
        The struct.
    most : int
        Bytes that it may hold once inflated.
    depth : int, optional
        Structs around it.

    Raises
    ------
    MatError
        If it is damaged.
    """
    order = "<" if content[126:128] == b"IM" else ">"
    if math.prod(variable.shape) != 1 or depth > _DEEPEST:
        return {}
    element = variable.element
    if variable.compressed:
        element = _whole(variable, order, most=min(most, DEFLATE_RATIO * len(content)), what="a struct")
    (length_kind, length), (names_kind, names), *members = _split(element[variable.data :], order, _MOST_FIELDS + 2)
    if (length_kind, names_kind) != (5, 1) or len(length) != 4:
        raise MatError(f"the fields of {variable.name} are damaged")
    size = struct.unpack(order + "i", length)[0]
    if not 0 < size <= len(names) or len(names) // size != len(members):
        raise MatError(f"{variable.name} has {len(members)} fields, not as many as it names")
    found: dict[str, Variable] = {}
    for i, (kind, member) in enumerate(members):
        title = bytes(names[i * size : (i + 1) * size]).split(b"\x00")[0].decode("ascii", "replace")
        if kind != _MATRIX:
            raise MatError(f"field {title} of {variable.name} is no array")
        if len(member) == 0:
            continue  # an empty one may be written without a header
        field = replace(
            _described(bytes(member[:_HEAD]), member, order, compressed=False), name=f"{variable.name}.{title}"
        )
        found[field.name] = field
        if field.kind == "struct":
            found |= fields(content, field, most=most, depth=depth + 1)
    return found


def _whole(variable: Variable, order: str, *, most: int, what: str) -> memoryview:
    """A compressed element behind its tag, inflated."""
    size = struct.unpack_from(order + "I", _inflated(variable.element, 8), 4)[0]
    if size > most:
        raise MatError(f"{variable.name} claims {size} bytes for {what}")
    return memoryview(_inflated(variable.element, 8 + size, whole=True))[8:]


def _split(content: memoryview, order: str, most: int) -> list[tuple[int, memoryview]]:
    """Type and data of all elements in a row, without copying them."""
    parts: list[tuple[int, memoryview]] = []
    place = 0
    while place + 8 <= len(content) and len(parts) <= most:
        kind, size = struct.unpack_from(order + "II", content, place)
        start, step = place + 8, 8 + -(-size // 8) * 8
        if kind >> 16:
            kind, size, start, step = kind & 0xFFFF, kind >> 16, place + 4, 8
        if start + size > len(content) or (step == 8 and size > 4 and start == place + 4):
            raise MatError("a struct ends within one of its fields")
        parts.append((kind, content[start : start + size]))
        place += step
    if len(parts) < 2:
        raise MatError("a struct ends within its header")
    return parts


def _described(head: bytes, element: memoryview, order: str, *, compressed: bool) -> Variable:
    """Flags, shape and name of an array, from its first bytes."""
    parts = []
    place = 0
    for kind, data in _elements(head, order):
        parts.append((kind, data))
        small = struct.unpack_from(order + "I", head, place)[0] >> 16
        place += 8 if small else 8 + -(-len(data) // 8) * 8
        if len(parts) == 4 and [kind for kind, _ in parts] == [6, 1, 1, 1]:  # flags, name, system, class
            texts = [data.decode("ascii", "replace") for _, data in parts[1:]]
            return Variable(texts[0], (1, 1), f"{OBJECT} {texts[2]}", False, element, compressed, place)
        if len(parts) == 3 and not _is_object(parts, order):
            break
    else:
        raise MatError("an array ends within its header")
    (flags_kind, flags), (shape_kind, sizes), (name_kind, name) = parts
    if (flags_kind, shape_kind, name_kind) != (6, 5, 1) or len(flags) != 8 or len(sizes) % 4 or len(sizes) < 8:
        raise MatError("the header of an array is damaged")
    word = struct.unpack_from(order + "I", flags)[0]
    shape = struct.unpack(f"{order}{len(sizes) // 4}i", sizes)
    if min(shape) < 0:
        raise MatError(f"an array has the shape {shape}")
    array_class = word & 0xFF
    kind = "logical" if word & _LOGICAL else _CLASSES.get(array_class, f"class {array_class}")
    return Variable(
        name=name.decode("ascii", "replace"),
        shape=shape,
        kind=f"complex {kind}" if word & _COMPLEX else kind,
        numeric=array_class in NUMERIC and not word & (_COMPLEX | _LOGICAL),
        element=element,
        compressed=compressed,
        data=place,
    )


def _is_object(parts: list[tuple[int, bytes]], order: str) -> bool:
    """Whether the header of an array begins as that of an object, which has no shape."""
    (kind, flags), (second, _), _ = parts
    return (kind, second, len(flags)) == (6, 1, 8) and struct.unpack_from(order + "I", flags)[0] & 0xFF == _OBJECT


def objects_refused(name: str, objects: Mapping[str, str]) -> str:
    """The message about tables, timetables and other objects of MATLAB: name -> class."""
    listed = ", ".join(f"{title} ({kind})" for title, kind in list(objects.items())[:8])
    tables = [title for title, kind in objects.items() if kind in ("table", "timetable")]
    first = tables[0] if tables else next(iter(objects))
    kind = objects[first]
    if kind == "timetable" and len(tables) > 1:
        cure = f"writetimetable(synchronize({tables[0]}, {tables[1]}, 'first', 'linear'), 'imu.csv'); then read imu.csv"
    elif tables:
        cure = f"write{kind}({first}, 'imu.csv'); then read imu.csv"
    elif kind == "timeseries":
        cure = f"t = {first}.Time; data = {first}.Data; save('imu.mat', 't', 'data', '-v7'); then read imu.mat"
    else:
        cure = "put what is in it into matrices, and save('imu.mat', 'gyro', 'accel', 't', '-v7'); then read imu.mat"
    return f"{name} holds {listed}, which only MATLAB opens. There: load('{name}'); {cure}."


def _elements(content: bytes | memoryview, order: str) -> Iterator[tuple[int, bytes]]:
    """Type and data of the elements in a row, up to one that is cut off."""
    place = 0
    while place + 8 <= len(content):
        kind, size = struct.unpack_from(order + "II", content, place)
        start, step = place + 8, 8 + -(-size // 8) * 8
        if kind >> 16:  # small format: the size in the upper half, at most 4 bytes behind it
            kind, size, start, step = kind & 0xFFFF, kind >> 16, place + 4, 8
            if size > 4:
                return
        if start + size > len(content):
            return
        yield kind, bytes(content[start : start + size])
        place += step


def _inflated(element: memoryview, size: int, *, whole: bool = False) -> bytes:
    """The first `size` bytes of a compressed element, or the `whole` of it with its checksum."""
    stream = zlib.decompressobj()
    try:
        content = stream.decompress(element, size + whole)
    except zlib.error as error:
        raise MatError(f"a compressed array is damaged ({error})") from None
    if whole and not (stream.eof and len(content) == size):
        raise MatError("a compressed array is cut off, or longer than it claims")
    return content
