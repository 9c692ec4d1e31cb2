"""The ensemble filter and fixed-lag smoothing, against formulas."""

import numpy as np
import polars as pl
import pytest

import fewbits as fb


def ensemble(start, measure=lambda x: x[0], **settings):
    made = {"noise": 0.5, "seed": 1, **settings}
    return fb.EnsembleFilter(start, lambda x, dt, rng: None, measure, **made)


def test_an_ensemble_has_the_moments_of_the_kalman_update_of_its_own():
    start = np.random.default_rng(1).standard_normal((3, 40)) * [[1.0], [2.0], [0.5]] + [[1.0], [0.0], [-3.0]]
    row, z, noise = np.array([1.0, -0.5, 2.0]), 0.7, 0.3
    filtered = ensemble(start, lambda x: row @ x, noise=noise)
    mean, covariance = start.mean(axis=1), np.cov(start, bias=True)
    assert np.allclose(filtered.mean, mean) and np.allclose(filtered.covariance, covariance)
    log_likelihood = filtered.step(z, dt=0.0)
    variance = row @ covariance @ row + noise**2
    gain = covariance @ row / variance
    assert np.allclose(filtered.mean, mean + gain * (z - row @ mean), atol=1e-12)
    assert np.allclose(filtered.covariance, covariance - np.outer(gain, gain) * variance, atol=1e-12)
    assert np.isclose(log_likelihood, -0.5 * ((z - row @ mean) ** 2 / variance + np.log(2 * np.pi * variance)))


@pytest.mark.parametrize("sign", [-1, 1])
def test_an_ensemble_learns_from_a_bit(sign):
    start = np.random.default_rng(2).standard_normal((1, 30)) * 3
    filtered = ensemble(start, {"a": lambda x: x[0]}, noise={"a": 2.0}, send="bit")
    mean, variance = start.mean(), start.var()
    # The bit says on which side of the prediction the sample is.
    log_likelihood = filtered.step({"a": mean + sign * 0.1}, dt=0.0)
    scale = variance + 4.0
    assert np.allclose(filtered.mean, mean + sign * variance / np.sqrt(scale) * np.sqrt(2 / np.pi))
    assert np.allclose(filtered.covariance, variance - 2 / np.pi * variance**2 / scale) and np.isclose(log_likelihood, np.log(0.5))


def test_an_ensemble_follows_a_table_and_keeps_its_members_where_a_step_fails():
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.5, 1.5, 300))
    truth = np.cumsum(0.2 * np.sqrt(np.diff(t, prepend=0.0)) * rng.standard_normal(300))
    table = pl.DataFrame({"t": t, "z": truth + 0.3 * rng.standard_normal(300)})
    table = table.with_columns(pl.when(pl.int_range(pl.len()) % 7 == 3).then(None).otherwise("z").alias("z"))

    def move(x, dt, rng):
        rng.add_normal(x[0], 0.2 * np.sqrt(dt))

    start = rng.standard_normal((1, 400))
    made = fb.EnsembleFilter(start, move, {"z": lambda x: x[0]}, noise=0.3, seed=5, inflation=1.001)
    found = made.run(table, time="t")
    exact = fb.FusionCentre(fb.Model.walk(0.04), mean=start.mean(), deviation=start.std(), learn_noise=False, health="off", failures=0.0)
    exact.join("z", noise=0.3)
    filtered = exact.run(table, time="t")
    # 400 members know a mean to a twentieth of a deviation.
    assert np.sqrt(np.mean((found["x0"] - filtered["x0"]) ** 2)) < 0.2 * filtered["x0_sd"].mean()
    assert abs(found["x0_sd"].mean() / filtered["x0_sd"].mean() - 1) < 0.05
    before = made.states
    for observation, problem in (({"z": np.inf}, Exception), ({"y": 1.0}, fb.ArgumentError)):
        with pytest.raises(problem):
            made.step(observation)
        assert np.array_equal(made.states, before)
    failing = fb.EnsembleFilter(start, lambda x, dt, rng: x[:, :3], lambda x: x[0], noise=0.3, seed=5)
    with pytest.raises(fb.ArgumentError, match="as the members"):
        failing.step(1.0)
    assert np.array_equal(failing.states, start)
    with pytest.raises(fb.ArgumentError, match="at least 1"):
        ensemble(start, inflation=0.5)


@pytest.mark.parametrize("lag", [0.0, 0.4, 1.0, 2.5, 1e6])
def test_a_fixed_lag_takes_in_the_rows_within_it(lag):
    model = fb.Model.reverting(mean=20.0, time_constant=3.0, variance=4.0)
    t = np.array([0.0, 1.0, 1.5, 1.5, 2.5, 5.0, 5.4, 6.4, 6.5, 9.0])
    z = 20 + np.random.default_rng(1).standard_normal(t.size)
    z[4] = np.nan
    centre = fb.FusionCentre(model, mean=20.0, deviation=2.0, learn_noise=False, health="off")
    centre.join("a", noise=0.5)
    found = centre.run(pl.DataFrame({"t": t, "a": z}), time="t", smooth=lag)
    prior = 4.0 * np.exp(-np.abs(np.subtract.outer(t, t)) / 3.0)
    seen = ~np.isnan(z)
    # Rows of one time are one instant.
    times = np.unique(t)
    assert len(found) in (t.size, times.size)
    for row, now in enumerate(found["t"]):
        last = np.max(np.flatnonzero(t <= now + lag * (1 + 1e-9)))
        known = seen & (np.arange(t.size) <= last)
        here = int(np.flatnonzero(t == now)[-1])
        if np.isclose(t, now).sum() > 1 and lag == 0.0:
            continue
        weights = prior[here, known] @ np.linalg.inv(prior[np.ix_(known, known)] + 0.25 * np.eye(known.sum()))
        assert np.isclose(found["x0_smooth"][row], 20 + weights @ (z[known] - 20), atol=1e-9)
        assert np.isclose(found["x0_smooth_sd"][row] ** 2, prior[here, here] - weights @ prior[known, here], atol=1e-9)


def test_a_lag_of_all_rows_is_the_smoother_of_all():
    rng = np.random.default_rng(4)
    table = pl.DataFrame({"t": np.cumsum(rng.uniform(0.1, 2, 60)), "a": rng.standard_normal(60)})

    def run(smooth):
        centre = fb.FusionCentre(fb.Model.velocity(0.1), mean=[0, 0], deviation=[3, 1], learn_noise=False)
        centre.join("a", noise=0.5, send="word:3")
        return centre.run(table, time="t", smooth=smooth)

    everything, far, none = run(True), run(1e9), run(0.0)
    assert np.array_equal(everything["x1_smooth"], far["x1_smooth"]) and np.array_equal(none["x1_smooth"], none["x1"])
    assert "x0_smooth" not in run(False).columns and "x0_smooth" not in run(None).columns
    for bad in (-1.0, np.nan, np.inf, "all"):
        with pytest.raises(fb.ArgumentError, match="smooth"):
            run(bad)


@pytest.mark.parametrize("send", ["value", "bit", "word:3"])
@pytest.mark.parametrize("kind", ["points", "ensemble"])
def test_bearings_that_cross_north_are_those_of_a_turned_world(kind, send):
    """The target passes the sensor, so that bearings cross from 360 to 0 degrees; in a world that is turned by half a turn they do not."""
    t = np.arange(60) * 1.0
    x, y = -3.0 + 0.1 * t, np.full(60, 4.0)
    noise = 0.5 * np.random.default_rng(8).standard_normal(60)

    def estimates(turn):
        def bearing(s):
            return (np.degrees(np.arctan2(s[0], 4.0)) + turn) % 360.0

        seen = (np.degrees(np.arctan2(x, y)) + noise + turn) % 360.0
        settings = {"noise": 0.5, "send": send, "period": 360.0}
        if kind == "points":

            def move(s, dt):
                s[0] += dt * s[1]

            made = fb.SigmaPointFilter(move, bearing, process=1e-4 * np.eye(2), mean=[-3.0, 0.0], deviation=[0.5, 0.2], **settings)
        else:

            def drift(s, dt, rng):
                s[0] += dt * s[1]
                rng.add_normal(s[0], 0.01)
                rng.add_normal(s[1], 0.01)

            start = np.random.default_rng(2).standard_normal((2, 400)) * [[0.5], [0.2]] + [[-3.0], [0.0]]
            made = fb.EnsembleFilter(start, drift, bearing, seed=3, **settings)
        found = []
        for z in seen:
            made.step(z)
            found.append(made.mean[0])
        return np.array(found)

    ahead, behind = estimates(0.0), estimates(180.0)
    assert np.allclose(ahead, behind, atol=1e-6)
    assert np.abs(ahead - x)[20:].max() < (0.2 if send == "value" else 0.6)


def test_a_period_is_above_zero():
    with pytest.raises(fb.Error, match="period"):
        ensemble(np.zeros((1, 3)), period=0.0)
    with pytest.raises(fb.Error, match="period"):
        ensemble(np.zeros((1, 3)), {"a": lambda x: x[0]}, noise={"a": 1.0}, period={"b": 360.0})
