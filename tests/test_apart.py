"""Work in a process of its own: answers, errors, limits, crashes, Ctrl-C."""

import gc
import os
import signal
import threading
import time
import weakref

import numpy as np
import pytest

from gyronorth.apart import SHARED, Apart, Limits
from gyronorth.errors import InputError, is_of_memory

WIDE = Limits(seconds=20, memory=1 << 28)


def serving(service, limits=WIDE):
    return Apart(lambda: service, limits=limits, what="a.file")


def test_an_answer_is_what_the_service_returns_arrays_too():
    child = serving(lambda request: {"sum": request["x"].sum(axis=0), "x": request["x"]})
    x = np.arange(12.0).reshape(4, 3)
    answer = child.ask({"x": x})
    np.testing.assert_array_equal(answer["sum"], x.sum(axis=0))
    np.testing.assert_array_equal(answer["x"], x)
    answer["x"][0] = 1  # it can be written to


@pytest.mark.parametrize("size", [0, 1, SHARED // 8, SHARED // 8 + 1])
def test_an_answer_stays_when_the_next_one_comes_however_long_they_are(size):
    child = serving(lambda value: [np.full(size, value), np.array([value]), np.full((2, 3), -value)])
    first, second = child.ask(1.0), child.ask(2.0)
    for value, answer in ((1.0, first), (2.0, second)):
        for array, expected in zip(answer, (np.full(size, value), [value], np.full((2, 3), -value)), strict=True):
            np.testing.assert_array_equal(array, expected)


def test_where_memory_is_short_any_error_is_one_of_memory():
    little = Limits(seconds=20, memory=1 << 24)
    assert serving(lambda _: is_of_memory(SystemError("error return without exception set")), little).ask(None)
    assert not serving(lambda _: is_of_memory(InputError("no such thing")), little).ask(None)
    assert not is_of_memory(SystemError("error return without exception set"))
    assert is_of_memory(MemoryError())


def test_it_runs_in_another_process_that_ends_with_it():
    child = serving(lambda _: os.getpid())
    pid = child.ask(None)
    assert pid != os.getpid()
    child.close()
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_an_object_that_is_forgotten_takes_its_process_along():
    child = serving(lambda _: os.getpid())
    pid = child.ask(None)
    del child
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_what_the_service_raises_is_raised_here_and_it_goes_on():
    def service(request):
        if request == "bad":
            raise InputError("no such thing")
        return request

    child = serving(service)
    with pytest.raises(InputError, match="no such thing"):
        child.ask("bad")
    assert child.ask("good") == "good"


def test_a_service_that_cannot_be_made_says_why():
    def make():
        raise InputError("cannot be opened")

    with pytest.raises(InputError, match="cannot be opened"):
        Apart(make, limits=WIDE, what="a.file").ask(None)


def test_an_error_that_cannot_be_sent_comes_as_its_text():
    class Odd(Exception):
        """Of a class that the parent cannot import."""

    def service(_):
        raise Odd("left right")

    with pytest.raises(ValueError, match="Odd: left right"):
        serving(service).ask(None)


def spin(_):
    while True:
        pass


@pytest.mark.slow
def test_what_never_ends_is_ended():
    with pytest.raises(InputError, match=r"a\.file took more than 1 s of computing"):
        serving(spin, Limits(seconds=1, memory=1 << 28)).ask(None)


@pytest.mark.slow
def test_time_may_be_given_anew_with_a_request():
    child = serving(lambda _: sum(range(1_000_000)), Limits(seconds=600, memory=1 << 28))
    assert child.ask(None, seconds=20) > 0
    with pytest.raises(InputError, match="of computing"):
        serving(spin, Limits(seconds=600, memory=1 << 28)).ask(None, seconds=1)


def test_memory_beyond_the_limit_is_refused_and_not_taken():
    with pytest.raises(InputError, match=r"a\.file needs more memory than it may take"):
        serving(lambda _: len(bytearray(1 << 29))).ask(None)
    assert serving(lambda _: len(bytearray(1 << 27))).ask(None) == 1 << 27


@pytest.mark.parametrize("number", [signal.SIGSEGV, signal.SIGABRT])
def test_a_crash_is_one_message(number):
    def service(_):
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
        time.sleep(60)

    with pytest.raises(InputError, match=rf"stopped in the library that decodes it \({number.name}\)"):
        serving(service).ask(None)


def test_ctrl_c_is_heard_while_the_child_is_busy_and_the_child_goes():
    # A shell that starts the tests in its background has the signal ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        child = serving(lambda request: os.getpid() if request is None else spin(request))
        pid = child.ask(None)
        timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            child.ask("spin")
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
    finally:
        signal.signal(signal.SIGINT, before)


def test_an_answer_that_is_an_error_keeps_no_child():
    """A frame that holds the error it raises is held by it: children lived until garbage was looked for, up to 140."""

    def make():
        def refuse(_):
            raise InputError("no")

        return refuse

    child = Apart(make, limits=Limits(5.0, 1 << 28), what="x")
    with pytest.raises(InputError):
        child.ask(1)
    left = weakref.ref(child)
    gc.disable()
    try:
        del child
        assert left() is None
    finally:
        gc.enable()
