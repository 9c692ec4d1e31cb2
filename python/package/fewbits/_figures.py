"""The figures that `cargo xtask figures` made, as tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ._fewbits import Table
from .errors import ArgumentError

if TYPE_CHECKING:
    import pathlib
    from os import PathLike


def figures(folder: str | PathLike[str]) -> Table:
    """All figures of a folder, a row each: its name, title and source, the number of claims that hold and that fail, and its seconds.

    `cargo xtask figures --out FOLDER` of the library's repository makes such a folder.

    >>> import json, pathlib, tempfile, fewbits as fb
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> made = {"id": "one", "title": "One figure", "source": "", "files": ["one.csv"], "claims": [{"verdict": "pass"}], "wall_time_s": 0.5}
    >>> _ = (folder / "one.json").write_text(json.dumps(made)), (folder / "one.csv").write_text("n,error,kind\\n1,0.5,a\\n2,,b\\n")
    >>> fb.figures(folder)["figure"].tolist(), fb.figures(folder)["holds"].tolist()
    (['one'], [1])
    >>> table = fb.figure(folder, "one")["one"]
    >>> table["n"].tolist(), table["error"].tolist(), table["kind"].tolist()
    ([1, 2], [0.5, nan], ['a', 'b'])
    """
    import pathlib

    made = (_read(path) for path in sorted(pathlib.Path(folder).glob("*.json")))
    found = [one for one in made if one is not None]
    if not found:
        raise ArgumentError("folder", f"'{folder}'", "a folder that `cargo xtask figures --out` made")
    verdicts = [[claim.get("verdict") for claim in one.get("claims", [])] for one in found]
    return Table(
        {
            "figure": [one["id"] for one in found],
            "title": [one["title"] for one in found],
            "source": [one["source"] for one in found],
            "holds": np.array([each.count("pass") for each in verdicts], dtype=np.int64),
            "fails": np.array([each.count("fail") for each in verdicts], dtype=np.int64),
            "seconds": [float(one.get("wall_time_s", np.nan)) for one in found],
        }
    )


def figure(folder: str | PathLike[str], name: str) -> dict[str, Table]:
    """The tables of one figure, by their names. A column has whole numbers, numbers (NaN where a cell is empty) or texts. See `figures`."""
    import csv
    import pathlib

    whole = _read(pathlib.Path(folder) / f"{name}.json")
    if whole is None:
        raise ArgumentError("name", f"'{name}'", "the name of a figure in this folder, see `figures`")
    tables = {}
    for file in whole["files"]:
        with open(pathlib.Path(folder) / file, newline="", encoding="utf-8") as rows:
            head, *cells = list(csv.reader(rows))
        columns = zip(*cells, strict=True) if cells else [()] * len(head)
        tables[pathlib.Path(file).stem] = Table({key: _column(list(column)) for key, column in zip(head, columns, strict=True)})
    return tables


def _read(path: pathlib.Path) -> dict[str, Any] | None:
    import json

    try:
        made = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return made if isinstance(made, dict) and {"id", "title", "source", "files"} <= made.keys() else None


def _column(cells: list[str]) -> Any:
    for kind in (np.int64, np.float64):
        try:
            return np.array([cell if cell or kind is np.int64 else "nan" for cell in cells], dtype=kind)
        except (ValueError, OverflowError):
            continue
    return [cell or None for cell in cells]
