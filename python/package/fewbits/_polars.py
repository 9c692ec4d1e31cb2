"""Recordings as lazy frames of polars, which reads only the columns and times that a query needs."""

from __future__ import annotations

from collections.abc import Iterator
from math import floor, isfinite
from os import PathLike
from typing import TYPE_CHECKING, Any

from ._fewbits import open as _open

if TYPE_CHECKING:
    import polars as pl

_PER_SECOND = {"Milliseconds": 1e3, "Microseconds": 1e6, "Nanoseconds": 1e9}
_MIRRORED = {"Gt": "Lt", "GtEq": "LtEq", "Lt": "Gt", "LtEq": "GtEq", "Eq": "Eq"}


def scan(path: str | PathLike[str]) -> pl.LazyFrame:
    """A recording as a lazy frame of polars.

    A query reads only the blocks of the times and the columns that it asks for.

    >>> import polars as pl, fewbits as fb, tempfile, os
    >>> path = os.path.join(tempfile.mkdtemp(), "room.fewb")
    >>> _ = fb.write(pl.DataFrame({"a": range(1000), "b": range(1000)}), path)
    >>> fb.scan(path).filter(pl.col("row") >= 990).select("a").collect().height
    10
    """
    import polars as pl
    from polars.io.plugins import register_io_source

    recording = _open(path)
    key = recording.columns[0]
    schema = pl.DataFrame(recording.select(start=0, end=0)).schema

    def source(
        columns: list[str] | None, predicate: pl.Expr | None, rows: int | None, _batch: int | None
    ) -> Iterator[pl.DataFrame]:
        start, end = _range(predicate, key, recording.numbered)
        wanted = None
        if columns is not None:
            read = set(columns)
            if predicate is not None:
                read.update(predicate.meta.root_names())
            wanted = [name for name in recording.columns[1:] if name in read]
        for block in recording.select(wanted, start=start, end=end):
            frame = pl.DataFrame(block)
            if predicate is not None:
                frame = frame.filter(predicate)
            if columns is not None:
                frame = frame.select(columns)
            if rows is not None:
                frame = frame.head(rows)
                rows -= frame.height
            yield frame
            if rows == 0:
                return

    return register_io_source(source, schema=dict(schema), is_pure=True)


def _range(predicate: pl.Expr | None, key: str, numbered: bool) -> tuple[float | int | None, float | int | None]:
    """A range of the column `key` that holds all rows of a predicate, not always the smallest.

    What is not understood restricts nothing: polars applies the predicate to the rows in any case.
    """
    if predicate is None:
        return None, None
    import json
    import warnings

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = json.loads(predicate.meta.serialize(format="json"))
    except Exception:  # noqa: BLE001  (an expression that cannot be written as JSON restricts nothing)
        return None, None
    lower: list[float] = []
    upper: list[float] = []
    _walk(tree, key, lower, upper)
    start = max(lower) if lower else None
    end = min(upper) if upper else None
    if numbered:
        return (None if start is None else floor(start)), (None if end is None else floor(end) + 1)
    # A second more on both sides: seconds as doubles are not exact.
    return (None if start is None else start - 1.0), (None if end is None else end + 1.0)


def _walk(node: Any, key: str, lower: list[float], upper: list[float]) -> None:
    match node:
        case {"BinaryExpr": {"op": "And" | "LogicalAnd", "left": left, "right": right}}:
            _walk(left, key, lower, upper)
            _walk(right, key, lower, upper)
        case {"BinaryExpr": {"op": op, "left": {"Column": name}, "right": {"Literal": literal}}} if name == key:
            _limit(op, literal, lower, upper)
        case {"BinaryExpr": {"op": op, "left": {"Literal": literal}, "right": {"Column": name}}} if name == key:
            _limit(_MIRRORED.get(op, ""), literal, lower, upper)
        case _:
            pass


def _limit(op: str, literal: Any, lower: list[float], upper: list[float]) -> None:
    match literal:
        case {"Scalar": {"Datetime": [int(ticks), str(unit), _]}}:
            value = ticks / _PER_SECOND.get(unit, float("nan"))
        case {"Dyn": {"Int": number}} | {"Dyn": {"Float": number}} | {"Scalar": {"Int64": number}} | {"Scalar": {"Float64": number}}:
            value = float(number)
        case _:
            return
    if not isfinite(value):
        return
    if op in ("Gt", "GtEq", "Eq"):
        lower.append(value)
    if op in ("Lt", "LtEq", "Eq"):
        upper.append(value)
