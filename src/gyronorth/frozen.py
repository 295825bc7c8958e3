"""Frozen dataclasses without generated code.

`dataclass(frozen=True)` writes and compiles six methods for each class, half a millisecond of start-up. A heading loads
seventy such classes: a tenth of the time that a recording of a minute takes. These share one set of methods.
"""

from __future__ import annotations

from dataclasses import MISSING, Field, FrozenInstanceError, dataclass, field, fields
from functools import cache
from typing import Any, NoReturn, TypeVar, dataclass_transform

_Class = TypeVar("_Class")


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def frozen(cls: type[_Class]) -> type[_Class]:
    """What `dataclass(frozen=True)` makes of a class: its fields, `__post_init__`, equality, hash and text.

    `fields`, `replace`, `asdict` and pickling take its instances as those of any dataclass. It may inherit from, and
    be inherited by, its like alone.
    """
    made: Any = dataclass(init=False, repr=False, eq=False)(cls)
    for method in (__init__, __setattr__, __delattr__, __eq__, __hash__, __repr__):
        if method.__name__ not in vars(cls):
            setattr(made, method.__name__, method)
    made.__signature__ = _Signature()
    return made


class _Signature:
    """What a class takes, for `help` and editors: worked out when it is asked for."""

    def __get__(self, _instance: Any, cls: type[Any]) -> Any:
        from inspect import Parameter, Signature

        def default_of(each: Field[Any]) -> Any:
            made = Parameter.empty if each.default_factory is MISSING else ...
            return made if each.default is MISSING else each.default

        kind = Parameter.POSITIONAL_OR_KEYWORD
        taken = [Parameter(each.name, kind, default=default_of(each), annotation=each.type) for each in fields(cls)]
        return Signature(taken, return_annotation=None)


@cache
def _plan(cls: Any) -> tuple[tuple[str, ...], dict[str, Field[Any]], bool]:
    """Names of the fields in order, those with a default, and whether something is checked at the end."""
    every = fields(cls)
    omitted = {each.name: each for each in every if each.default is not MISSING or each.default_factory is not MISSING}
    return tuple(each.name for each in every), omitted, hasattr(cls, "__post_init__")


@cache
def _compared(cls: Any) -> tuple[str, ...]:
    return tuple(each.name for each in fields(cls) if each.compare)


def __init__(self: Any, *given: Any, **named: Any) -> None:
    names, omitted, checked = _plan(type(self))
    if len(given) > len(names):
        raise TypeError(f"{type(self).__name__} takes {len(names)} values, and {len(given)} were given.")
    values = dict(zip(names, given, strict=False))
    for name in names[len(given) :]:
        if name in named:
            values[name] = named.pop(name)
        elif name in omitted:
            default = omitted[name].default
            values[name] = omitted[name].default_factory() if default is MISSING else default  # type: ignore[misc]
        else:
            raise TypeError(f"{type(self).__name__} is missing a value of {name}.")
    if named:
        raise TypeError(f"{type(self).__name__} was given twice, or has no field, {', '.join(named)}.")
    self.__dict__.update(values)
    if checked:
        self.__post_init__()


def __setattr__(self: Any, name: str, value: Any) -> NoReturn:  # noqa: ARG001
    raise FrozenInstanceError(f"cannot assign to field {name!r}")


def __delattr__(self: Any, name: str) -> NoReturn:  # noqa: ARG001
    raise FrozenInstanceError(f"cannot delete field {name!r}")


def __eq__(self: Any, other: Any) -> Any:
    return _values(self) == _values(other) if type(other) is type(self) else NotImplemented


def __hash__(self: Any) -> int:
    return hash(_values(self))


def __repr__(self: Any) -> str:
    shown = (f"{each.name}={getattr(self, each.name)!r}" for each in fields(self) if each.repr)
    return f"{type(self).__qualname__}({', '.join(shown)})"


def _values(self: Any) -> tuple[Any, ...]:
    return tuple(getattr(self, name) for name in _compared(type(self)))
