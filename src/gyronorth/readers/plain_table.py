"""Texts that are a table of numbers beyond doubt, which is what most recordings are."""

from __future__ import annotations

#: Symbols of which rows of numbers consist, and how a comment begins.
_OF_NUMBERS, _COMMENT = b"0123456789+-.eE, \r\n", b"#"
#: Words of titles, and of comments, of tables that are written anew all the same: see `phones`, and `records`.
_OF_PHONES, _OF_LOGGER = (b"gravity", b"accelerometeracceleration"), b"Gyro"
#: How a colour of a terminal begins; in titles also how lists and objects do.
_ESCAPE, _STRANGE = b"\x1b", (b"{", b"[[")


def is_plain_table(head: bytes) -> bool:
    """Whether a file that begins so is comments, one line of titles and rows of numbers with commas between them.

    Nothing that `foreign` knows begins so, and nothing that `records` writes anew.
    """
    above = 0
    while head.startswith(_COMMENT, above):
        above = head.find(b"\n", above) + 1
        if above == 0:
            return False
    below = head.find(b"\n", above) + 1
    if _OF_LOGGER in head[:above] or any(word in head[:below].lower() for word in _OF_PHONES):
        return False
    titles = head[above:below]
    if not titles.strip() or any(word in titles for word in _STRANGE) or _ESCAPE in head[:below]:
        return False
    return b"," in head[below:] and not head[below:].translate(None, _OF_NUMBERS)
