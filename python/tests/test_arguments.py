"""Any arguments: a result, or an exception that says what is expected; never a panic, never the end of the interpreter."""

import math
import os
import subprocess
import sys

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import fewbits as fb

anything = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**70), 2**70),
    st.floats(),
    st.text(max_size=5),
    st.binary(max_size=40),
    st.lists(st.floats(), max_size=4),
    st.lists(st.lists(st.floats(-10, 10), min_size=2, max_size=2), max_size=3),
    st.dictionaries(st.sampled_from(["a", "t", "*", 1, None, b"a"]), st.one_of(st.floats(), st.text(max_size=4)), max_size=2),
    hnp.arrays(st.sampled_from(["f8", "f4", "i8", "u8", "i2", "?", "U2"]), hnp.array_shapes(min_dims=0, max_dims=3, max_side=4)),
    st.just(lambda *given: np.zeros(3)),
    st.builds(lambda: pl.DataFrame({"t": [0.0, 1.0], "a": [1.0, None]})),
    st.builds(lambda: pa.table({"t": [0, 1], "a": ["x", None]})),
    st.builds(lambda: pa.table({"t": pa.array([], pa.timestamp("ms", "UTC")), "a": pa.array([], pa.float64())})),
)


def centre():
    made = fb.FusionCentre(fb.Model.walk(0.1), mean=0.0, deviation=1.0)
    made.join("a", noise=0.5)
    return made


def filtering():
    return fb.ParticleFilter(np.zeros((1, 3)), lambda x, dt, rng: None, lambda x, z: np.zeros(3), seed=1)


def grid():
    return fb.GridFilter(lambda x, dt: x, lambda x, dt: 1.0, lambda x, z: -np.abs(x), lower=-2, upper=2, spacing=0.5, start=(0, 1))


def lattice():
    return fb.LatticeFilter(
        lambda x, dt: x, lambda x, dt: 1.0, lambda x, z: -np.abs(x[0]), lower=[-2, -2], upper=[2, 2], spacing=[0.5, 1.0], start=([0, 0], [1, 1])
    )


def ensemble():
    return fb.EnsembleFilter(np.array([[0.0, 1.0], [1.0, 0.0]]), lambda x, dt, rng: None, lambda x: x[0], noise=1.0, seed=1)


def sigma(**given):
    made = {"process": np.eye(2), "noise": 1.0, "mean": [0.0, 0.0], "deviation": [1.0, 1.0], **given}
    return fb.SigmaPointFilter(lambda x, dt: None, lambda x: x[0], **made)


def search():
    return fb.SourceSearch(
        [[0.0, 0.0], [5.0, 0.0]], reach=9.0, instants=[5.0], noise=1e-5, diffusivity=40.0, rate=1.0, box=((-9, -9), (9, 9))
    )


def in_rooms():
    setting = {"reach": 9.0, "instants": [5.0], "noise": 0.1, "diffusivity": 0.1, "rate": 1.0, "box": ((0, 0), (4, 2))}
    return fb.SourceSearch([[0.5, 0.5], [3.5, 1.5]], plan="kk#bb\nkk.bb\nk = kitchen\nb = bath", flow=0.0, **setting)


ANCHORS = {"A": (0.0, 0.0), "B": (9.0, 0.0), "C": (0.0, 9.0)}


def small(count):
    """Without the numbers that fill the memory of the machine."""
    return 0 if isinstance(count, int) and 10**6 < count <= 2**32 else count


DESIGN = fb.design(prior=(0.0, 1.0), noise=[1.0, 1.0], bits=[1, 1])
CALLS = {
    "encode": (fb.encode, ["samples"], ["bound", "effort"]),
    "decode": (fb.decode, ["frame"], ["out"]),
    "normalise": (fb.normalise, ["log_weights"], []),
    "resample": (lambda *a, **k: fb.resample(*a, **{"seed": 1, **k}), ["weights"], ["scheme", "seed"]),
    "plan": (fb.plan, ["table"], ["time"]),
    "OneBit": (fb.OneBit, [], ["a", "process", "noise", "flips"]),
    "OneBit.run": (fb.OneBit(a=0.9, process=0.5, noise=1.0).run, ["samples"], ["mean", "variance"]),
    "OneBit.run_bits": (fb.OneBit(a=0.9, process=0.5, noise=1.0).run_bits, ["bits"], ["mean", "variance"]),
    "OneBit.step": (fb.OneBit(a=0.9, process=0.5, noise=1.0).step, ["bit"], ["mean", "variance"]),
    "Model.walk": (fb.Model.walk, ["density"], []),
    "Model.reverting": (fb.Model.reverting, [], ["mean", "time_constant", "variance"]),
    "Model.linear": (fb.Model.linear, ["drift", "density"], ["offset"]),
    "Model.steps": (fb.Model.steps, ["transition", "noise"], ["offset", "interval"]),
    "Model.simulate": (fb.Model.velocity(0.1).simulate, ["times"], ["start", "seed"]),
    "FusionCentre": (
        lambda *a, **k: fb.FusionCentre(fb.Model.walk(0.1), *a, **{"mean": 0.0, **k}),
        [],
        ["mean", "deviation", "covariance", "learn_noise", "health", "failures", "window"],
    ),
    "FusionCentre.join": (
        lambda *a, **k: centre().join(*a, **{"noise": 1.0, **k}),
        ["column"],
        ["reads", "noise", "send", "loss", "offset", "missing"],
    ),
    "FusionCentre.run": (lambda *a, **k: centre().run(*a, **{"time": "t", **k}), ["table"], ["by", "value", "smooth"]),
    "FusionCentre.step": (lambda *a, **k: centre().step(*a, **k), ["time", "samples"], []),
    "FusionCentre.from_bytes": (fb.FusionCentre.from_bytes, ["bytes"], []),
    "ParticleFilter": (lambda *a, **k: fb.ParticleFilter(*a, **{"seed": 1, **k}), ["start", "move", "likelihood"], ["seed", "resample"]),
    "ParticleFilter.step": (lambda *a, **k: filtering().step(*a, **k), ["observation"], ["dt"]),
    "ParticleFilter.run": (lambda *a, **k: filtering().run(*a, **k), ["observations"], ["time", "dt"]),
    "GridFilter": (
        lambda *a, **k: fb.GridFilter(*a, **{"lower": -1.0, "upper": 1.0, "spacing": 0.5, "start": (0.0, 1.0), **k}),
        ["mean", "deviation", "likelihood"],
        ["lower", "upper", "spacing", "start"],
    ),
    "LatticeFilter": (
        lambda *a, **k: fb.LatticeFilter(*a, **{"lower": [-1, -1], "upper": [1, 1], "spacing": [0.5, 1], "start": ([0, 0], [1, 1]), **k}),
        ["mean", "deviation", "likelihood"],
        ["lower", "upper", "spacing", "start"],
    ),
    "LatticeFilter.step": (lambda *a, **k: lattice().step(*a, **k), ["observation"], ["dt"]),
    "LatticeFilter.run": (lambda *a, **k: lattice().run(*a, **{"time": "t", **k}), ["table"], ["time"]),
    "LatticeFilter.marginal": (lambda *a: lattice().marginal(*a), ["coordinate"], []),
    "GridFilter.step": (lambda *a, **k: grid().step(*a, **k), ["observation"], ["dt"]),
    "GridFilter.run": (lambda *a, **k: grid().run(*a, **{"time": "t", **k}), ["table"], ["time"]),
    "EnsembleFilter": (
        lambda *a, **k: fb.EnsembleFilter(*a, **{"noise": 1.0, "seed": 1, **k}),
        ["start", "move", "measure"],
        ["noise", "seed", "send", "inflation", "period"],
    ),
    "EnsembleFilter.step": (lambda *a, **k: ensemble().step(*a, **k), ["observation"], ["dt"]),
    "EnsembleFilter.run": (lambda *a, **k: ensemble().run(*a, **{"time": "t", **k}), ["table"], ["time"]),
    "SigmaPointFilter": (
        lambda *a, **k: fb.SigmaPointFilter(*a, **{"process": np.eye(2), "noise": 1.0, "mean": [0.0, 0.0], "deviation": [1.0, 1.0], **k}),
        ["move", "measure"],
        ["process", "noise", "mean", "deviation", "covariance", "rule", "kappa", "send", "period"],
    ),
    "SigmaPointFilter's settings": (sigma, [], ["process", "noise", "mean", "deviation", "covariance", "rule", "kappa", "send", "period"]),
    "SigmaPointFilter.step": (lambda *a, **k: sigma().step(*a, **k), ["observation"], ["dt"]),
    "SigmaPointFilter.run": (lambda *a, **k: sigma().run(*a, **{"time": "t", **k}), ["table"], ["time"]),
    "fit": (
        lambda *a, **k: fb.fit(*a, **{"time": "t", **k}),
        ["table"],
        ["time", "by", "value", "sensors", "reference", "find", "bits", "noise"],
    ),
    "Model.beside": (fb.Model.walk(0.1).beside, ["other"], []),
    "RangeTracker": (fb.RangeTracker, ["anchors"], ["send", "noise", "outliers", "silence"]),
    "RangeTracker.run": (fb.RangeTracker(ANCHORS).run, ["table", "time", "by", "value"], []),
    "SourceSearch": (
        lambda *a, **k: fb.SourceSearch(
            *a, **{"reach": 9.0, "instants": [5.0], "noise": 1.0, "diffusivity": 1.0, "rate": 1.0, "box": ((0, 0), (1, 1)), **k}
        ),
        ["places"],
        ["reach", "instants", "noise", "diffusivity", "wind", "rate", "box", "threshold", "max_nodes", "plan", "square", "split", "flow"],
    ),
    "SourceSearch.nearest": (search().nearest, ["place"], []),
    "SourceSearch.concentration": (search().concentration, ["place", "source"], ["rate"]),
    "SourceSearch.rooms": (in_rooms().rooms, ["samples"], ["model_error"]),
    "SourceSearch.run": (lambda *a, **k: search().run(*a, **{"start": 0, "deviation": 5.0, **k}), ["samples"], ["start", "deviation"]),
    "Table": (fb.Table, ["columns"], []),
    "plot": (fb.plot, ["table"], ["x", "y", "band"]),
    "Generator": (fb.Generator, ["seed"], []),
    "Generator.standard_normal": (lambda count: fb.Generator(1).standard_normal(small(count)), ["count"], []),
    "Generator.random": (lambda count: fb.Generator(1).random(small(count)), ["count"], []),
    "Design.encode": (DESIGN.encode, ["samples"], []),
    "Design.decode": (DESIGN.decode, ["words"], []),
    "Design.c_header": (DESIGN.c_header, ["name"], []),
    "OneBit.threshold": (
        lambda **k: fb.OneBit(a=0.9, process=0.5, noise=1.0).threshold(**{"mean": 0.0, "variance": 1.0, **k}),
        [],
        ["mean", "variance"],
    ),
    "Model.velocity": (fb.Model.velocity, ["density"], []),
    "Model.acceleration": (fb.Model.acceleration, ["density"], []),
    "Model.plane": (fb.Model.plane, ["density"], []),
    "Generator.add_normal": (fb.Generator(1).add_normal, ["array", "deviation"], []),
    "design": (
        lambda **k: fb.design(**{"prior": (0.0, 1.0), "noise": [1.0], "bits": [1], "seconds": 0.01, **k}),
        [],
        ["prior", "noise", "bits", "support", "loss", "flips", "criterion"],
    ),
}
ACCEPTED = (fb.Error, TypeError, ValueError, KeyError, OverflowError, IndexError, AttributeError, OSError)


@pytest.mark.parametrize("name", CALLS)
@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(data=st.data())
def test_any_arguments(name, data):
    function, positional, named = CALLS[name]
    if name == "design":
        values = {key: data.draw(anything.filter(lambda x: not (isinstance(x, int) and x > 8)), key) for key in named[:2]}
    else:
        values = {key: data.draw(anything, key) for key in named if data.draw(st.booleans(), f"has {key}")}
    try:
        function(*(data.draw(anything, key) for key in positional), **values)
    except ACCEPTED as error:
        assert "panicked" not in str(error) and "unwrap" not in str(error)


@pytest.mark.parametrize("name", ["write", "read", "verify", "open", "scan", "Recorder"])
@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(data=st.data())
def test_any_arguments_of_files(name, data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("any")
    path = folder / "a.fewb"
    fb.write(pl.DataFrame({"t": [0.0, 1.0], "a": [1.0, None]}), path, time="t")
    draw = lambda key: data.draw(anything, key)  # noqa: E731
    calls = {
        "write": lambda: fb.write(draw("table"), folder / "b", time=draw("time"), bounds=draw("bounds")),
        "read": lambda: fb.read(path, columns=draw("columns"), start=draw("start"), end=draw("end")),
        "verify": lambda: fb.verify(draw("table"), path, time=draw("time")),
        "open": lambda: fb.open(path).select(draw("columns"), start=draw("start")).read(),
        "scan": lambda: fb.scan(path).filter(pl.col("t") > draw("limit")).collect(),
        "Recorder": lambda: recorder(folder / "c", draw),
    }
    try:
        calls[name]()
    except (*ACCEPTED, pl.exceptions.PolarsError, Warning) as error:
        assert "panicked" not in str(error)


def recorder(path, draw):
    with fb.Recorder(path, draw("bounds"), decimals=draw("decimals")) as made:
        made.push(draw("time"), draw("cells"))


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    samples=hnp.arrays("f8", st.integers(0, 60), elements=st.floats(width=64)),
    bound=st.one_of(st.none(), st.floats(1e-300, 1e300)),
    effort=st.sampled_from(["thorough", "fast"]),
)
def test_any_numbers_return_within_any_bound(samples, bound, effort):
    back = fb.decode(fb.encode(samples, bound, effort=effort))
    if bound is None:
        assert back.tobytes() == samples.tobytes()
        return
    finite = np.isfinite(samples)
    assert back[~finite].tobytes() == samples[~finite].tobytes()
    with np.errstate(over="ignore"):
        assert all(math.isclose(a, b, rel_tol=0, abs_tol=bound) for a, b in zip(back[finite], samples[finite], strict=True))


@settings(max_examples=100, deadline=None, derandomize=True)
@given(
    samples=st.one_of(
        hnp.arrays(st.sampled_from(["i8", "i4", "i2", "u4", "u1", "?"]), st.integers(0, 60)),
        hnp.arrays("f4", st.integers(0, 60), elements=st.floats(width=32)),
    )
)
def test_integers_and_singles_return_to_the_bit(samples):
    back = fb.decode(fb.encode(samples))
    assert back.dtype == (np.float32 if samples.dtype == np.float32 else np.int64)
    assert np.array_equal(back, samples, equal_nan=samples.dtype == np.float32)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(content=st.binary(max_size=200), kind=st.integers(0, 255), rows=st.integers(0, 2**64 - 1))
def test_any_bytes_decode_or_are_refused(content, kind, rows):
    """Also with the right checksum, which only a program writes."""
    import struct
    import zlib

    frame = b"fb\x01" + bytes([kind]) + struct.pack("<dQ", 0.5, min(rows, 1 << 20)) + content
    try:
        fb.decode(frame + struct.pack("<I", zlib.crc32(frame)))
    except fb.Error as error:
        assert "panicked" not in str(error)


def test_more_rows_than_memory_are_refused():
    import struct
    import zlib

    whole = fb.encode(np.zeros(3))
    for rows in (2**45, 2**60, 2**64 - 1):
        frame = whole[:12] + struct.pack("<Q", rows) + whole[20:-4]
        with pytest.raises(fb.DecodeError, match="memory"):
            fb.decode(frame + struct.pack("<I", zlib.crc32(frame)))


NO_NUMBERS = {
    "complex": np.array([1 + 2j]),
    "times": np.array(["2026-01-01"], dtype="M8[s]"),
    "durations": np.array([5], dtype="m8[s]"),
    "texts": np.array(["1.5"]),
    "texts as objects": np.array(["1.5", 2.0], dtype=object),
    "times of pandas": pd.Series(pd.date_range("2026-01-01", periods=2, tz="UTC")),
}


@pytest.mark.parametrize("given", NO_NUMBERS.values(), ids=NO_NUMBERS)
@pytest.mark.parametrize(
    "use",
    [
        fb.encode,
        lambda x: fb.encode(x, 0.1),
        lambda x: fb.OneBit(a=0.9, process=0.5, noise=1.0).run(x, mean=0.0, variance=1.0),
        lambda x: fb.resample(x, seed=1),
        lambda x: fb.Model.walk(0.1).simulate(x, start=0.0, seed=1),
        lambda x: fb.design(prior=(0.0, 1.0), noise=[1.0], bits=[1]).encode(np.reshape(x, (-1, 1))),
    ],
    ids=["lossless", "bound", "bits", "weights", "vector", "matrix"],
)
def test_what_is_no_number_is_refused_and_not_converted(use, given):
    with pytest.raises(fb.ArgumentError, match="numbers"):
        use(given)


def test_masked_and_missing_cells_are_nan():
    masked = np.ma.array([1.0, 2.0, 3.0], mask=[0, 1, 0])
    for bound in (None, 0.1):
        assert np.isnan(fb.decode(fb.encode(masked, bound))).tolist() == [False, True, False]
        assert np.isnan(fb.decode(fb.encode(pd.Series([1, None], dtype="Int64"), bound))).tolist() == [False, True]
        assert np.isnan(fb.decode(fb.encode(np.ma.array([1, 2], mask=[1, 0]), bound))).tolist() == [True, False]
    assert fb.decode(fb.encode(pd.Series([1, 2**62 + 1], dtype="Int64")))[1] == 2**62 + 1
    run = fb.OneBit(a=0.9, process=0.5, noise=1.0).run(masked, mean=0.0, variance=1.0)
    assert run.bits.tolist()[1] == 0
    with pytest.raises(fb.ArgumentError, match="samples"):
        fb.design(prior=(0.0, 1.0), noise=[1.0], bits=[1]).encode(masked.reshape(-1, 1))


def test_whole_numbers_that_no_double_holds_are_not_rounded():
    large = 2**60 + 1
    just = 2**53 + 1
    for given, bound in (([just], None), ([0.5, np.int64(just)], 2.0), (np.array([just]), 0.5), (pl.Series([just, None]), None), ([large, 3], 0.5), (np.array([large]), 0.5), (np.ma.array([large, 2], mask=[0, 1]), None), (pd.Series([large, None], dtype="Int64"), None)):
        with pytest.raises(fb.ArgumentError, match="samples"):
            fb.encode(given, bound)
    assert fb.decode(fb.encode([2**53 + 2, None], 0.5))[0] == 2**53 + 2 and fb.decode(fb.encode(np.array([just]))) == just
    assert fb.decode(fb.encode(np.array([2**53]), 0.5)) == 2**53 and fb.decode(fb.encode([float(large)], 0.5)) == 2**60


def test_a_bound_of_zero_is_refused_with_what_is_lossless():
    with pytest.raises(fb.ArgumentError, match="or none: then every bit returns"):
        fb.encode([1.0], 0)


@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are those of Linux")
def test_too_many_numbers_are_an_exception_of_memory():
    program = """
import resource, fewbits as fb
resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
for work in (lambda: fb.Generator(1).standard_normal(2**32), lambda: fb.Generator(1).random(2**32), lambda: fb.resample([1.0], count=2**32 - 1, seed=1)):
    try:
        work()
    except MemoryError as error:
        print(error)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"})
    assert done.returncode == 0 and done.stdout.count("no memory for") == 3, done.stderr


def test_masks_of_callbacks_are_no_numbers():
    hidden = np.ma.array(np.zeros((1, 4)), mask=[[1, 0, 0, 0]])
    for move, likelihood in ((lambda x, dt, rng: None, lambda x, z: hidden[0]), (lambda x, dt, rng: hidden, lambda x, z: x[0])):
        with pytest.raises(fb.Error, match="number"):
            fb.ParticleFilter(np.zeros((1, 4)), move, likelihood, seed=1).run([1.0])
    plain = fb.ParticleFilter(np.zeros((1, 4)), lambda x, dt, rng: np.ma.array(x + 1), lambda x, z: np.ma.array(-x[0]), seed=1)
    assert plain.run([1.0]).mean == 1.0


@pytest.mark.parametrize("bits", [[0.5], [257], [1, -1.5], np.array([3e9])])
def test_whole_numbers_are_not_cut(bits):
    with pytest.raises(fb.ArgumentError, match="bits"):
        fb.OneBit(a=0.9, process=0.5, noise=1.0).run_bits(bits, mean=0.0, variance=1.0)


def test_words_and_samples_of_a_design_are_rows():
    design = fb.design(prior=(0.0, 1.0), noise=[1.0, 1.0], bits=[1, 2])
    words = design.encode(pd.DataFrame({"a": [0.3, -2.0], "b": [0.1, 1.0]}))
    assert design.decode(words.astype(np.uint8)).tolist() == design.decode(words).tolist() == design.decode(words.astype(float)).tolist()
    for wrong in ([0.3, 0.1], [[0.3]], [[0.3, 0.1, 0.2]], None, "ab", [[0.3, np.nan]], [[0.3, None]]):
        with pytest.raises(fb.ArgumentError, match="argument `samples`"):
            design.encode(wrong)
    for wrong in ([0, 1], [[0]], None, [[0.5, 0]], [[-1, 0]], [[0, 4]], [[2**63, 0]]):
        with pytest.raises(fb.ArgumentError, match="argument `words`"):
            design.decode(wrong)
    assert design.encode(np.zeros((0, 2))).shape == (0, 2) and design.decode(np.zeros((0, 2), int)).shape == (0,)


def test_bytes_come_in_any_buffer():
    frame = fb.encode([1.5, 2.5])
    for given in (bytearray(frame), memoryview(frame), np.frombuffer(frame, np.uint8), memoryview(b"_" + frame)[1:]):
        assert fb.decode(given).tolist() == [1.5, 2.5]
    assert fb.FusionCentre.from_bytes(bytearray(centre().to_bytes())).sensors["name"].tolist() == ["a"]
    for wrong in ("x", None, 3, [1]):
        with pytest.raises(fb.ArgumentError, match="argument `frame`"):
            fb.decode(wrong)
    with pytest.raises(fb.ArgumentError, match="argument `bound` is ±0.1"):
        fb.encode([1.0], "±0.1")


class Nothing:
    """What is no number, no text, no array, no table and no function."""


# What is chosen by another argument, or is whatever the caller's functions take.
FREE = {"observation", "observations"}
# What must be given besides.
NEEDED = {
    "OneBit": {"a": 0.9, "process": 0.5, "noise": 1.0},
    "OneBit.run": {"mean": 0.0, "variance": 1.0},
    "OneBit.run_bits": {"mean": 0.0, "variance": 1.0},
    "OneBit.step": {"mean": 0.0, "variance": 1.0},
    "Model.reverting": {"mean": 0.0, "time_constant": 1.0, "variance": 1.0},
    "Model.simulate": {"start": [0.0, 0.0], "seed": 1},
    "FusionCentre": {"deviation": 1.0},
    "plan": {},
}


@pytest.mark.parametrize("name", CALLS)
def test_a_wrong_type_is_named(name):
    function, positional, named = CALLS[name]
    right = {
        "samples": np.zeros(3), "frame": fb.encode([1.0]), "log_weights": np.zeros(3), "weights": np.ones(3), "bits": np.ones(3, "i1"), "bit": 1,
        "density": 0.1, "drift": [[0.0]], "transition": [[1.0]], "noise": [[1.0]], "times": [0.0, 1.0], "column": "b", "time": 0.0, "bytes": b"",
        "start": np.zeros((1, 3)), "move": lambda *a: None, "likelihood": lambda *a: np.zeros(3), "measure": lambda *a: np.zeros(3), "mean": lambda x, dt: x,
        "deviation": lambda x, dt: 1.0, "coordinate": 0, "anchors": ANCHORS, "places": [[0.0, 0.0], [5.0, 0.0]], "place": (0.0, 0.0), "source": [0.0, 0.0],
        "table": pl.DataFrame({"t": [0.0, 1.0], "a": [1.0, 2.0]}), "columns": {"a": [1.0]}, "seed": 1, "array": np.zeros(3), "other": fb.Model.walk(0.1),
    }  # fmt: skip
    if name == "FusionCentre.step":
        right["samples"] = {"a": 1.0}
    if name == "RangeTracker.run":
        right["time"] = "t"
    if name == "Generator.add_normal":
        right["deviation"] = 1.0
    if name == "plot":
        pytest.skip("its arguments are matplotlib's")
    for wrong in [*positional, *named]:
        if wrong in FREE:
            continue
        values = [Nothing() if key == wrong else right.get(key, "t") for key in positional]
        with pytest.raises(fb.ArgumentError) as caught:
            function(*values, **{**NEEDED.get(name, {}), **({wrong: Nothing()} if wrong in named else {})})
        # Of these two one is given.
        either = {"deviation"} if wrong == "covariance" else set()
        assert caught.value.name in {wrong} | either, (wrong, caught.value)
        assert "Nothing" in caught.value.value or caught.value.name in either, (wrong, caught.value)


def test_numbers_out_of_range_and_of_other_types_are_named():
    for call, name, value in [
        (lambda: fb.Model.walk("much"), "density", "'much'"),
        (lambda: fb.Generator(-1), "seed", "-1"),
        (lambda: fb.Generator(2**64), "seed", "18446744073709551616"),
        (lambda: fb.Generator(1.5), "seed", "1.5"),
        (lambda: fb.resample([1.0], seed=1, count=-2), "count", "-2"),
        (lambda: fb.design(prior=(0, 1), noise=[1.0], bits=[-1]), "bits", "[-1]"),
        (lambda: fb.SourceSearch([[0.0, 0.0]], reach=1, instants=[1.0], noise=1, diffusivity=1, rate=1, box=((0, 0), (1,))), "box", "((0, 0), (1,))"),
        (lambda: fb.OneBit(a=0.9, process=1, noise=1).step(2**40, mean=0, variance=1), "bit", str(2**40)),
        (lambda: fb.FusionCentre("model", mean=0, deviation=1), "model", "'model'"),
        (lambda: centre().step(0.0, {"a": "high"}), "samples", "{'a': 'high'}"),
        (lambda: fb.frontier(fb.Model.walk(0.1), sensors="two", noise=1.0, times=[0], mean=0, deviation=1, seed=1), "sensors", "'two'"),
    ]:
        with pytest.raises(fb.ArgumentError) as caught:
            call()
        error = caught.value
        assert (error.name, error.value) == (name, value) and error.expected
        assert str(error).startswith(f"argument `{name}` is {value}: expected ") and isinstance(error, ValueError)
    # A wrong type is a TypeError too, and what the caller's own conversion raises is handed on.
    with pytest.raises(TypeError):
        fb.Model.walk(None)

    class Failing:
        def __float__(self):
            raise RuntimeError("mine")

    with pytest.raises(RuntimeError, match="mine"):
        fb.Model.walk(Failing())


def one_bit(**changed):
    return fb.OneBit(**{"a": 0.9, "process": 0.5, "noise": 1.0, **changed})


def designed(**changed):
    return fb.design(**{"prior": (0, 1), "noise": [1.0], "bits": [1], **changed})


def source(**changed):
    given = {"places": [[0.0, 0.0], [1.0, 0.0]], "reach": 2.0, "instants": [1.0], "noise": 1.0, "diffusivity": 1.0, "rate": 1.0}
    return fb.SourceSearch(**{**given, "box": ((0, 0), (1, 1)), **changed})


def gridded(**changed):
    grid = {"lower": -2, "upper": 2, "spacing": 0.5, "start": (0, 1), **changed}
    return fb.GridFilter(lambda x, dt: x, lambda x, dt: 1.0, lambda x, z: -np.abs(x), **grid)


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("a", lambda: one_bit(a=math.nan)),
        ("process", lambda: one_bit(process=-1.0)),
        ("noise", lambda: one_bit(noise=0.0)),
        ("flips", lambda: one_bit(flips=0.7)),
        ("samples", lambda: one_bit().run([math.inf], mean=0, variance=1)),
        ("time_constant", lambda: fb.Model.reverting(mean=0, time_constant=1e-320, variance=1)),
        ("variance", lambda: fb.Model.reverting(mean=0, time_constant=1e-9, variance=1e300)),
        ("noise", lambda: fb.Model.steps([[1.0]], [[-1.0]])),
        ("deviation", lambda: fb.FusionCentre(fb.Model.walk(0.1), mean=0, deviation=1e200)),
        ("failures", lambda: fb.FusionCentre(fb.Model.walk(0.1), mean=0, deviation=1, failures=-1.0)),
        ("noise", lambda: fb.FusionCentre(fb.Model.walk(0.1), mean=0, deviation=1).join("a", noise=1e200)),
        ("bias", lambda: fb.RangeTracker({"a": (0.0, 0.0), "b": (9.0, 0.0), "c": (0.0, 9.0)}, bias=math.inf)),
        ("prior", lambda: designed(prior=(math.nan, 1))),
        ("prior", lambda: designed(prior=(0, -1))),
        ("noise", lambda: designed(noise=[-1.0])),
        ("noise", lambda: designed(noise=[], bits=[])),
        ("flips", lambda: designed(flips=0.7)),
        ("start", lambda: gridded(start=(math.nan, 1))),
        ("start", lambda: gridded(start=(0, -1e200))),
        ("places", lambda: source(places=[[math.nan, 0.0]])),
        ("reach", lambda: source(reach=-1.0)),
        ("instants", lambda: source(instants=[0.0])),
        ("box", lambda: source(box=((1, 1), (0, 0)))),
        ("noise", lambda: fb.fit(fb.Table({"t": np.arange(30.0), "a": np.sin(np.arange(30.0))}), time="t", noise={"a": -1.0})),
    ],
)
def test_refused_arguments_have_the_names_of_python(name, call):
    with pytest.raises(fb.ArgumentError) as caught:
        call()
    assert caught.value.name == name, caught.value


def test_huge_and_tiny_numbers_are_shown_with_an_exponent():
    for number in [-1.7e308, -1e-320]:
        with pytest.raises(fb.ArgumentError) as caught:
            fb.Model.walk(number)
        assert float(caught.value.value) == number and len(caught.value.value) < 12


@pytest.mark.parametrize("key", [1, None, b"a", ("a",), "\ud800"])
@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("columns", lambda key: fb.Table({key: [1.0]})),
        ("columns", lambda key: fb.Table({"a": [1.0], key: [1.0]})),
        ("likelihood", lambda key: fb.ParticleFilter(np.zeros((1, 3)), lambda x, dt, rng: None, {key: lambda x, z: x[0]}, seed=1)),
        (
            "observation",
            lambda key: fb.ParticleFilter(np.zeros((1, 3)), lambda x, dt, rng: None, {"a": lambda x, z: x[0]}, seed=1).step({key: 1.0}),
        ),
        ("noise", lambda key: sigma(noise={key: 1.0})),
        ("samples", lambda key: centre().step(0.0, {key: 1.0})),
    ],
)
def test_keys_that_are_no_texts_are_named(name, call, key):
    with pytest.raises(fb.ArgumentError) as caught:
        call(key)
    # Bytes are shown, or named by their type.
    is_shown = any(text in caught.value.value for text in (repr(key)[:2], type(key).__name__))
    assert caught.value.name == name and is_shown and isinstance(caught.value, TypeError)
