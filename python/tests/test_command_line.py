"""A recording has the same bytes whether Python or the command `fewbits` wrote it."""

import os
import pathlib
import subprocess

import numpy as np
import polars as pl
import pytest

import fewbits as fb

HERE = pathlib.Path(__file__).resolve().parent
COMMAND = pathlib.Path(os.environ.get("FEWBITS_COMMAND", HERE.parents[1] / "target" / "debug" / "fewbits"))


def series() -> dict[str, np.ndarray]:
    rng, n = np.random.default_rng(11), 4000
    steps = np.cumsum(rng.standard_normal(n))
    gaps = np.sin(np.arange(n) / 50)
    gaps[rng.random(n) < 0.05] = np.nan
    return {
        "walk": steps,
        "decimals": np.round(20 + steps / 10, 2),
        "counts": rng.poisson(3, n).astype(float),
        "noise": rng.standard_normal(n),
        "constant": np.full(n, 4.25),
        "gaps": gaps,
        "large": 1e12 * np.exp(steps / 100),
        "single": np.float64(np.float32(steps)),
    }


@pytest.mark.skipif(not COMMAND.exists(), reason="the command is not built")
@pytest.mark.parametrize("bound", ["1%", "±0.001", "lossless"])
@pytest.mark.parametrize("name", series())
def test_bytes_are_those_of_the_command(tmp_path, name, bound):
    x = series()[name]
    text = "\n".join(["x", *("" if np.isnan(v) else repr(float(v)) for v in x), ""])
    (tmp_path / "a.csv").write_text(text)
    subprocess.run(
        [COMMAND, "pack", tmp_path / "a.csv", "--bound", bound, "-o", tmp_path / "command"], check=True, capture_output=True
    )
    fb.write(pl.DataFrame({"x": x}).with_columns(pl.col("x").fill_nan(None)), tmp_path / "python", bounds=bound)
    assert (tmp_path / "command").read_bytes() == (tmp_path / "python").read_bytes()
