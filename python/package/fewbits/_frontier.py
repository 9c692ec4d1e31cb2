"""What each way of sending costs and gives, on one world."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from ._fewbits import FusionCentre, Generator, Model, Table
from .errors import ArgumentError, ArgumentTypeError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    _Doubles: TypeAlias = NDArray[np.float64]
    _Own: TypeAlias = Callable[[_Doubles, _Doubles], tuple[ArrayLike, float]]


def frontier(
    model: Model,
    *,
    sensors: int,
    noise: float,
    times: ArrayLike,
    mean: ArrayLike,
    deviation: ArrayLike,
    sends: Sequence[str] = ("bit", "word:2", "word:3", "word:4", "silent:1.0", "silent:2.0", "value"),
    own: Mapping[str, _Own] | None = None,
    reads: int = 0,
    trials: int = 20,
    seed: int,
) -> Table:
    """Error and bits of each way of sending, on the same random worlds, a row each.

    In a world the state moves by `model` from a start drawn from `mean` and `deviation`; `sensors` of deviation `noise` read coordinate
    `reads` at all `times` (seconds). A scheme of one's own is a function of the times and the samples, (times, sensors), that returns its
    estimates of that coordinate and the number of bits it sent. `rmse` has a standard error over the worlds; `within` is the share of truths
    in the band of 95 % (NaN for one's own); `pareto` says that no other scheme has both fewer bits and a smaller error.

    >>> import fewbits as fb
    >>> front = fb.frontier(
    ...     fb.Model.walk(0.1), sensors=2, noise=1.0, times=range(50), mean=0.0, deviation=1.0, sends=["bit", "value"], trials=5, seed=1,
    ...     own={"mean": lambda times, samples: (samples.mean(axis=1), 64 * samples.size)},
    ... )
    >>> front["scheme"].tolist(), front["bits"].tolist()
    (['bit', 'value', 'mean'], [1.0, 64.0, 64.0])
    >>> bool(front["rmse"][1] < front["rmse"][0]), front["pareto"].tolist()
    (True, [True, True, False])
    """
    for name, count in (("sensors", sensors), ("trials", trials), ("reads", reads)):
        if not hasattr(count, "__index__"):
            raise ArgumentTypeError(name, repr(count), "a whole number")
    if not hasattr(noise, "__float__"):
        raise ArgumentTypeError("noise", repr(noise), "a number")
    if not isinstance(model, Model):
        raise ArgumentTypeError("model", repr(model), "a Model")
    for name, count in (("sensors", sensors), ("trials", trials)):
        if count < 1:
            raise ArgumentError(name, str(count), "1 or more")
    if not 0 <= reads < model.dimension:
        raise ArgumentError("reads", str(reads), f"0 to {model.dimension - 1}, a coordinate of the model")
    when = np.asarray(times, dtype=np.float64).reshape(-1)
    if when.size == 0:
        raise ArgumentError("times", "no times", "one or more")
    centre = np.broadcast_to(np.asarray(mean, dtype=np.float64), model.dimension)
    spread = np.broadcast_to(np.asarray(deviation, dtype=np.float64), model.dimension)
    schemes: list[tuple[str, _Own | None]] = [(send, None) for send in sends] + list((own or {}).items())
    squares = np.zeros((len(schemes), trials))
    bits = np.zeros(len(schemes))
    within = np.full(len(schemes), np.nan)
    within[: len(sends)] = 0.0
    rng = Generator(seed)
    for trial in range(trials):
        start = centre + spread * rng.standard_normal(model.dimension)
        path = model.simulate(when, start=start, seed=seed + trial)[:, reads]
        samples = path[:, None] + noise * rng.standard_normal(when.size * sensors).reshape(when.size, sensors)
        columns: dict[str, Any] = {"t": when, **{f"s{i}": samples[:, i] for i in range(sensors)}}
        table = Table(columns)
        for row, (name, mine) in enumerate(schemes):
            if mine is None:
                made = FusionCentre(model, mean=centre, deviation=spread, learn_noise=False)
                for i in range(sensors):
                    made.join(f"s{i}", reads=reads, noise=noise, send=name)
                run = made.run(table, time="t")
                error = run[f"x{reads}"] - path
                within[row] += float(np.mean(np.abs(error) <= 1.959963984540054 * run[f"x{reads}_sd"])) / trials
                sent = float(run["bits"].sum())
            else:
                estimates, sent = mine(when, samples)
                error = np.asarray(estimates, dtype=np.float64) - path
                if error.shape != path.shape:
                    raise ArgumentError("own", f"{error.shape} from '{name}'", f"estimates of shape {path.shape}")
            squares[row, trial] = np.mean(error**2)
            bits[row] += sent / (trials * when.size * sensors)
    rmse = np.sqrt(squares.mean(axis=1))
    spread_of = squares.std(axis=1, ddof=1) / np.sqrt(trials) / (2 * rmse) if trials > 1 else np.full(len(schemes), np.nan)
    better = (bits[:, None] >= bits) & (rmse[:, None] >= rmse) & ((bits[:, None] > bits) | (rmse[:, None] > rmse))
    return Table(
        {
            "scheme": [name for name, _ in schemes],
            "bits": bits,
            "rmse": rmse,
            "rmse_se": spread_of,
            "within": within,
            "pareto": ~better.any(axis=1),
        }
    )
