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


def many(n: int = 400) -> dict[str, np.ndarray]:
    """75 series: 15 kinds in five scales."""
    found = {}
    for scale in (1e-6, 0.01, 1.0, 37.0, 1e9):
        rng = np.random.default_rng(int(np.log(scale) + 100))
        t, steps = np.arange(n), np.cumsum(rng.standard_normal(n))
        kinds = {
            "sine": np.sin(t / 20),
            "steep": np.exp(t / 90.0),
            "trend": 0.3 * t + rng.standard_normal(n),
            "walk": steps,
            "twice": np.cumsum(steps),
            "saw": (t % 60).astype(float),
            "levels": np.repeat(rng.integers(0, 4, n // 20), 20).astype(float),
            "spikes": np.where(rng.random(n) < 0.02, 100.0, 0.0) + 0.1 * rng.standard_normal(n),
            "heavy": rng.standard_cauchy(n),
            "rounded": np.round(steps, 1),
            "rests": np.repeat(steps[::10], 10),
            "counter": np.cumsum(rng.poisson(2, n)).astype(float),
            "random": rng.random(n),
            "gaps": np.where(rng.random(n) < 0.3, np.nan, np.cos(t / 9)),
            "late": np.where(t < n // 2, np.nan, steps),
        }
        found |= {f"{kind} {scale:g}": scale * x for kind, x in kinds.items()}
    return found


def check(folder: pathlib.Path, columns: dict[str, np.ndarray], bound: str) -> None:
    """The recordings of the command, which reads a text, and of Python."""
    rows = zip(*(["" if np.isnan(v) else repr(v) for v in x.tolist()] for x in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(row) for row in rows), ""]
    (folder / "a.csv").write_text("\n".join(lines))
    subprocess.run([COMMAND, "pack", folder / "a.csv", "--bound", bound, "-o", folder / "command"], check=True, capture_output=True)
    fb.write(pl.DataFrame(columns).fill_nan(None), folder / "python", bounds=bound)
    assert (folder / "command").read_bytes() == (folder / "python").read_bytes()


@pytest.mark.skipif(not COMMAND.exists(), reason="the command is not built")
@pytest.mark.parametrize("bound", ["1%", "±0.001", "lossless"])
@pytest.mark.parametrize("name", series())
def test_bytes_are_those_of_the_command(tmp_path, name, bound):
    check(tmp_path, {"x": series()[name]}, bound)


@pytest.mark.skipif(not COMMAND.exists(), reason="the command is not built")
@pytest.mark.parametrize("bound", ["1%", "±0.001", "lossless"])
def test_bytes_of_many_series_are_those_of_the_command(tmp_path, bound):
    columns = many()
    assert len(columns) == 75
    check(tmp_path, columns, bound)


@pytest.mark.skipif(not COMMAND.exists(), reason="the command is not built")
def test_words_of_the_command_are_texts(tmp_path):
    table, path = tmp_path / "a.csv", tmp_path / "a.fewb"
    table.write_text("t,door,v\n1,open,5\n2,closed,6\n3,,7\n")
    subprocess.run([COMMAND, "pack", table, "--time", "exact", "-o", path], check=True, capture_output=True)
    assert pl.DataFrame(fb.read(path))["door"].to_list() == ["open", "closed", None]
    assert fb.scan(path).filter(pl.col("door") == "closed").collect()["v"].to_list() == [6.0]
    assert fb.read(path, columns=["v"])["v"].tolist() == [5.0, 6.0, 7.0]
