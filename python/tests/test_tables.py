"""Tables of three libraries, both ways: nulls, NaN, infinities, time zones."""

import math
import os
import pickle
from datetime import UTC, date, datetime, timedelta, timezone
from decimal import Decimal

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import fewbits as fb

ZONE = "Europe/Berlin"
STAMPS = [datetime(2026, 3, 29, 0, 59, 59, 500_000, UTC) + timedelta(seconds=k) for k in range(5)]
CELLS = [1.5, None, math.nan, math.inf, -math.inf]


def tables():
    table = pa.table({"t": pa.array(STAMPS, pa.timestamp("us", ZONE)), "x": pa.array(CELLS, pa.float64(), from_pandas=False)})
    return {"pyarrow": table, "polars": pl.DataFrame(table), "pandas": table.to_pandas(types_mapper=pd.ArrowDtype)}


@pytest.mark.parametrize("library", ["pyarrow", "polars", "pandas"])
def test_what_is_no_number_and_zones_survive(tmp_path, library):
    path = tmp_path / "a.fewb"
    fb.write(tables()[library], path, time="t")
    back = fb.read(path)
    for column in (pa.table(back)["x"].to_pylist(), pl.DataFrame(back)["x"].to_list()):
        assert column[:2] == [1.5, None] and math.isnan(column[2]) and column[3:] == CELLS[3:]
    assert pa.table(back)["t"].to_pylist() == STAMPS
    assert pl.DataFrame(back)["t"].to_list() == STAMPS
    assert list(pd.DataFrame.from_arrow(back)["t"]) == STAMPS
    assert list(back.to_pandas()["t"]) == STAMPS and str(back.to_pandas()["t"].dtype).endswith("UTC]")


@pytest.mark.parametrize("library", ["pyarrow", "polars", "pandas"])
def test_times_without_a_zone_return_without_one(tmp_path, library):
    path = tmp_path / "a.fewb"
    naive = [stamp.replace(tzinfo=None) for stamp in STAMPS]
    table = pa.table({"when": pa.array(naive, pa.timestamp("us")), "x": [1.0, 2.0, 3.0, 4.0, 5.0]})
    given = {"pyarrow": table, "polars": pl.DataFrame(table), "pandas": table.to_pandas()}[library]
    fb.write(given, path, time="when")
    assert fb.verify(given, path, time="when")["holds"]
    back = fb.read(path)
    assert pl.DataFrame(back).schema["when"] == pl.Datetime("us") and pa.table(back)["when"].to_pylist() == naive
    assert len(fb.read(path, start=naive[2])) == len(fb.read(path, start=str(naive[2]))) == 3
    assert fb.scan(path).filter(pl.col("when") >= naive[2]).collect().height == 3
    # An instant of a known zone has no place on a clock of an unknown one.
    with pytest.raises(fb.ArgumentError, match="without a zone"):
        fb.read(path, start=STAMPS[2])


@pytest.mark.parametrize("step", [1.0, 0.5, 0.001, 1e-9])
def test_seconds_return_as_seconds(tmp_path, step):
    path, t = tmp_path / "a.fewb", np.round(np.arange(-20, 980) * step, 9)
    frame = pl.DataFrame({"t": t, "a": np.arange(1000.0)})
    fb.write(frame, path, time="t")
    assert np.array_equal(fb.read(path)["t"], t) and fb.open(path).columns == ["t", "a"]
    assert np.array_equal(np.concatenate([block["t"] for block in fb.open(path).select()]), t)
    # What a query reads ahead of its filter changes nothing; nor do other columns than those of the time.
    for query in (
        pl.col("t") > 100,
        pl.col("t") >= -10 * step,
        (pl.col("t") < 100 * step) & (pl.col("t") > 7.5 * step),
        pl.col("t") == 100 * step,
        pl.col("a") > 990,
    ):
        assert fb.scan(path).filter(query).collect().equals(frame.filter(query))


def test_a_column_named_time_stands_beside_the_times(tmp_path):
    path = tmp_path / "a.fewb"
    frame = pl.DataFrame({"t": [0.5, 1.0], "time": [7.0, 8.0], "row": [1.0, 2.0]})
    fb.write(frame, path, time="t")
    assert pl.DataFrame(fb.read(path)).equals(frame) and fb.verify(frame, path, time="t")["holds"]
    # A column of times that is called `row` has times all the same.
    fb.write(frame.select(pl.col("t").alias("row"), "time"), path, time="row")
    assert fb.scan(path).filter(pl.col("row") > 0.7).collect()["time"].to_list() == [8.0]
    assert not fb.open(path).numbered


def test_rows_are_added_to_seconds(tmp_path):
    path = tmp_path / "a.fewb"
    with fb.Recorder(path, {"x": "lossless"}, decimals=1) as recorder:
        recorder.push(0.5, {"x": 1.0})
        recorder.push_table(pl.DataFrame({"time": [1.0, 1.5], "x": [2.0, 3.0]}))
        recorder.push_table(pl.DataFrame({"time": [2, 3], "x": [4, 5]}))
        with pytest.raises(fb.ArgumentError, match="a time in every row"):
            recorder.push_table(pl.DataFrame({"time": [4.0, None], "x": [2.0, 3.0]}))
    assert fb.read(path)["time"].tolist() == [0.5, 1.0, 1.5, 2.0, 3.0] and fb.read(path)["x"].tolist() == [1, 2, 3, 4, 5]
    with fb.Recorder(path, {"x": "lossless"}, decimals=1, utc=True) as recorder:
        recorder.push("2026-01-01T00:00:00.5", {"x": 1.0})
    assert pl.DataFrame(fb.read(path))["time"].to_list() == [datetime(2026, 1, 1, 0, 0, 0, 500_000, UTC)]


LARGE = [
    [2**62 + 1, 2**62 + 2, None, 2**62 + 9],
    [-(2**63), 2**63 - 1, 0, None],
    [1_700_000_000_123_456_789 + 1_000_003 * i for i in range(300)],
    [2**53 + 1] + [0] * 299,
]


@pytest.mark.parametrize("numbers", LARGE)
def test_whole_numbers_beyond_doubles_are_exact(tmp_path, numbers):
    path = tmp_path / "a.fewb"
    frame = pl.DataFrame({"id": pl.Series(numbers, dtype=pl.Int64), "x": np.arange(len(numbers)) / 7})
    for bounds in ("lossless", "1%", {"x": 0.1}):
        fb.write(frame, path, bounds=bounds)
        assert pl.DataFrame(fb.read(path))["id"].equals(frame["id"])
        assert fb.verify(frame, path)["holds"]
    # A number that is off by one is found, and where doubles were recorded the numbers are refused.
    last = max(i for i, number in enumerate(numbers) if number is not None)
    wrong = frame.with_columns(pl.Series("id", numbers[:last] + [numbers[last] - 1] + numbers[last + 1 :], dtype=pl.Int64))
    assert fb.verify(wrong, path)["failed"] == {"id": 1, "x": 0}
    fb.write(frame.with_columns(pl.lit(0.5).alias("id")), path)
    with pytest.raises(fb.ArgumentError, match="numbers that doubles hold"):
        fb.verify(frame, path)


def test_whole_numbers_without_sign(tmp_path):
    path = tmp_path / "a.fewb"
    frame = pl.DataFrame({"id": pl.Series([2**63 - 1, 5], dtype=pl.UInt64)})
    fb.write(frame, path)
    assert fb.read(path)["id"].tolist() == [2**63 - 1, 5] and fb.verify(frame, path)["holds"]
    with pytest.raises(fb.ArgumentError, match="2\\^63"):
        fb.write(pl.DataFrame({"id": pl.Series([2**63], dtype=pl.UInt64)}), path)
    near = pl.DataFrame({"id": [2**60 + i % 50 for i in range(500)]})
    assert min(fb.plan(near)["bits"]) < 9


@pytest.mark.parametrize("library", ["pyarrow", "polars", "pandas"])
def test_the_zone_of_a_time_column_stays_in_a_run(library):
    centre = fb.FusionCentre(fb.Model.walk(0.1), mean=0.0, deviation=1.0)
    centre.join("x", noise=0.5)
    result = centre.run(tables()[library], time="t")
    assert str(pa.table(result).schema.field("t").type) == f"timestamp[us, tz={ZONE}]"
    # Null, NaN and infinities are missing: the mean stays, the deviation grows.
    assert np.all(result["x0"][1:] == result["x0"][0]) and np.all(np.diff(result["x0_sd"]) > 0)
    assert str(result.to_pandas()["t"].dt.tz) == ZONE


def long_of(wide: pl.DataFrame) -> pl.DataFrame:
    return wide.unpivot(index="t", variable_name="who", value_name="what").sort("t", maintain_order=True)


def wide() -> pl.DataFrame:
    rng = np.random.default_rng(3)
    columns = {name: 20 + rng.standard_normal(200) for name in "abc"}
    return pl.DataFrame({"t": np.cumsum(rng.uniform(0.1, 2, 200)), **columns})


def joined(**options) -> fb.FusionCentre:
    centre = fb.FusionCentre(fb.Model.velocity(1e-3), mean=[20, 0], deviation=[3, 0.1], **options)
    centre.join("a", noise=1.0, send="bit")
    centre.join("b", noise=1.0, send="word:3")
    centre.join("c", noise=1.0, send="silent:1.0")
    return centre


@pytest.mark.parametrize("names", [pl.String, pl.Categorical])
def test_long_and_wide_tables_are_the_same(names):
    long = long_of(wide()).with_columns(pl.col("who").cast(names))
    a, b = joined().run(wide(), time="t"), joined().run(long, time="t", by="who", value="what")
    for column in a.columns:
        assert np.array_equal(a[column], b[column]), column
    with pytest.raises(ValueError, match="one of a, b, c"):
        joined().run(long.with_columns(pl.lit("d").alias("who")), time="t", by="who", value="what")


def test_a_stored_centre_goes_on_to_the_bit():
    whole = joined().run(wide(), time="t")
    centre = joined()
    first = centre.run(wide()[:90], time="t")
    for again in (fb.FusionCentre.from_bytes(centre.to_bytes()), pickle.loads(pickle.dumps(centre)), centre):
        rest = again.run(wide()[90:], time="t")
        for column in whole.columns:
            assert np.array_equal(whole[column], np.concatenate([first[column], rest[column]])), column
    bytes_of = centre.to_bytes()
    for at in range(0, len(bytes_of), 7):
        try:
            fb.FusionCentre.from_bytes(bytes_of[:at] + bytes([bytes_of[at] ^ 5]) + bytes_of[at + 1 :])
        except fb.Error:
            pass


def test_live_steps_are_those_of_a_run():
    whole, centre = joined().run(wide(), time="t"), joined()
    for row in wide().iter_rows(named=True):
        now = centre.step(row.pop("t"), row)
    assert now.mean[0] == whole["x0"][-1] and math.sqrt(now.covariance[0, 0]) == whole["x0_sd"][-1]
    centre.join("d", noise=0.1)
    assert centre.step(1e3, {"d": 21.0, "a": None}).mean[0] == pytest.approx(21.0, abs=0.3)


def test_silence_kills_and_a_report_revives():
    centre = fb.FusionCentre(fb.Model.walk(0.01), mean=0.0, deviation=1.0)
    centre.join("a", noise=0.5)
    centre.join("b", noise=0.5, loss=0.1, missing="silence")
    n = 60
    b = [0.1] * 20 + [None] * 30 + [0.1] * 10
    result = centre.run(pl.DataFrame({"t": np.arange(n) * 1.0, "a": [0.0] * n, "b": b}), time="t")
    events = result["events"].tolist()
    assert "b dead" in events and "b alive" in events and 20 < events.index("b dead") < events.index("b alive") == 50


def test_late_values_count():
    made = lambda: fb.FusionCentre(fb.Model.walk(0.1), mean=0.0, deviation=5.0, learn_noise=False, health="off", window=10)  # noqa: E731
    late, sorted_ = made(), made()
    for centre in (late, sorted_):
        centre.join("a", noise=0.5)
    rows = pl.DataFrame({"t": [0.0, 1.0, 3.0, 2.0], "a": [1.0, 1.2, 0.8, 0.9]})
    a, b = late.run(rows, time="t"), sorted_.run(rows.sort("t"), time="t")
    assert a["events"][-1] == "late" and a["x0"][-1] == pytest.approx(b["x0"][-1], abs=1e-12)
    with pytest.raises(ValueError, match="do not decrease"):
        other = joined()
        other.run(pl.DataFrame({"t": [1.0, 0.0], "a": [1.0, 1.0], "b": [1.0, 1.0], "c": [1.0, 1.0]}), time="t")


def test_a_smoother_is_better_and_exact():
    """Against the joint Gaussian of a random walk, conditioned at once."""
    rng, n, q, r = np.random.default_rng(5), 30, 0.3, 0.5
    t = np.cumsum(rng.uniform(0.2, 2, n))
    z = np.cumsum(rng.standard_normal(n)) + rng.standard_normal(n)
    z[[4, 5, 17]] = np.nan
    centre = fb.FusionCentre(fb.Model.walk(q), mean=1.0, deviation=2.0, learn_noise=False, health="off")
    centre.join("a", noise=math.sqrt(r))
    found = centre.run(pl.DataFrame({"t": t, "a": z}), time="t", smooth=True)
    prior = 4.0 + q * np.minimum.outer(t - t[0], t - t[0])
    seen = ~np.isnan(z)
    gain = prior[:, seen] @ np.linalg.inv(prior[np.ix_(seen, seen)] + r * np.eye(seen.sum()))
    mean = 1.0 + gain @ (z[seen] - 1.0)
    deviation = np.sqrt(np.diag(prior - gain @ prior[seen]))
    assert np.allclose(found["x0_smooth"], mean, atol=1e-10) and np.allclose(found["x0_smooth_sd"], deviation, atol=1e-10)


def test_a_reverting_model_smooths_with_its_offset():
    model = fb.Model.reverting(mean=20.0, time_constant=3.0, variance=4.0)
    centre = fb.FusionCentre(model, mean=20.0, deviation=2.0, learn_noise=False, health="off")
    centre.join("a", noise=0.5)
    t, z = np.array([0.0, 1.0, 2.5]), np.array([22.0, 21.0, 19.0])
    found = centre.run(pl.DataFrame({"t": t, "a": z}), time="t", smooth=True)
    prior = 4.0 * np.exp(-np.abs(np.subtract.outer(t, t)) / 3.0)
    mean = 20 + prior @ np.linalg.inv(prior + 0.25 * np.eye(3)) @ (z - 20)
    assert np.allclose(found["x0_smooth"], mean, atol=1e-10)


def test_a_lazy_frame_reads_only_what_it_needs(tmp_path):
    path, n = tmp_path / "a.fewb", 300_000
    t = np.datetime64("2026-01-01", "ms") + np.arange(n) * np.timedelta64(1000, "ms")
    frame = pl.DataFrame({"t": t, "a": np.sin(np.arange(n) / 9), "b": np.arange(n) * 1.0})
    fb.write(frame, path, time="t", effort="fast")
    start, end = datetime(2026, 1, 2), datetime(2026, 1, 2, 1)
    lazy = fb.scan(path)
    assert lazy.collect_schema() == frame.schema
    query = (pl.col("t") >= start) & (pl.col("t") < end) & (pl.col("b") % 2 == 0)
    assert lazy.filter(query).select("a").collect().equals(frame.filter(query).select("a"))
    assert lazy.head(7).collect().height == 7 and lazy.select(pl.len()).collect().item() == n
    from fewbits._polars import _range

    low, high = _range((pl.col("t") >= start) & (start < pl.col("t")) & (pl.col("t") < end), "t", False)
    assert high - low == 3602 and _range(pl.col("a") > 3, "t", False) == (None, None)
    assert _range((pl.col("row") >= 5) | (pl.col("row") < 2), "row", True) == (None, None)


@pytest.mark.parametrize("columns", [["a"], [], None])
def test_some_columns_of_no_rows_are_an_empty_table(tmp_path, columns):
    path = tmp_path / "room.fewb"
    fb.write(fb.Table({"t": np.arange(30.0), "a": np.arange(30.0), "b": np.arange(30.0)}), path, time="t")
    names = ["t", *(["a", "b"] if columns is None else columns)]
    for start, end in [(100, 200), (20, 10), (5.5, 5.75), (-9, -1)]:
        empty = fb.read(path, columns=columns, start=start, end=end)
        assert empty.columns == names and len(empty) == 0
        with fb.open(path) as recording:
            assert list(recording.select(columns, start=start, end=end)) == []
    assert fb.read(path, columns=columns, start=20, end=22)["t"].tolist() == [20, 21]


def test_rows_come_block_by_block(tmp_path):
    path, n = tmp_path / "a.fewb", 200_000
    fb.write(pl.DataFrame({"a": np.arange(n) * 1.0}), path, effort="fast")
    recording = fb.open(path)
    blocks = [len(block) for block in recording.select(start=10, end=n - 10)]
    assert len(blocks) > 2 and sum(blocks) == n - 20
    first = next(iter(recording.select()))
    assert first["a"][0] == 0.0
    assert pa.RecordBatchReader.from_stream(recording).read_all().num_rows == n


def test_a_recorder_is_read_while_and_after(tmp_path):
    path = tmp_path / "a.fewb"
    with fb.Recorder(path, {"x": 0.1, "y": "lossless"}, decimals=3, utc=True) as recorder:
        for k in range(2000):
            recorder.push(np.datetime64("2026-01-01", "ms") + k, {"x": math.sin(k / 100), "y": k})
        recorder.sync()
        assert len(fb.read(path, damage="skip")) == 2000 and not fb.open(path).finished
        with pytest.raises(fb.DecodeError, match="not finished"):
            fb.read(path)
        recorder.push("2026-01-02", {"y": None})
        recorder.push(datetime(2026, 1, 3, 2, tzinfo=timezone(timedelta(hours=2))), {})
    with fb.Recorder(path, resume=True) as recorder:
        recorder.push_table(pl.DataFrame({"time": [datetime(2026, 1, 4)], "x": [0.5], "y": [1]}))
    back = fb.read(path)
    assert len(back) == 2003 and back["time"][-2] == np.datetime64("2026-01-03T00:00") and back["y"][1999] == 1999
    with pytest.raises(ValueError, match="closed"):
        recorder.push(0.0, {})
    with pytest.raises(ValueError, match="column"):
        fb.Recorder(tmp_path / "b", {"x": 0.1}).push(None, {"z": 1.0})


def test_zarr_and_numcodecs(tmp_path):
    zarr = pytest.importorskip("zarr")
    from fewbits.numcodecs import Bounded as Codec
    from fewbits.zarr import Bounded

    rng = np.random.default_rng(2)
    for dtype in ("f8", "f4", "f2", "i8", "u1"):
        x = (100 * np.cumsum(rng.standard_normal((60, 50)), axis=0)).astype(dtype)
        if dtype[0] == "f":
            x[3, 4] = np.nan
        store = tmp_path / f"{dtype}.zarr"
        z = zarr.create_array(store, shape=x.shape, chunks=(25, 50), dtype=x.dtype, serializer=Bounded(bound=0.5), compressors=None)
        z[:] = x
        back = zarr.open_array(store)[:]
        codec = Codec(bound=0.5, dtype=x.dtype.str)
        other = codec.decode(codec.encode(x)).reshape(x.shape)
        for y in (back, other):
            assert y.dtype == x.dtype
            error = np.abs(y.astype("f8") - x.astype("f8"))
            assert np.nanmax(error) <= (0.5 if dtype[0] == "f" else 0)
            assert np.array_equal(np.isnan(y), np.isnan(x)) if dtype[0] == "f" else True
        assert codec.get_config() == {"id": "fewbits", "bound": 0.5, "dtype": x.dtype.str, "effort": "thorough"}
    with pytest.raises(ValueError, match="finite number above 0"):
        Bounded(bound=-1)


def test_a_picture_has_lines_and_bands():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    axes = joined().run(wide(), time="t").plot(band=0.5)
    assert len(axes.lines) == len(axes.collections) == 2
    with pytest.raises(ValueError, match="one of"):
        joined().run(wide(), time="t").plot(y="none")


def test_dates_decimals_and_durations_are_taken(tmp_path):
    days = [date(2026, 1, 1) + timedelta(days=3 * i) for i in range(40)]
    table = pa.table(
        {
            "day": pa.array(days),
            "price": pa.array([None if i == 7 else Decimal(2013 + i) / 100 for i in range(40)], pa.decimal128(9, 2)),
            "lasted": pa.array([timedelta(milliseconds=1500 * i) for i in range(40)], pa.duration("ms")),
        }
    )
    fb.write(table, tmp_path / "days.fewb", time="day")
    assert fb.verify(table, tmp_path / "days.fewb", time="day")["holds"]
    read = fb.read(tmp_path / "days.fewb")
    assert np.array_equal(read["price"], [np.nan if i == 7 else (2013 + i) / 100 for i in range(40)], equal_nan=True)
    assert np.array_equal(read["lasted"], 1.5 * np.arange(40))
    assert pl.DataFrame(read)["day"].dt.date().to_list() == days
    centre = fb.FusionCentre(fb.Model.walk(1e-6), mean=20.0, deviation=1.0)
    centre.join("price", noise=0.05)
    result = centre.run(table, time="day")
    assert len(result) == 40 and abs(result["x0"][-1] - 20.5) < 0.2


def test_a_live_centre_goes_on_from_timestamps():
    stamps = pd.date_range("2026-01-01", periods=4, freq="10min", tz="UTC", name="when")
    frame = pd.DataFrame({"a": [1.0, 1.2, 0.9, 1.4]}, index=stamps)

    def centre():
        made = fb.FusionCentre(fb.Model.walk(1e-4), mean=0.0, deviation=1.0)
        made.join("a", noise=0.3, send="bit")
        return made

    whole, live, steps = centre(), centre(), centre()
    expected = whole.run(frame, time="when")["x0"][-1]
    live.run(frame.iloc[:3], time="when")
    steps.step("2026-01-01T00:00:00", {"a": 1.0})
    steps.step(np.datetime64("2026-01-01T00:10"), {"a": 1.2})
    steps.step(stamps[2].tz_convert("Asia/Kolkata"), {"a": 0.9})
    for one in (live, fb.FusionCentre.from_bytes(live.to_bytes()), steps):
        assert one.step(stamps[3].to_pydatetime(), {"a": 1.4}).mean[0] == expected
    with pytest.raises(fb.ArgumentError, match="timestamps, as in the runs before"):
        live.step(5.0, {"a": 1.0})
    seconds = centre()
    seconds.step(0.0, {"a": 1.0})
    for wrong in (stamps[0], "2026-01-01"):
        with pytest.raises(fb.ArgumentError, match="seconds, as in the runs before"):
            seconds.step(wrong, {"a": 1.0})
    for wrong in (pd.NaT, "yesterday", None):
        with pytest.raises(fb.ArgumentError, match="time"):
            live.step(wrong, {"a": 1.0})


@pytest.mark.parametrize("utc", [True, False])
def test_a_recorder_names_its_times(tmp_path, utc):
    path = tmp_path / "a.fewb"
    times = pd.date_range("2026-01-01", periods=3, tz="UTC", name="when") if utc else [0.5, 1.0, 2.5]
    frame = pd.DataFrame({"x": [1.0, np.nan, 3.0], "other": ["a", "b", "c"]}, index=pd.Index(times, name="when"))
    with fb.Recorder(path, {"x": "lossless"}, time="when", decimals=1, utc=utc) as recorder:
        recorder.push_table(frame.iloc[:2])
        recorder.push_table(pl.DataFrame(frame[["x"]].reset_index())[2:])
    assert fb.read(path).columns == ["when", "x"] and fb.verify(frame[["x"]], path, time="when")["holds"]
    # The name stays when the recording is continued, and another one is refused.
    with pytest.raises(fb.ArgumentError, match="'when', as in the recording"):
        fb.Recorder(path, time="at", resume=True)
    later = pd.date_range("2026-01-05", periods=1, tz="UTC") if utc else [3.0]
    with fb.Recorder(path, time="when", resume=True) as recorder:
        recorder.push_table(pa.table({"x": [4.0], "when": pa.array(later)}))
        with pytest.raises(fb.ArgumentError, match="'time': expected one of"):
            recorder.push_table(pa.table({"x": [4.0], "at": pa.array(later)}))
    assert fb.read(path)["x"].tolist()[-1] == 4.0 and len(fb.read(path)) == 4
    with pytest.raises(fb.ArgumentError, match="given without `decimals`"):
        fb.Recorder(tmp_path / "b.fewb", {"x": 1}, time="when")


def test_tables_that_cannot_be_read_are_named(tmp_path):
    def refused(table, text, **given):
        with pytest.raises(fb.ArgumentError, match=text):
            fb.write(table, tmp_path / "a.fewb", **given)

    column = pd.Series([1.0], name="x")
    refused(column, "to_frame")
    refused(pl.Series("x", [1.0]), "to_frame")
    refused(pl.DataFrame({"x": pl.Series([2**100], dtype=pl.Int128)}), "columns that can be read")
    stamped = pd.DataFrame({"x": [1.0]}, index=pd.date_range("2026-01-01", periods=1))
    refused(stamped, "rename_axis")
    refused(stamped, "rename_axis", time="index")


def of_nothing(library):
    """A column of numbers, one of None without a type, and one with a single number."""
    columns = {"t": [0.0, 1.0, 2.0], "a": [1.0, None, 2.0], "b": [None, None, None], "c": [None, 3.0, None]}
    if library == "polars":
        frame = pl.DataFrame(columns)
        assert frame.schema["b"] == pl.Null
    elif library == "pyarrow":
        frame = pa.table(columns)
        assert frame.schema.field("b").type == pa.null()
    else:
        frame = pd.DataFrame(columns, dtype=object).astype({"t": float, "a": float, "c": float})
        assert frame["b"].dtype == object
    return frame


@pytest.mark.parametrize("library", ["polars", "pyarrow", "pandas"])
def test_columns_of_nulls_without_a_type_are_gaps(library, tmp_path):
    # What these libraries make of a column of None: a sensor that has said nothing yet.
    frame = of_nothing(library)
    fb.write(frame, tmp_path / "a.fewb", time="t", bounds="±0.01")
    back = fb.read(tmp_path / "a.fewb")
    assert np.isnan(back["b"]).all() and np.isnan(back["a"]).tolist() == [False, True, False]
    assert fb.verify(frame, tmp_path / "a.fewb", time="t")["holds"]
    assert len(fb.plan(frame, time="t")) > 0
    results = []
    for sensors in ("abc", "ac"):
        centre = fb.FusionCentre(fb.Model.walk(0.1), mean=0.0, deviation=3.0)
        for name in sensors:
            centre.join(name, noise=0.5)
        results.append(centre.run(frame, time="t")["x0"])
    assert np.array_equal(*results)
    grid = fb.GridFilter(lambda x, dt: x, lambda x, dt: 1.0, {"b": lambda x, z: -np.abs(x - z)}, lower=-9, upper=9, spacing=0.5, start=(0, 1))
    assert (grid.run(frame, time="t")["log_likelihood"] == 0).all()


def test_offsets_from_utc_are_read_in_texts(tmp_path):
    # NumPy warns of them; here warnings are errors.
    frame = pl.DataFrame({"t": np.datetime64("2026-03-28T22:00:00", "ns") + np.arange(12) * np.timedelta64(1_800_000_000_000, "ns"), "x": np.arange(12.0)})
    zoned = frame.with_columns(pl.col("t").dt.replace_time_zone("UTC"))
    fb.write(zoned, tmp_path / "a.fewb", time="t")
    for start, end in (
        ("2026-03-29T00:00:00+01:00", "2026-03-29T04:00:00+02:00"),
        ("2026-03-28T23:00:00Z", "2026-03-29 02:00:00Z"),
        ("2026-03-28T17:30:00.000000000-05:30", "2026-03-29T02:00:00"),
    ):
        assert fb.read(tmp_path / "a.fewb", start=start, end=end)["x"].tolist() == [2, 3, 4, 5, 6, 7], start
    with pytest.raises(fb.ArgumentError, match="offset"):
        fb.read(tmp_path / "a.fewb", start="2026-03-29T00:00:00+99:00")
    fb.write(frame, tmp_path / "b.fewb", time="t")
    with pytest.raises(fb.ArgumentError, match="without a zone"):
        fb.read(tmp_path / "b.fewb", start="2026-03-29T00:00:00+01:00")
    with fb.Recorder(tmp_path / "c.fewb", {"x": "±0.1"}, utc=True, decimals=9) as recorder:
        recorder.push("2026-03-29T00:00:00.123456789+01:00", {"x": 1.0})
    assert fb.read(tmp_path / "c.fewb")["time"][0] == np.datetime64("2026-03-28T23:00:00.123456789")


def test_objects_of_python_are_named():
    rows = pl.DataFrame([{"t": np.datetime64("2026-01-01"), "x": 1.0}])
    if rows.schema["t"] != pl.Object:
        pytest.skip("polars reads NumPy's times in rows")
    with pytest.raises(fb.ArgumentError, match="'t' of Python objects"):
        fb.fit(rows, time="t")


def test_columns_keep_masks_and_zones():
    stamps = np.array(["2026-01-01", "NaT", "2026-01-03"], "M8[s]")
    given = {"x": np.array([1.0, 2.0, 3.0]), "n": np.array([1, 2, 3]), "b": np.array([True, False, True]), "t": stamps}
    table = pa.table(fb.Table({name: np.ma.array(column, mask=[1, 0, 0]) for name, column in given.items()}))
    assert table["x"].to_pylist() == [None, 2.0, 3.0] and table["n"].to_pylist() == [None, 2, 3] and table["b"].to_pylist() == [None, False, True]
    assert table["t"].to_pylist() == [None, None, datetime(2026, 1, 3)]
    for zoned in (pl.Series(STAMPS).dt.convert_time_zone(ZONE), pd.Series(pd.DatetimeIndex(STAMPS).tz_convert(ZONE))):
        table = pa.table(fb.Table({"t": zoned}))
        assert table.schema.field("t").type == pa.timestamp("ns", ZONE) and table["t"].to_pylist() == STAMPS
    offset = pd.Series(pd.DatetimeIndex(STAMPS).tz_convert(timezone(timedelta(hours=2))))
    assert pl.DataFrame(fb.Table({"t": offset}))["t"].to_list() == STAMPS
    # They would be the years 1830 and 1970.
    for wrong in (np.array(["3000-01-01"], "M8[s]"), np.array([1500], "M8[ps]"), np.array([2**63], "u8")):
        with pytest.raises(fb.ArgumentError, match="columns"):
            fb.Table({"t": wrong})


def test_periods_are_no_seconds(tmp_path):
    frame = pd.DataFrame({"t": pd.period_range("2026", periods=3, freq="D"), "a": [0.2, 0.3, 0.4]})
    centre = fb.FusionCentre(fb.Model.walk(0.1), mean=0.0, deviation=1.0)
    centre.join("a", noise=0.5)
    for use in (lambda: centre.run(frame, time="t"), lambda: fb.write(frame, tmp_path / "a.fewb", time="a")):
        with pytest.raises(fb.ArgumentError, match="periods"):
            use()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes")
def test_links_rights_and_devices_stay(tmp_path):
    frame = pl.DataFrame({"v": [1.0]})
    target, link, device = tmp_path / "target", tmp_path / "link", tmp_path / "device"
    target.write_text("earlier")
    target.chmod(0o640)
    link.symlink_to(target)
    size = fb.write(frame, link)
    assert link.is_symlink() and target.stat().st_size == size and target.stat().st_mode & 0o777 == 0o640
    os.mkfifo(device)
    reader = os.open(device, os.O_RDONLY | os.O_NONBLOCK)
    assert fb.write(frame, device) == len(os.read(reader, 1000)) and device.is_fifo()
    os.close(reader)
    fresh = tmp_path / "fresh"
    fb.write(frame, fresh)
    (tmp_path / "plain").write_text("")
    assert fresh.stat().st_mode == (tmp_path / "plain").stat().st_mode
    if os.geteuid() != 0:
        target.chmod(0o400)
        with pytest.raises(PermissionError):
            fb.write(frame, target)


def test_rows_of_a_range_lie_in_it(tmp_path):
    path = tmp_path / "a.fewb"
    fb.write(pl.DataFrame({"t": [0.0, 1.0, 2.0, 3.0], "v": [0, 1, 2, 3]}), path, time="t")
    for start, end, rows in [(1.4, None, [2, 3]), (1.0, 2.0, [1]), (None, 2.5, [0, 1, 2])]:
        assert list(fb.read(path, start=start, end=end)["v"]) == rows
    stamps = np.datetime64("2026-03-01T10:00:00", "s") + np.arange(3)
    fb.write(pl.DataFrame({"t": pa.array(stamps), "v": [0, 1, 2]}), path, time="t")
    assert list(fb.read(path, start="2026-03-01T10:00:00.5")["v"]) == [1, 2]


def test_texts_are_no_times(tmp_path):
    with pytest.raises(fb.ArgumentError, match="to_datetime"):
        fb.write(pl.DataFrame({"t": ["2026-03-01"], "v": [1.0]}), tmp_path / "a.fewb", time="t")
