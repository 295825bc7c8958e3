"""A network of a bundle as a function of arrays, whoever made it: its names, its time and its numbers are checked.

Those that ship with the package run here. A stranger's may loop for ever or ask for any memory, so it runs in a
process of its own (`gyronorth.apart`), with time for each recording.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyronorth.alignment.networks.onnx_file import DamagedOnnx, names_other_files
from gyronorth.apart import Apart, Limits
from gyronorth.errors import InputError

#: CPU time, s, of a stranger's network: to be loaded, and for one recording.
LOADING, RECORDING = 10.0, 15.0
#: Memory of it beyond that of the program, and beyond so many times its file, bytes.
MEMORY, MEMORY_RATIO = 768 << 20, 8

Arrays = Mapping[str, NDArray[Any]]
#: Runs inputs by their names; with None it says the names of inputs and outputs.
Runner = Callable[[Arrays | None], Any]


class Network:
    """One network of a bundle.

    Parameters
    ----------
    content : bytes
        The ONNX file, whose checksum was compared.
    make : callable
        Makes of it what runs it; called in the child where `trusted` is false.
    inputs : tuple of str
        Names that its inputs must have.
    outputs : int
        How many outputs it must have.
    what : str
        The file and its bundle, for messages.
    trusted : bool
        Whether it ships with the package.

    Raises
    ------
    InputError
        If it is no such network.
    """

    def __init__(
        self,
        content: bytes,
        make: Callable[[bytes], Runner],
        *,
        inputs: tuple[str, ...],
        outputs: int,
        what: str,
        trusted: bool,
    ) -> None:
        self._what = what
        try:
            if names_other_files(content):
                raise InputError(f"{what} keeps numbers in other files; a bundle's network is one file. Export it so.")
        except DamagedOnnx as error:
            raise InputError(f"{what} is no ONNX network ({error}). Copy or train the bundle again.") from None
        self.trusted = trusted
        self._child, self._runner, self._left = None, None, LOADING
        if trusted:
            self._runner = make(content)
        else:
            limits = Limits(LOADING, MEMORY + MEMORY_RATIO * len(content))
            self._child = Apart(lambda: make(content), limits=limits, what=what)
        names, count = self._ask(None)
        if set(names) != set(inputs) or count != outputs:
            raise InputError(
                f"{what} has the inputs {', '.join(map(str, names))[:100]} and {count} outputs; {', '.join(inputs)} "
                f"and {outputs} are expected. Train the bundle again with this version of gyronorth."
            )

    def renew(self) -> None:
        """Give a stranger's network its time for the next recording."""
        self._left = RECORDING

    def run(self, inputs: Arrays) -> Sequence[NDArray[Any]]:
        """The outputs, which are finite numbers.

        Raises
        ------
        InputError
            If it cannot be run on these inputs, takes too long, or what comes is no array of finite numbers.
        """
        found: Sequence[NDArray[Any]] = self._ask(dict(inputs))
        if not all(type(each) is np.ndarray and each.dtype.kind in "fiu" for each in found):
            raise InputError(f"{self._what} gives something else than arrays of numbers. Train the bundle again.")
        if not all(np.isfinite(each).all() for each in found):
            raise InputError(f"{self._what} gives numbers that are not finite on this recording; use --method mean.")
        return found

    def check(self, array: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
        """An output, which must have this shape."""
        if array.shape != shape:
            raise InputError(f"{self._what} gives an output of shape {array.shape}; {shape} is expected.")
        return array

    def _ask(self, request: Arrays | None) -> Any:
        try:
            if self._child is None:
                assert self._runner is not None
                return self._runner(request)[0]
            if self._left <= 0:
                raise InputError(f"{self._what} took more than {RECORDING:.0f} s of computing for one recording.")
            answer, seconds = self._child.ask(request, seconds=self._left)
        except InputError:
            raise
        except Exception as error:  # ONNX Runtime has a dozen of its own
            detail = " ".join(str(error).split())[:200]
            raise InputError(
                f"{self._what} cannot be run ({detail}): it is damaged, or not made for this. Train the bundle again."
            ) from None
        self._left -= seconds
        return answer
