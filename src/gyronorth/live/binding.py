"""A socket that is bound to an address, or an error that says what is wrong with it."""

from __future__ import annotations

import socket
from contextlib import suppress

#: Files and connections that may be open at a time, where the system allows so many.
DESCRIPTORS = 8192


def allow_descriptors() -> None:
    """Raise the limit of open connections, so that many idle ones leave room for the recording."""
    with suppress(ImportError, ValueError, OSError):  # not on every system
        import resource

        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        wanted = DESCRIPTORS if hard == resource.RLIM_INFINITY else min(DESCRIPTORS, hard)
        if soft < wanted:
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


def descriptors() -> int:
    """How many files and connections may be open at a time."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        soft = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
        return DESCRIPTORS if soft == resource.RLIM_INFINITY else soft
    return DESCRIPTORS


def bound_socket(host: str, port: int, kind: socket.SocketKind, *, receive: int | None = None) -> socket.socket:
    """Bind a socket; one that takes connections listens.

    Parameters
    ----------
    host, port
        Where; port 0 takes a free one.
    kind : socket.SocketKind
        SOCK_STREAM or SOCK_DGRAM.
    receive : int, optional
        Room for what has come and was not read yet, bytes.

    Raises
    ------
    OSError
        If the address is not of this machine, in use, or not allowed.
    """
    family, _, _, _, address = socket.getaddrinfo(host, port, type=kind)[0]
    made = socket.socket(family, kind)
    try:
        if receive is not None:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive)
        if kind == socket.SOCK_STREAM:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind(address)
        if kind == socket.SOCK_STREAM:
            made.listen()
    except OSError:
        made.close()
        raise
    return made
