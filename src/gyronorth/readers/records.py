"""Texts that are no table but would be one: each line a JSON object, names with their values, or a list in brackets.

They are written anew as a table with titles, which is then read as any other text is. The native files of Android's
GnssLogger, which state the fields of each kind of row in comments, are among them.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator
from pathlib import Path

from gyronorth.errors import InputError
from gyronorth.readers.cells import rewriting_of_cells
from gyronorth.readers.json_table import of_array, of_objects, of_one_object
from gyronorth.readers.lines import COLOUR, COLOURS, NUMBER, pieces_of, spooled
from gyronorth.readers.phones import rewriting_of_parts
from gyronorth.readers.sentences import rewriting_of
from gyronorth.readers.spool import Spooled
from gyronorth.readers.tidy import rewriting_of_tidy
from gyronorth.readers.worded import rewriting_of_words

#: Lines that are looked at, fewest numbers in one, and bytes of the longest.
LOOKED_AT, FEWEST, LONGEST = 20, 3, 4096
#: The largest share of lines with other names than the first one.
MOST_OTHERS = 0.1
_LABEL = rb"(?<![\w.])\"?([A-Za-z_][\w.]*(?:\[\w*\])?(?:[ \t]?\([\w/^.*-]{1,12}\))?)\"?[ \t]*[:=][ \t]*"
_BETWEEN = rb"[ \t,;|]+"
_LABELLED = re.compile(
    rb"[ \t{]*(?:%b%b(?:%b%b)*[ \t,;|}]*)+" % (_LABEL.replace(b"([A", b"(?:[A"), NUMBER, _BETWEEN, NUMBER)
)
_BRACKETED = re.compile(rb"[ \t]*[\[(][-+\d][^\[\](){}]*[\])],?[ \t]*")
#: Kinds of GnssLogger's rows, the one that is taken where there are several coming first, and their names in the table.
_GYROS, _ACCELS = (b"UncalGyro", b"Gyro"), (b"UncalAccel", b"Accel")


def rewriter_of(head: bytes) -> Callable[[Path], Spooled] | None:
    """What writes a file that begins so as a table; None for tables and for what is no text."""
    body = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    coloured = COLOUR in body
    body = COLOURS.sub(b"", body)
    if b"\0" in body[:1024]:
        return None
    if re.match(rb"\[\s*\{", body) or (re.match(rb"\[\s*\[", body) and len(body.split(b"\n", 1)[0]) > LONGEST):
        return of_array  # all of it may be one line
    if _is_one_object(body):
        return of_one_object
    lines = [line.strip() for line in body.split(b"\n")[: LOOKED_AT + 1]][:-1] or [body]
    lines = [line for line in lines if line]
    if not lines or max(map(len, lines)) > LONGEST:
        return None
    if any(_gnss_fields(line, _GYROS) for line in body.split(b"\n") if line.startswith(b"#")):
        return _of_gnss_logger
    if (rewriting := rewriting_of(lines, body)) is not None:
        return lambda path: spooled(path, (piece for piece in rewriting(pieces_of(path)) if piece))
    if body.startswith(b"{") and (b":" in lines[0]) and lines[0].endswith((b"}", b"},")):
        return of_objects
    behind = lines[1:] or lines
    if all(_LABELLED.fullmatch(line) for line in behind) and len(re.findall(_LABEL, behind[0])) > 1:
        return _of_labels
    if all(_BRACKETED.fullmatch(line) for line in behind) and len(re.findall(NUMBER, behind[0])) >= FEWEST:
        return _of_lists
    whole = body.split(b"\n") if body.endswith(b"\n") else body.split(b"\n")[:-1]
    if (worded := rewriting_of_words([line.rstrip(b"\r") for line in whole])) is not None:
        return lambda path: spooled(path, worded(pieces_of(path)))
    if (cells := rewriting_of_cells(lines) or rewriting_of_tidy(lines) or rewriting_of_parts(lines)) is not None:
        return lambda path: spooled(path, cells(pieces_of(path)))
    return (lambda path: spooled(path, pieces_of(path))) if coloured else None


def _is_one_object(body: bytes) -> bool:
    """Whether the file begins as one JSON object: in one line that does not end, or over lines of one name each."""
    first = body.split(b"\n", 1)[0].strip()
    return body.startswith(b"{") and (first == b"{" or (b"\n" not in body and len(body) > LONGEST))


def _of_labels(path: Path) -> Spooled:
    """Names with their values in each line: ts: 1.2 gx: 0.1 gy: 0.2, or Gyro: 0.1, 0.2, 0.3."""

    def pieces() -> Iterator[bytes]:
        titles: list[bytes] = []
        names: list[bytes] = []
        for piece in pieces_of(path):
            lines = [line for line in piece.split(b"\n") if line.strip()]
            lines = [line for line in lines if titles or _LABELLED.fullmatch(line.strip())]
            if lines and not titles:
                titles = _titles(lines[0])
                yield b",".join(titles) + b"\n"
            names = re.findall(_LABEL, lines[0]) if lines and not names else names
            lines = _alike(lines, names, path.name)
            text = re.sub(_LABEL, b" ", b"\n".join(lines))
            rows = [re.sub(_BETWEEN, b",", line.strip(b" \t,;|{}")) for line in text.split(b"\n")]
            yield b"\n".join(rows) + b"\n"

    return spooled(path, pieces())


def _alike(lines: list[bytes], names: list[bytes], file: str) -> list[bytes]:
    """The lines, those with other names than the first one as no row can be."""
    if re.findall(_LABEL, b"\n".join(lines)) == names * len(lines):
        return lines
    others = [i for i, line in enumerate(lines) if re.findall(_LABEL, line) != names]
    if len(others) > MOST_OTHERS * len(lines):
        kinds = [b" ".join(re.findall(_LABEL, line)).decode() for line in (lines[0], lines[others[0]])]
        raise InputError(
            f"{file} has lines of different names: {kinds[0]}; {kinds[1]}. Write those of each kind into a file of its "
            "own, and give the accelerometer's by --accel."
        )
    for i in others:
        lines[i] = b"'" + lines[i].split(b" ")[0][:40] + b"'"
    return lines


def _titles(line: bytes) -> list[bytes]:
    """The titles of a line of names with their values; three values behind one name are x, y and z."""
    parts = re.split(_LABEL, line)
    titles: list[bytes] = []
    for name, values in zip(parts[1::2], parts[2::2], strict=True):
        count = len(re.findall(NUMBER, values))
        ends = [b""] if count == 1 else [b"_x", b"_y", b"_z"] if count == 3 else [b"_%d" % i for i in range(count)]
        titles += [name + end for end in ends]
    return titles


def _of_lists(path: Path) -> Spooled:
    """A list in brackets in each line."""
    return spooled(path, (re.sub(rb"(?m)^[ \t]*[\[(](.*)[\])],?[ \t]*$", rb"\1", piece) for piece in pieces_of(path)))


def _gnss_fields(line: bytes, kinds: tuple[bytes, ...]) -> tuple[bytes, list[bytes]] | None:
    """The kind and the fields that a comment of GnssLogger states."""
    fields = [field.strip() for field in line.lstrip(b"# \t").split(b",")]
    known = fields[0] in kinds and len(fields) >= 6 and any(field.endswith(b"Nanos") for field in fields)
    return (fields[0], fields) if known else None


def _of_gnss_logger(path: Path) -> Spooled:
    """The rows of the gyroscope and the accelerometer among all others, with the time of the sensors' events."""

    def pieces() -> Iterator[bytes]:
        stated: dict[bytes, list[bytes]] = {}
        yield b"MessageType,elapsedRealtimeNanos,MeasurementX,MeasurementY,MeasurementZ\n"
        for piece in pieces_of(path):
            for line in re.findall(rb"(?m)^#.*$", piece):
                found = _gnss_fields(line, _GYROS + _ACCELS)
                stated |= {found[0]: found[1]} if found else {}
            taken = [next((kind for kind in kinds if kind in stated), b"") for kinds in (_GYROS, _ACCELS)]
            patterns = [rb"%b,[^\n]*" % kind for kind in taken if kind]
            out = io.BytesIO()
            for row in re.findall(rb"(?m)^(?:%b)$" % b"|".join(patterns), piece) if patterns else ():
                fields = row.split(b",")
                names = stated[fields[0]]
                time = next(i for i, name in enumerate(names) if name.endswith(b"Nanos"))
                kind = b"UncalGyro" if fields[0] in _GYROS else b"UncalAccel"
                out.write(b",".join([kind, *fields[time : time + 4]]) + b"\n")
            yield out.getvalue()

    # A piece without such rows is no end of the file.
    return spooled(path, (piece for piece in pieces() if piece))
