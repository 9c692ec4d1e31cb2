"""Eight jobs of a newcomer, with inputs of his own, each in twenty lines at most."""

import inspect

import numpy as np
import pandas as pd
import polars as pl
import pytest

import fewbits as fb


def an_accelerometer_in_few_bits(folder):
    walk = np.cumsum(np.random.default_rng(11).standard_normal((4000, 3)), 0).astype(np.float32)
    walk[::97], walk[5, 1] = np.nan, np.inf
    backwards = walk[::-2, 1]
    blob = fb.encode(backwards, bound=0.05, effort="fast")
    finite = np.isfinite(backwards)
    error = np.abs(fb.decode(blob)[finite] - backwards[finite])
    frame = pd.DataFrame(walk, columns=list("xyz"), index=pd.date_range("2026-03-01", periods=4000, freq="20ms", name="when"))
    planned = fb.plan(frame, time="when").to_pandas().pivot(index="share", columns="column", values="bits")
    assert error.max() <= 0.05 and len(blob) < backwards.nbytes / 2 and planned["y"].is_monotonic_decreasing
    assert np.array_equal(np.isnan(fb.decode(blob)), np.isnan(backwards)) and fb.decode(blob)[np.isinf(backwards)] == np.inf


def a_room_in_a_file(folder):
    index = pd.date_range("2026-02-01", periods=3000, freq="1min", tz="Europe/Paris", name="when")
    k = np.arange(3000)
    room = pd.DataFrame({"temp": np.round(18 + np.sin(k / 200), 2), "humidity": np.round(50 + np.cos(k / 90), 1)}, index=index)
    room.iloc[3:9, 0] = np.nan
    fb.write(room, folder / "room.fewb", time="when", bounds={"temp": "±0.1", "*": "decimals:1"})
    assert fb.verify(room, folder / "room.fewb", time="when")["holds"]
    back = fb.read(folder / "room.fewb", columns=["temp"], start="2026-02-02").to_pandas().set_index("when").tz_convert("Europe/Paris")
    assert back.index[0] == pd.Timestamp("2026-02-02T01:00", tz="Europe/Paris")
    humid = fb.scan(folder / "room.fewb").filter(pl.col("humidity") > 50.5).collect()
    assert humid.height == (room["humidity"] > 50.5).sum()
    with fb.Recorder(folder / "live.fewb", {"temp": "±0.1"}, time="when", decimals=0, utc=True) as recorder:
        recorder.push_table(room[["temp"]].iloc[:100])
        recorder.push(pd.Timestamp("2026-02-02"), {"temp": 20.1})
    assert len(fb.read(folder / "live.fewb")) == 101


def one_bit_a_sample(folder):
    rng, x = np.random.default_rng(4), [0.0]
    for _ in range(1999):
        x.append(0.9 * x[-1] + np.sqrt(0.5) * rng.standard_normal())
    samples = pd.Series(x) + rng.standard_normal(2000)
    samples[rng.random(2000) < 0.1] = np.nan
    sensor = fb.OneBit(a=0.9, process=0.5, noise=1.0)
    run = sensor.run(samples, mean=0.0, variance=2.63)
    received = sensor.run_bits(run.bits, mean=0.0, variance=2.63)
    assert np.array_equal(received.mean, run.mean) and (run.bits == 0).sum() == samples.isna().sum()
    # Honest: the squared error is what the filter says, within four standard errors of 2000 dependent steps.
    assert abs(np.mean((run.mean - x) ** 2 / run.variance) - 1) < 4 * np.sqrt(2 * (1 + 0.81) / (1 - 0.81) / 2000)


def a_level_from_two_sensors_of_one_bit(folder):
    rng, index = np.random.default_rng(5), pd.date_range("2026-01-01", periods=600, freq="10min", name="when")
    level = 3 + np.cumsum(0.02 * rng.standard_normal(600))
    frame = pd.DataFrame({name: level + 0.3 * rng.standard_normal(600) for name in "ab"}, index=index)
    frame.loc[index[100:180], "b"] = np.nan
    centre = fb.FusionCentre(fb.Model.walk(0.02**2 / 600), mean=3.0, deviation=1.0)
    for name in "ab":
        centre.join(name, noise=0.3, send="bit")
    found = centre.run(frame, time="when", smooth=True)
    assert np.sqrt(np.mean((found["x0_smooth"] - level) ** 2)) < np.sqrt(np.mean((found["x0"] - level) ** 2)) < 0.15
    assert found["bits"].sum() == frame.notna().sum().sum() and found["x0_sd"][170] > found["x0_sd"][99]
    again = fb.FusionCentre.from_bytes(centre.to_bytes())
    assert again.step(index[-1] + pd.Timedelta("10min"), {"a": 3.0}).bits == 1
    noise = fb.fit(frame, time="when").parameters.to_pandas().query("quantity == 'noise'")
    assert (np.abs(noise["value"] - 0.3) < 4 * noise["standard_error"]).all()


def quantizers_for_two_nodes(folder):
    design = fb.design(prior=(20, 4), noise=[1.0, 1.0], bits=[3, 3], flips=0.02)
    rng = np.random.default_rng(9)
    unknown = 20 + 4 * rng.standard_normal(20_000)
    samples = pd.DataFrame({name: unknown + rng.standard_normal(20_000) for name in ("left", "right")})
    words = design.encode(samples)
    arrived = words ^ (rng.random((20_000, 2, 3)) < 0.02) @ [1, 2, 4]
    squared = (design.decode(arrived) - unknown) ** 2
    assert abs(squared.mean() - design.value) < 4 * squared.std() / np.sqrt(20_000) and design.value >= design.bound
    (folder / "level.h").write_text(design.c_header("level"))


def an_own_model_with_particles(folder):
    def move(x, dt, rng):
        x[0] += dt * x[1]
        rng.add_normal(x[1], 0.3 * np.sqrt(dt))

    def radar(x, z):
        return -0.5 * ((z - np.hypot(x[0], 3.0)) / 0.1) ** 2

    rng = np.random.default_rng(6)
    t = np.cumsum(rng.uniform(0.5, 1.5, 80))
    frame = pd.DataFrame({"t": t, "radar": np.hypot(1 + 0.8 * t, 3) + 0.1 * rng.standard_normal(80)})
    frame.loc[10:15, "radar"] = np.nan
    start = rng.standard_normal((2, 10_000)) + [[1], [1]]
    found = fb.ParticleFilter(start, move, {"radar": radar}, seed=1).run(frame, time="t").to_pandas()
    assert np.median(np.abs(found["x0"] - 1 - 0.8 * t)[20:]) < 0.2 and found["x0_sd"][15] > found["x0_sd"][9]


def a_tag_between_three_anchors(folder):
    rng, anchors = np.random.default_rng(7), {"north": (0, 0), "east": (9, 0), "west": (0, 9)}
    k = np.arange(900)
    path = np.c_[4 + 2 * np.cos(k / 90), 4 + 2 * np.sin(k / 90)]
    who = np.array(list(anchors))[k % 3]
    distance = np.hypot(*(path - np.array([anchors[name] for name in who])).T) + 0.1 * rng.standard_normal(900)
    when = pd.Timestamp("2026-01-01") + pd.to_timedelta(k * 0.1, unit="s")
    walk = pd.DataFrame({"when": when, "anchor": pd.Categorical(who), "range": distance})
    found = fb.RangeTracker(anchors, send="word:2", noise=0.7, bias=0.2).run(walk, time="when", by="anchor", value="range").to_pandas()
    assert np.median(np.hypot(found["x"] - path[:, 0], found["y"] - path[:, 1])[200:]) < 0.3 and found["bits"].median() == 2


def a_leak_and_what_each_way_of_sending_costs(folder):
    rng = np.random.default_rng(8)
    places, leak = rng.uniform(0, 80, (200, 2)), (30.0, 55.0)
    search = fb.SourceSearch(places, reach=15, instants=[5, 10, 20], noise=1e-5, diffusivity=30.0, rate=1.0, box=((0, 0), (80, 80)))
    measured = lambda node: search.concentration(places[node], leak) + 1e-5 * rng.standard_normal(3)
    found = search.run(measured, start=search.nearest((40, 40)), deviation=20.0)
    assert found.status == "converged" and np.hypot(*(found.mean - leak)) < 1
    front = fb.frontier(fb.Model.walk(0.1), sensors=3, noise=1.0, times=np.arange(60.0), mean=0.0, deviation=1.0, trials=20, seed=1)
    front = front.to_pandas().set_index("scheme")
    assert front.loc["bit", "rmse"] > front.loc["word:3", "rmse"] > front.loc["value", "rmse"]


JOBS = [
    an_accelerometer_in_few_bits,
    a_room_in_a_file,
    one_bit_a_sample,
    a_level_from_two_sensors_of_one_bit,
    quantizers_for_two_nodes,
    an_own_model_with_particles,
    a_tag_between_three_anchors,
    a_leak_and_what_each_way_of_sending_costs,
]


@pytest.mark.parametrize("job", JOBS, ids=lambda job: job.__name__)
def test_a_job_is_done_in_twenty_lines(job, tmp_path):
    lines = [line for line in inspect.getsource(job).splitlines()[1:] if line.strip()]
    assert len(lines) <= 20
    job(tmp_path)
