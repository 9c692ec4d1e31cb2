"""Chunks of arrays as frames, for Zarr and numcodecs."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ._fewbits import decode, encode
from .errors import ArgumentError

Effort: TypeAlias = Literal["thorough", "fast"]

WHOLE = "iub"


def encoded(array: NDArray[Any], bound: float | None, effort: Effort) -> bytes:
    """A frame of all cells, whose decoded numbers are within the bound after they were rounded to the array's type too."""
    flat = np.ascontiguousarray(array).reshape(-1)
    if flat.dtype.kind not in "f" + WHOLE:
        raise ArgumentError("dtype", str(flat.dtype), "floats or integers")
    if bound is None or flat.dtype.kind in WHOLE:
        if flat.dtype.kind == "f" and flat.dtype.itemsize not in (4, 8):
            flat = flat.astype(np.float64)
        return encode(flat, effort=effort)
    if flat.dtype.itemsize < 8:
        finite = np.abs(flat[np.isfinite(flat)]).astype(np.float64)
        largest = flat.dtype.type((float(finite.max()) if finite.size else 0.0) + bound)
        # Half a unit in the last place of the largest number that can come out.
        rounding = 0.5 * float(np.spacing(largest)) if np.isfinite(largest) else bound
        if not rounding < bound:
            return encoded(array, None, effort)
        bound -= rounding
    return encode(flat.astype(np.float64), bound, effort=effort)


def decoded(frame: bytes, dtype: Any) -> NDArray[Any]:
    """The cells of a frame in the array's type."""
    numbers: NDArray[Any] = decode(frame)
    return numbers.astype(dtype, copy=False)
