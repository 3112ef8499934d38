"""Arrays that are reused: newly allocated memory costs a page fault per 4 KB, which takes longer than to copy a frame."""

from __future__ import annotations

from threading import Lock
from typing import Any

import numpy as np
import numpy.typing as npt


class BufferPool:
    """Lends arrays by name and size. Safe for threads."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._idle: dict[str, list[npt.NDArray[Any]]] = {}
        self._lent: dict[int, tuple[str, npt.NDArray[Any]]] = {}

    def lend(self, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> npt.NDArray[Any]:
        """An array of undefined content; memory given back under the same name is used again."""
        with self._lock:
            idle = self._idle.get(name, [])
            fit = next((i for i, array in enumerate(idle) if len(array) >= shape[0]), None)
            if fit is not None:
                array = idle.pop(fit)
            else:
                idle.clear()  # outgrown
                # A little larger than asked: counts that grow slowly then find their way back in.
                array = np.empty((shape[0] + shape[0] // 8 + 1, *shape[1:]), dtype)
            self._lent[id(array)] = (name, array)
            return array[: shape[0]]

    def give_back(self, view: npt.NDArray[Any]) -> None:
        """Take a lent array back; an array from elsewhere is left alone."""
        with self._lock:
            name, array = self._lent.pop(id(view.base), ("", None))
            if array is not None:
                self._idle.setdefault(name, []).append(array)
