"""What has a state is pickled and copied, and goes on with the same numbers."""

import copy
import datetime
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import polars as pl
import pytest

import fewbits as fb


def move(x, dt, rng):
    x[0] += dt * x[1]
    rng.add_normal(x[1], 0.3 * np.sqrt(dt))


def turn(x, dt):
    x[0] += dt * x[1]


def distance(x):
    return np.hypot(x[0], 3.0)


def radar(x, z):
    return -0.5 * ((z - np.hypot(x[0], 3.0)) / 0.2) ** 2


def radar_by_rows(x, z):
    return radar(x.T, z)


def alarm(x, z):
    return np.log(np.where((x > 1) == (z > 0), 0.99, 0.01))


def still(x, dt):
    return x


def spread(x, dt):
    return 0.9 * np.sqrt(dt)


def flat(x, z):
    return -0.5 * ((z - np.hypot(x[0], x[1])) / 0.3) ** 2


def noise_of(dt):
    return np.diag([0.01, 0.09 * dt])


def start():
    return np.random.default_rng(1).standard_normal((2, 200)) + [[1.0], [0.5]]


FILTERS = {
    "particles": lambda: fb.ParticleFilter(start(), move, {"radar": radar}, seed=3),
    "particles by rows": lambda: fb.ParticleFilter(start().T.copy(), move_by_rows, radar_by_rows, seed=3, by_rows=True, resample=0.9),
    "ensemble": lambda: fb.EnsembleFilter(start(), move, {"radar": distance}, noise=0.2, seed=3, inflation=1.01, send="word:3"),
    "unscented": lambda: fb.SigmaPointFilter(turn, {"radar": distance}, process=np.diag([0.0, 0.09]), noise=0.2, mean=[1, 0.5], deviation=[1, 1]),
    "cubature": lambda: fb.SigmaPointFilter(turn, distance, process=noise_of, noise=0.2, mean=[1, 0.5], deviation=[1, 1], rule="cubature", send="bit"),
    "grid": lambda: fb.GridFilter(still, spread, {"radar": alarm}, lower=-8, upper=8, spacing=0.1, start=(0.0, 2.0)),
    "lattice": lambda: fb.LatticeFilter(still, spread, flat, lower=[-6, -6], upper=[6, 6], spacing=[0.4, 0.5], start=([1.0, 1.0], [2.0, 2.0])),
    "centre": lambda: centre(),
}


def move_by_rows(x, dt, rng):
    x[:, 0] += dt * x[:, 1]


def centre():
    made = fb.FusionCentre(fb.Model.velocity(0.1), mean=[1, 0.5], deviation=[1, 1])
    made.join("radar", noise=0.3, send="word:3")
    return made


class Live:
    """A filter whose steps are alike."""

    def __init__(self, name):
        self.name, self.filter, self.time = name, FILTERS[name](), 0.0

    def step(self, z):
        self.time += 0.5
        if self.name == "centre":
            found = self.filter.step(self.time, {"radar": z})
            return found.log_likelihood, *found.mean, *found.covariance.ravel()
        by_name = self.name in ("particles", "ensemble", "unscented", "grid")
        log = self.filter.step({"radar": z} if by_name else z, dt=0.5)
        state = self.filter.states if hasattr(self.filter, "states") else self.filter.mean
        return log, *np.ravel(state)


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("how", [lambda x: pickle.loads(pickle.dumps(x)), copy.deepcopy, copy.copy], ids=["pickle", "deepcopy", "copy"])
def test_filters_go_on_with_the_same_numbers(name, how):
    live = Live(name)
    for z in [3.3, 3.1, None, 3.6]:
        live.step(z)
    other = copy.copy(live)
    other.filter = how(live.filter)
    for z in [3.7, None, 4.1, 4.4]:
        assert np.allclose(live.step(z), other.step(z), rtol=0 if name != "lattice" else 1e-12, atol=0)
    # Two objects: a step of one is none of the other.
    before = np.array(other.filter.mean) if name != "particles" and hasattr(other.filter, "mean") else None
    live.step(4.5)
    if before is not None:
        assert np.array_equal(before, other.filter.mean)


def test_values_stay_what_they_are():
    model = fb.Model.velocity(0.1).beside(fb.Model.reverting(mean=2.0, time_constant=5.0, variance=1.0))
    steps = fb.Model.steps([[1, 1], [0, 1]], [[0.25, 0.5], [0.5, 1.0]], interval=2.0)
    for one, first in ((model, [1.0, 0.0, 2.0]), (steps, [1.0, 0.0])):
        path = lambda of, first=first: of.simulate([0.0, 2.0, 6.0], start=first, seed=4)  # noqa: E731
        assert np.array_equal(path(one), path(pickle.loads(pickle.dumps(one))))
    bit = fb.OneBit(a=0.9, process=0.5, noise=1.0, flips=0.1)
    samples = np.random.default_rng(1).standard_normal(50)
    run, again = (of.run(samples, mean=0.0, variance=2.0) for of in (bit, copy.deepcopy(bit)))
    for result in (again, pickle.loads(pickle.dumps(run))):
        assert np.array_equal(run.mean, result.mean) and np.array_equal(run.bits, result.bits) and run.log_likelihood == result.log_likelihood
    generator = fb.Generator(5)
    generator.standard_normal(1000), generator.random(7)
    other = pickle.loads(pickle.dumps(generator))
    assert np.array_equal(generator.standard_normal(600), other.standard_normal(600)) and np.array_equal(generator.random(9), other.random(9))


@pytest.mark.parametrize("criterion", ["error", "information"])
def test_designs(criterion):
    for given in ({"prior": (20.0, 4.0), "noise": [1.0, 1.5], "bits": [2, 1], "loss": 0.1}, {"prior": skew, "support": (0.0, 9.0), "noise": [0.4], "bits": [2]}):
        design = fb.design(**given, criterion=criterion)
        other = pickle.loads(pickle.dumps(design))
        rows = np.random.default_rng(2).uniform(0, 9, (40, len(given["bits"])))
        words = design.encode(rows)
        # A prior by a density is normalised anew, to rounding.
        assert np.array_equal(words, other.encode(rows)) and np.allclose(design.decode(words), other.decode(words), rtol=1e-13, atol=0)
        assert (design.value, design.bound, design.cut_short) == (other.value, other.bound, other.cut_short)
        assert pl.DataFrame(design.cells).equals(pl.DataFrame(other.cells)) and other.c_header("x").startswith(design.c_header("x")[:40])


def skew(x):
    return np.exp(-x)


def test_tables_keep_types_nulls_and_zones(tmp_path):
    when = [datetime.datetime(2026, 3, day, tzinfo=datetime.timezone.utc) for day in (1, 2, 3)]
    frame = pl.DataFrame(
        {"t": when, "x": [1.5, None, float("nan")], "n": [1, None, 2**62], "b": [True, None, False], "s": ["ä", None, ""], "d": [datetime.date(2026, 1, 1)] * 3}
    )
    fb.write(frame.select("t", "x"), tmp_path / "a.fewb", time="t")
    tables = [fb.read(tmp_path / "a.fewb"), centre().run(frame.select("t", radar="x"), time="t"), fb.read(tmp_path / "a.fewb", end="1990-01-01")]
    for table in tables:
        for other in (pickle.loads(pickle.dumps(table)), copy.deepcopy(table)):
            assert pl.DataFrame(other).equals(pl.DataFrame(table), null_equal=True)
            assert pl.DataFrame(other).schema == pl.DataFrame(table).schema
    assert pl.DataFrame(pickle.loads(pickle.dumps(tables[0]))).schema["t"].time_zone == "UTC"


def test_trackers():
    tracker = fb.RangeTracker({"A": (0.0, 0.0), "B": (9.0, 0.0), "C": (0.0, 9.0)}, send="word:3", noise=0.3, bias=0.2)
    t = np.arange(90) * 0.1
    walk = pl.DataFrame({"t": t, "who": ["A", "B", "C"] * 30, "r": 5 + 0.1 * np.sin(t)})
    path = [pl.DataFrame(one.run(walk, time="t", by="who", value="r")) for one in (tracker, pickle.loads(pickle.dumps(tracker)))]
    assert path[0].equals(path[1], null_equal=True)


PLAN = '''
####
#..#
I..O'''


@pytest.mark.parametrize("rooms", [{}, {"plan": PLAN, "flow": 0.02}], ids=["open", "rooms"])
@pytest.mark.parametrize("rate", [1.0, (0.5, 1.5)], ids=["known", "range"])
def test_searches(rooms, rate):
    places = [(0.5, 2.4), (1.5, 2.4), (2.5, 2.4), (1.5, 1.5), (2.5, 1.5)]
    search = fb.SourceSearch(
        places, reach=1.6, instants=[20.0, 60.0], noise=0.3, diffusivity=0.05, rate=rate, box=((0, 0), (4, 3)), max_nodes=4, **rooms
    )
    source = (1.4, 1.6)
    rng = np.random.default_rng(3)
    samples = [search.concentration(place, source) + 0.3 * rng.standard_normal(2) for place in places]
    found = search.run(samples.__getitem__, start=1, deviation=2.0)
    for other in (pickle.loads(pickle.dumps(search)), copy.copy(search)):
        again = other.run(samples.__getitem__, start=1, deviation=2.0)
        assert (found.status, found.bits) == (again.status, again.bits)
        assert pl.DataFrame(found.visited).equals(pl.DataFrame(again.visited), null_equal=True) and np.array_equal(found.mean, again.mean)


def calibrated():
    rng = np.random.default_rng(2)
    level = np.cumsum(0.3 * rng.standard_normal(120))
    noisy = {"a": level + 0.2 * rng.standard_normal(120), "b": level + 2 + 0.4 * rng.standard_normal(120)}
    table = pl.DataFrame({"t": np.arange(120.0), **noisy})
    return table, fb.fit(table, time="t", reference="a")


def test_what_a_fit_found():
    table, found = calibrated()
    for other in (pickle.loads(pickle.dumps(found)), copy.deepcopy(found)):
        for name in ("parameters", "limits", "refused", "tests", "correlations", "faults"):
            assert pl.DataFrame(getattr(found, name)).equals(pl.DataFrame(getattr(other, name)), null_equal=True)
        assert (found.first, found.log_likelihood, found.relative_to) == (other.first, other.log_likelihood, other.relative_to)
        runs = [pl.DataFrame(one.centre(send="word:3").run(table, time="t")) for one in (found, other)]
        assert runs[0].equals(runs[1], null_equal=True)


def test_work_in_other_processes():
    model, times = fb.Model.walk(0.1), np.arange(20.0)
    filtered = fb.OneBit(a=0.9, process=0.5, noise=1.0)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        for seed in (1, 2):
            path = pool.submit(model.simulate, times, start=0.0, seed=seed).result()
            assert np.array_equal(path, model.simulate(times, start=0.0, seed=seed))
            run = pool.submit(filtered.run, path[:, 0], mean=0.0, variance=2.0).result()
            assert np.array_equal(run.mean, filtered.run(path[:, 0], mean=0.0, variance=2.0).mean)


@pytest.mark.parametrize(
    "made",
    [
        fb.Model.walk(0.1),
        fb.Generator(1),
        fb.design(prior=(0.0, 1.0), noise=[1.0], bits=[1]),
        fb.SourceSearch([(0.0, 0.0)], reach=1.0, instants=[1.0], noise=1.0, diffusivity=1.0, rate=1.0, box=((0, 0), (1, 1))),
        calibrated()[1],
    ],
)
def test_bytes_that_are_no_state_are_refused(made):
    function, (state, *_) = made.__reduce__()
    for wrong in (b"", b"\x00", state[:-1], state + b"\x00", b"\x02" + state[1:], state[:1], "text", 3.0):
        with pytest.raises(fb.Error):
            function(wrong)
    with pytest.raises(fb.Error):
        fb.Table._restored([("a", "g", 3, None, [b"1234"])])
    with pytest.raises(fb.Error):
        fb.Table._restored([("a", "u", 2, None, [b"\x00\x00\x00\x00\x01\x00\x00\x00\x01\x00\x00\x00", b"\xff"])])
    with pytest.raises(fb.Error):
        fb.Table._restored([("a", "+l", 2, None, [b"\x00" * 12])])
