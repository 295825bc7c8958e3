"""Work that a stranger's data may turn against us, in a process of its own with limits of time and memory.

Libraries in C decode files and run networks. On a damaged or a malicious one they may allocate
without end, never return, or crash, and no signal of ours is heard while they run. So they run in a
child process under the system's limits. It answers requests over a socket, arrays of moderate size through
memory that both share, and the process that waits for it can always be interrupted. Where the system cannot fork
(Windows), the work is done here.
"""

from __future__ import annotations

import faulthandler
import math
import os
import pickle
import signal
import struct
import threading
import warnings
import weakref
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from gyronorth.errors import InputError
from gyronorth.frozen import frozen

if TYPE_CHECKING:
    import socket
    from mmap import mmap

#: What answers requests: made in the child, called there.
Service = Callable[[Any], Any]
#: Bytes of a number before a message.
_NUMBER = 8
#: Bytes of the arrays of an answer that go through shared memory, which takes half the time of a socket; more go there.
SHARED = 1 << 22


@frozen
class Limits:
    """What a child process may use."""

    seconds: float  # CPU time
    memory: int  # bytes, beyond what the process held when it was forked


class Apart:
    """A service in a child process; it ends with this object.

    Parameters
    ----------
    make : callable
        Makes the service, in the child. What it raises comes with the first answer.
    limits : Limits
        Beyond them the child ends, and what was asked of it ends in `InputError`.
    what : str
        The file, for messages.
    """

    def __init__(self, make: Callable[[], Service], *, limits: Limits, what: str) -> None:
        self._allowed, self._what, self._lock = limits.seconds, what, threading.Lock()
        self._inside: Service | None = None
        if not hasattr(os, "fork"):
            self._inside = make()
            return
        import socket
        from mmap import mmap

        self._shared = mmap(-1, SHARED)
        ours, theirs = socket.socketpair()
        with warnings.catch_warnings():
            # The child takes no lock but those that fork leaves open, and runs nothing that is running here.
            warnings.simplefilter("ignore", DeprecationWarning)
            pid = os.fork()
        if pid == 0:
            ours.close()
            _serve(make, theirs, self._shared, limits, what)
        theirs.close()
        self._socket, self._pid = ours, pid
        self._end = weakref.finalize(self, _end, pid, ours, os.getpid())

    def ask(self, request: Any, *, seconds: float | None = None) -> Any:
        """The answer to a request; what the service raises is raised here.

        Parameters
        ----------
        request : object
            What can be pickled.
        seconds : float, optional
            CPU time allowed from now on; without it, what is left.

        Raises
        ------
        InputError
            If the child went beyond its limits, or crashed.
        """
        if self._inside is not None:
            return self._inside(request)
        with self._lock:
            self._allowed = seconds if seconds is not None else self._allowed
            try:
                _send(self._socket, (seconds, request))
                good, answer = _receive(self._socket, self._shared)
            except (EOFError, OSError):
                raise InputError(self._why_ended()) from None
            except BaseException:  # Ctrl-C between the two: the next answer would be the wrong one
                self._end()
                raise
        if good:
            return answer
        try:
            raise answer
        finally:
            del answer  # an error and the frame that holds it would keep the child until garbage is looked for

    def close(self) -> None:
        """End the child."""
        if self._inside is None:
            self._end()

    def _why_ended(self) -> str:
        status = 0
        if self._end.detach() is not None:
            self._socket.close()
            with suppress(OSError):
                _, status = os.waitpid(self._pid, 0)
        number = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
        name = signal.Signals(number).name if number in set(signal.Signals) else f"exit code {status >> 8}"
        if number == signal.SIGXCPU:
            why = f"took more than {self._allowed:.0f} s of computing"
        elif number == signal.SIGKILL:
            why = "was ended by the system, which was short of memory"
        elif number == signal.SIGBUS:  # of a file that is mapped into the memory
            return f"{self._what} became shorter while it was read. Read it when it is whole."
        else:
            why = f"stopped in the library that decodes it ({name})"
        return (
            f"{self._what} {why}: it is damaged, or made to do so. Where it comes from a source that you trust, "
            "write it again and report it."
        )


def _end(pid: int, connection: socket.socket, parent: int) -> None:
    """Kill and bury the child; in a child that was forked later it is nobody's to kill."""
    connection.close()
    if os.getpid() != parent:
        return
    with suppress(OSError):
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)


def _serve(make: Callable[[], Service], connection: socket.socket, shared: mmap, limits: Limits, what: str) -> None:
    """The life of the child: it never returns, so that nothing of the parent is unwound in it."""
    try:
        # Ctrl-C reaches the whole group; the parent ends the child. SIGTERM must not run the parent's handler here.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        for ending in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(ending, signal.SIG_DFL)
        faulthandler.disable()  # a crash here is told by the parent
        _limit(limits)
        service, failure = None, None
        try:
            service = make()
        except Exception as error:
            failure = error
        while True:
            seconds, request = _receive(connection)
            if seconds is not None:
                _allow(seconds)
            try:
                if service is None:
                    raise failure or RuntimeError("no service")
                answer = True, service(request)
            except Exception as error:
                answer = False, _portable(error, what)
            _send(connection, answer, shared)
    except BaseException:
        pass
    finally:
        os._exit(0)


def _limit(limits: Limits) -> None:
    import resource

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _allow(limits.seconds)
    with suppress(OSError), open("/proc/self/status") as status:  # elsewhere than on Linux memory is not limited
        held = next(int(line.split()[1]) << 10 for line in status if line.startswith("VmData"))
        resource.setrlimit(resource.RLIMIT_DATA, (held + limits.memory, resource.RLIM_INFINITY))


def _allow(seconds: float) -> None:
    """CPU time that is left from now on."""
    import resource

    usage = resource.getrusage(resource.RUSAGE_SELF)
    until = math.ceil(usage.ru_utime + usage.ru_stime + seconds)
    resource.setrlimit(resource.RLIMIT_CPU, (until, resource.getrlimit(resource.RLIMIT_CPU)[1]))


def _portable(error: Exception, what: str) -> Exception:
    """An error as it can be sent; one of a foreign class as its text."""
    if isinstance(error, MemoryError):
        return InputError(
            f"{what} needs more memory than it may take: it is damaged, or made to do so. Or this process may use too "
            "little (`ulimit -v`, a container): then allow it more."
        )
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return ValueError(f"{type(error).__name__}: {error}")
    return error


def _send(connection: socket.socket, message: Any, shared: mmap | None = None) -> None:
    """A message, its arrays behind it or in the memory that is shared, where they fit in."""
    buffers: list[pickle.PickleBuffer] = []
    text = memoryview(pickle.dumps(message, protocol=5, buffer_callback=buffers.append))
    arrays = [buffer.raw() for buffer in buffers]
    inside = shared is not None and sum(array.nbytes for array in arrays) <= len(shared)
    if shared is not None and inside:
        end = 0
        for array in arrays:
            shared[end : end + array.nbytes] = array  # type: ignore[assignment]  # any bytes
            end += array.nbytes
    connection.sendall(_numbers(inside, 1 + len(arrays), text.nbytes, *(array.nbytes for array in arrays)))
    for part in (text, *([] if inside else arrays)):
        connection.sendall(part)


def _receive(connection: socket.socket, shared: mmap | None = None) -> Any:
    inside, count = struct.unpack("<2Q", _exactly(connection, 2 * _NUMBER))
    length, *lengths = struct.unpack(f"<{count}Q", _exactly(connection, _NUMBER * count))
    text = _exactly(connection, length)
    if shared is None or not inside:
        return pickle.loads(text, buffers=[_exactly(connection, length) for length in lengths])
    starts = [sum(lengths[:i]) for i in range(len(lengths))]
    with memoryview(shared) as view:  # copied out: the next answer comes to the same place
        arrays = [bytearray(view[start : start + length]) for start, length in zip(starts, lengths, strict=True)]
    return pickle.loads(text, buffers=arrays)


def _numbers(*numbers: int) -> bytes:
    return struct.pack(f"<{len(numbers)}Q", *numbers)


def _exactly(connection: socket.socket, size: int) -> bytearray:
    held = bytearray(size)
    view = memoryview(held)
    while view.nbytes:
        got = connection.recv_into(view)
        if got == 0:
            raise EOFError
        view = view[got:]
    return held
