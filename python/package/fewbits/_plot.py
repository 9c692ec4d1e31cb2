"""Pictures of results, with matplotlib if it is there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .errors import ArgumentError

if TYPE_CHECKING:
    from ._fewbits import Table


def plot(table: Table, *, x: str | None = None, y: str | list[str] | None = None, band: float = 0.95, ax: Any = None) -> Any:
    """Draws columns of a table over its first column, or over `x`, and returns the axes of matplotlib.

    A column `name` that has a column `name_sd` beside it gets a band that holds the share `band` of a normal distribution. Without `y` all
    such columns are drawn, or, if there is none, all columns of numbers.

    >>> import matplotlib; matplotlib.use("Agg")
    >>> import fewbits as fb
    >>> axes = fb.Table({"t": [0.0, 1.0], "x0": [1.0, 2.0], "x0_sd": [0.1, 0.2]}).plot()
    >>> axes.get_xlabel(), len(axes.lines), len(axes.collections)
    ('t', 1, 1)
    """
    if not 0 < band < 1:
        raise ArgumentError("band", str(band), "a share between 0 and 1")
    names = table.columns
    x = names[0] if x is None else x
    if not isinstance(x, str):
        raise ArgumentError("x", type(x).__name__, "the name of a column")
    drawn = [y] if isinstance(y, str) else y
    if drawn is None:
        drawn = [name for name in names if f"{name}_sd" in names]
    if isinstance(drawn, (list, tuple)) and not drawn:
        drawn = [name for name in names if name != x and table[name].dtype.kind in "fiu"]
    for name in [x, *drawn]:
        if not isinstance(name, str) or name not in names:
            raise ArgumentError("y", f"'{name}'", f"one of {', '.join(names)}")
    from statistics import NormalDist

    import matplotlib.pyplot as plt

    axes = plt.subplots()[1] if ax is None else ax
    reach = NormalDist().inv_cdf(0.5 + band / 2)
    for name in drawn:
        (line,) = axes.plot(table[x], table[name], label=name)
        if f"{name}_sd" in names:
            half = reach * table[f"{name}_sd"]
            axes.fill_between(table[x], table[name] - half, table[name] + half, color=line.get_color(), alpha=0.2, linewidth=0)
    axes.set_xlabel(x)
    axes.legend()
    return axes
