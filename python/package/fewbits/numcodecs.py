"""A codec of numcodecs, for Zarr format 2 and all other users of its registry."""

from __future__ import annotations

from typing import Any

import numpy as np
from numcodecs.abc import Codec
from numcodecs.compat import ensure_ndarray, ndarray_copy
from numcodecs.registry import register_codec

from ._chunks import WHOLE, Effort, decoded, encoded
from ._fewbits import encode

__all__ = ["Bounded"]


class Bounded(Codec):  # type: ignore[misc,unused-ignore]
    """Chunks within a bound: `bound` is the largest error of a finite number, None returns every bit. `dtype` is that of the array.

    >>> import numpy as np
    >>> codec = Bounded(bound=0.01, dtype="<f4")
    >>> x = np.linspace(0, 1, 100, dtype="f4")
    >>> bool(np.abs(codec.decode(codec.encode(x)) - x).max() <= 0.01)
    True
    """

    codec_id = "fewbits"

    def __init__(self, bound: float | None = None, dtype: str = "<f8", effort: Effort = "thorough") -> None:
        encode(np.zeros(0), bound, effort=effort)
        self.bound = bound
        self.dtype = np.dtype(dtype).str
        self.effort = effort

    def encode(self, buf: Any) -> bytes:
        """A chunk as bytes."""
        array = ensure_ndarray(buf)
        if array.dtype.kind not in "f" + WHOLE:
            array = array.view(self.dtype)
        return encoded(array, self.bound, self.effort)

    def decode(self, buf: Any, out: Any = None) -> Any:
        """The chunk of bytes."""
        numbers = decoded(ensure_ndarray(buf).tobytes(), self.dtype)
        return ndarray_copy(numbers, out) if out is not None else numbers


register_codec(Bounded)
