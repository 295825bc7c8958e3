"""Frozen dataclasses without generated code: whatever `dataclass(frozen=True)` does, they do."""

from __future__ import annotations

import copy
import inspect
import pickle
from dataclasses import FrozenInstanceError, asdict, dataclass, field, fields, is_dataclass, replace

import pytest

from gyronorth.frozen import frozen


class Fields:
    name: str
    size: float = 1.0
    parts: list[int] = field(default_factory=list, compare=False)
    hidden: str = field(default="", repr=False)

    def __post_init__(self):
        if self.size < 0:
            raise ValueError("size")
        object.__setattr__(self, "size", float(self.size))


def made_by(decorator):
    body = {name: value for name, value in vars(Fields).items() if name not in ("__dict__", "__weakref__")}
    return decorator(type("Thing", (), body))


@frozen
class Above:
    name: str


@frozen
class Below(Above):
    more: int = 2


Ours, Theirs = made_by(frozen), made_by(dataclass(frozen=True))


@pytest.mark.parametrize(
    ("given", "named"), [(("a",), {}), (("a", 2), {"hidden": "x"}), ((), {"name": "b", "parts": [1]})]
)
def test_values_text_and_dictionary_are_those_of_a_dataclass(given, named):
    ours, theirs = Ours(*given, **named), Theirs(*given, **named)
    assert asdict(ours) == asdict(theirs)
    assert repr(ours) == repr(theirs)
    assert [each.name for each in fields(Ours)] == [each.name for each in fields(Theirs)]
    assert is_dataclass(ours)
    assert Ours.__match_args__ == Theirs.__match_args__


def test_help_and_editors_are_told_what_it_takes():
    ours, theirs = (inspect.signature(cls).parameters for cls in (Ours, Theirs))
    assert list(ours) == list(theirs)
    for name in ("name", "size", "hidden"):
        assert ours[name] == theirs[name]
    assert ours["parts"].default is not inspect.Parameter.empty
    assert list(inspect.signature(Below).parameters) == ["name", "more"]


@pytest.mark.parametrize(
    ("given", "named"), [((), {}), (("a", 1, [], "", 5), {}), (("a",), {"name": "b"}), (("a",), {"other": 1})]
)
def test_wrong_arguments_are_refused(given, named):
    for cls in (Ours, Theirs):
        with pytest.raises(TypeError):
            cls(*given, **named)


def test_defaults_are_made_anew_for_each():
    assert Ours("a").parts is not Ours("a").parts


def test_equal_are_those_of_one_class_with_equal_fields_that_count():
    assert Ours("a", parts=[1]) == Ours("a", parts=[2])
    assert hash(Ours("a", parts=[1])) == hash(Ours("a"))
    assert Ours("a") != Ours("b")
    assert Ours("a") != Theirs("a")


def test_nothing_is_set_or_deleted_later():
    one = Ours("a")
    for change in (lambda: setattr(one, "name", "b"), lambda: setattr(one, "new", 1), lambda: delattr(one, "name")):
        with pytest.raises(FrozenInstanceError):
            change()


def test_it_is_checked_when_made_and_when_replaced():
    assert replace(Ours("a"), size=3).size == 3.0
    with pytest.raises(ValueError, match="size"):
        replace(Ours("a"), size=-1)


def test_one_inherits_from_another():
    assert Below("a") == Below("a", 2)
    assert Below("a") != Above("a")
    assert repr(Below("a")) == "Below(name='a', more=2)"


def test_a_copy_and_one_that_was_pickled_are_equal():
    assert copy.deepcopy(Below("a", 3)) == pickle.loads(pickle.dumps(Below("a", 3))) == Below("a", 3)
