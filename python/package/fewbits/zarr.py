"""A serializer of Zarr format 3 within a bound.

>>> import numpy as np, zarr
>>> from fewbits.zarr import Bounded
>>> x = np.sin(np.arange(1000) / 50)
>>> z = zarr.create_array({}, shape=x.shape, chunks=(500,), dtype="float64", serializer=Bounded(bound=0.01), compressors=None)
>>> z[:] = x
>>> bool(np.abs(z[:] - x).max() <= 0.01)
True
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from zarr.abc.codec import ArrayBytesCodec
from zarr.core.array_spec import ArraySpec
from zarr.core.buffer import Buffer, NDBuffer
from zarr.core.common import parse_named_configuration
from zarr.registry import register_codec

from ._chunks import Effort, decoded, encoded
from ._fewbits import encode

__all__ = ["Bounded"]


@dataclass(frozen=True)
class Bounded(ArrayBytesCodec):
    """Chunks within a bound: `bound` is the largest error of a finite number, None returns every bit. The metadata state the bound.

    >>> Bounded(bound=0.5).to_dict()
    {'name': 'fewbits', 'configuration': {'bound': 0.5, 'effort': 'thorough'}}
    """

    is_fixed_size = False
    bound: float | None = None
    effort: Effort = "thorough"

    def __post_init__(self) -> None:
        encode(np.zeros(0), self.bound, effort=self.effort)

    @classmethod
    def from_dict(cls, data: Any) -> Bounded:
        """The codec of an array's metadata."""
        _, configuration = parse_named_configuration(data, "fewbits")
        return cls(**cast(dict[str, Any], configuration))

    def to_dict(self) -> Any:
        """The codec as an array's metadata."""
        return {"name": "fewbits", "configuration": {"bound": self.bound, "effort": self.effort}}

    def evolve_from_array_spec(self, array_spec: ArraySpec) -> Bounded:
        """The codec is the same for all arrays."""
        return self

    def compute_encoded_size(self, input_byte_length: int, _chunk_spec: ArraySpec) -> int:
        """The size depends on the numbers."""
        raise NotImplementedError

    async def _encode_single(self, chunk_array: NDBuffer, chunk_spec: ArraySpec) -> Buffer | None:
        frame = encoded(np.asarray(chunk_array.as_numpy_array()), self.bound, self.effort)
        return chunk_spec.prototype.buffer.from_bytes(frame)

    async def _decode_single(self, chunk_bytes: Buffer, chunk_spec: ArraySpec) -> NDBuffer:
        numbers = decoded(chunk_bytes.to_bytes(), chunk_spec.dtype.to_native_dtype()).reshape(chunk_spec.shape)
        return chunk_spec.prototype.nd_buffer.from_ndarray_like(cast(Any, numbers))


register_codec("fewbits", Bounded)
