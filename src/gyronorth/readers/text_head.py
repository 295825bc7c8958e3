"""The leading lines of a text file, one by one."""

from __future__ import annotations

from pathlib import Path

from gyronorth.errors import InputError

#: A longer line is no row of numbers.
LONGEST_LINE = 1 << 16


class TextHead:
    """The leading lines of a text file, as a context manager that remembers where it stopped."""

    def __init__(self, path: Path) -> None:
        self.name = path.name
        self.row = 0  # lines taken so far
        self.offset = 0  # bytes taken so far
        self._path = path

    def __enter__(self) -> TextHead:
        self._file = self._path.open("rb")
        start = self._file.read(4)
        if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
            self._file.close()
            raise InputError(f"{self.name} is UTF-16 text; save it as UTF-8.")
        self.offset = 3 if start[:3] == b"\xef\xbb\xbf" else 0
        self._file.seek(self.offset)
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def peek(self) -> str | None:
        """The next line without its end; None at the end of the file."""
        self._file.seek(self.offset)
        line = self._file.readline(LONGEST_LINE + 1)
        if len(line) > LONGEST_LINE:
            raise InputError(
                f"Row {self.row + 1} of {self.name} is longer than {LONGEST_LINE} characters. "
                "Lines that end in LF or CRLF are expected: is it another format?"
            )
        self._next = len(line)
        if not line:
            return None
        if b"\x00" in line:
            raise InputError(
                f"Row {self.row + 1} of {self.name} holds zero bytes: the file is damaged or not a text file."
            )
        try:
            return line.decode().rstrip("\r\n")
        except UnicodeDecodeError as error:
            raise InputError(
                f"Row {self.row + 1} of {self.name} holds the byte 0x{line[error.start]:02x}, which is not UTF-8. "
                "Save the file as UTF-8, or take the special characters out."
            ) from None

    def take(self) -> str | None:
        """Like `peek`, and go past the line."""
        line = self.peek()
        if line is not None:
            self.offset += self._next
            self.row += 1
        return line
