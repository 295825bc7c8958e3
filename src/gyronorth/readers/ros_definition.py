"""Messages of any type, decoded by the definition in .msg form that a bag or an MCAP file holds [1]_, [2]_.

Written out here: the library makes a program of a definition and runs it, which no file from elsewhere should do.

References
----------
.. [1] ROS 2, "Interfaces": fields, arrays, bounds, constants; OMG, "DDS-XTypes" 1.3, section 7.4: plain CDR.
.. [2] ROS, "Serialization and Deserialization Overview": little-endian, nothing padded.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from gyronorth.readers.spellings import is_unit

#: Primitive type -> letter of `struct`.
_PRIMITIVES = {
    "bool": "?", "byte": "B", "char": "B", "float32": "f", "float64": "d", "int8": "b", "uint8": "B", "int16": "h",
    "uint16": "H", "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q",
}  # fmt: skip
#: Types of two numbers that definitions need not hold.
_TIMES = {
    "time": (("sec", "uint32"), ("nanosec", "uint32")), "duration": (("sec", "int32"), ("nanosec", "int32")),
    "builtin_interfaces/Time": (("sec", "int32"), ("nanosec", "uint32")),
    "builtin_interfaces/Duration": (("sec", "int32"), ("nanosec", "uint32")),
}  # fmt: skip
_FIELD = re.compile(r"([A-Za-z][\w/]*)(?:<=\d+)?(?:\[(<=)?(\d*)\])?\s+([A-Za-z]\w*)(?:\s+[^=\s].*)?")
_CONSTANT = re.compile(r"\w+(?:<=\d+)?\s+\w+\s*=(?!=)")
_SECTION = re.compile(r"(?m)^={20,}\s*$")
#: Types within types, fields of a definition, and values of one message that are decoded: more is no sample.
_DEEPEST, _MOST_FIELDS, _MOST_VALUES = 8, 1000, 100_000


class DefinitionError(ValueError):
    """A definition that is not understood, or a message that does not follow it."""


@dataclass(frozen=True)
class _Field:
    name: str  # with its unit, where a comment states one
    kind: str
    length: int | None  # of an array; None: one value, -1: a sequence


def decoder(kind: str, definition: str, *, cdr: bool) -> Callable[[bytes], dict[str, Any]]:
    """What makes an object of names and values of a serialised message.

    Parameters
    ----------
    kind : str
        Type of the message, "package/Name" or "package/msg/Name".
    definition : str
        In .msg form, those of the types in it behind lines of "=" and "MSG: package/Name".
    cdr : bool
        CDR of ROS 2; else the serialisation of ROS 1.

    Raises
    ------
    DefinitionError
        If the definition is not understood. What is returned raises it on a message that does not follow it.
    """
    types = _types(_plain(kind), definition)
    _check(types, _plain(kind), _plain(kind), 0)

    def decode(message: bytes) -> dict[str, Any]:
        try:
            return _Message(bytes(message), types, cdr=cdr).object(_plain(kind))
        except (struct.error, IndexError, UnicodeDecodeError) as error:
            raise DefinitionError(f"it does not follow its definition ({error})") from None

    return decode


def _plain(kind: str) -> str:
    return kind.replace("/msg/", "/")


def _types(kind: str, definition: str) -> dict[str, tuple[_Field, ...]]:
    """The fields of each type in a definition."""
    found = {name: tuple(_Field(*field, None) for field in fields) for name, fields in _TIMES.items()}
    first, *others = _SECTION.split(definition)
    found[kind] = _fields(first)
    for text in others:
        head, _, body = text.strip().partition("\n")
        if not head.startswith("MSG:"):
            raise DefinitionError("a part of its definition does not begin with MSG:")
        found[_plain(head.removeprefix("MSG:").strip())] = _fields(body)
    return found


def _fields(text: str) -> tuple[_Field, ...]:
    fields = []
    for line in text.splitlines():
        stated, _, comment = line.partition("#")
        stated = stated.strip()
        if not stated or _CONSTANT.match(stated):
            continue
        match = _FIELD.fullmatch(stated[:1000])
        if match is None or len(fields) == _MOST_FIELDS:
            raise DefinitionError(f"its definition holds {stated[:40]!r}")
        kind, bounded, length, name = match.groups()
        count = None if length is None else -1 if bounded or not length else int(length)
        fields.append(_Field(f"{name}{_unit(comment)}", kind, count))
    return tuple(fields)


def _unit(comment: str) -> str:
    """The unit that a comment states, in brackets or as all that it says, as " (unit)"; "" where it does not."""
    stated = [*re.findall(r"[\[(]([^\])]{1,20})[\])]", comment[:200]), comment[:40].strip().removeprefix("in ")]
    return next((f" ({text.strip()})" for text in stated if text.strip() and is_unit(text)), "")


def _named(types: dict[str, tuple[_Field, ...]], kind: str, inside: str) -> str:
    """The full name of a type that is written within another."""
    plain = _plain(kind)
    if plain in types:
        return plain
    beside = f"{inside.rpartition('/')[0]}/{plain}"
    found = [beside] if beside in types else [name for name in types if name.endswith(f"/{plain}")]
    if len(found) != 1:
        raise DefinitionError(f"its definition lacks that of {kind}")
    return found[0]


def _check(types: dict[str, tuple[_Field, ...]], kind: str, inside: str, depth: int) -> None:
    if depth > _DEEPEST:
        raise DefinitionError("its definition has types within types without end")
    for field in types[_named(types, kind, inside)]:
        if field.kind not in (*_PRIMITIVES, "string", "wstring"):
            _check(types, field.kind, _named(types, kind, inside), depth + 1)


class _Message:
    """One message that is being decoded."""

    def __init__(self, content: bytes, types: dict[str, tuple[_Field, ...]], *, cdr: bool) -> None:
        self._content, self._types, self._cdr = content, types, cdr
        self._order, self._at, self._values = "<", 0, 0
        if cdr:
            if content[0] != 0 or content[1] not in (0, 1):
                raise DefinitionError(f"its encapsulation is {content[:2].hex()}, which is no plain CDR")
            self._order, self._at = "<" if content[1] else ">", 4

    def object(self, kind: str) -> dict[str, Any]:
        """The fields of a type by name."""
        fields = self._types[kind]
        if not fields and self._cdr:  # an empty type has a byte
            self._at += 1
        return {field.name: self._field(field, kind) for field in fields}

    def _field(self, field: _Field, inside: str) -> Any:
        if field.length is None:
            return self._value(field.kind, inside)
        count = self._number("I") if field.length < 0 else field.length
        self._values += count
        if count > len(self._content) - self._at or self._values > _MOST_VALUES:
            raise DefinitionError(f"{field.name} has {count} values, more than the message can hold")
        return [self._value(field.kind, inside) for _ in range(count)]

    def _value(self, kind: str, inside: str) -> Any:
        if (letter := _PRIMITIVES.get(kind)) is not None:
            return self._number(letter)
        if kind in ("string", "wstring"):
            length = self._number("I")
            text = self._content[self._at : self._at + length]
            self._at += length
            if kind == "wstring" or len(text) < length:
                raise DefinitionError("a text in it is cut off, or of wide letters")
            return text.rstrip(b"\0").decode("utf-8", "replace")
        return self.object(_named(self._types, kind, inside))

    def _number(self, letter: str) -> Any:
        size = struct.calcsize(f"<{letter}")
        if self._cdr:  # counted from behind the encapsulation
            self._at = 4 + -(-(self._at - 4) // size) * size
        (value,) = struct.unpack_from(self._order + letter, self._content, self._at)
        self._at += size
        return value
