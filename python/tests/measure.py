"""Speed beside other packages, in turn in one process: `python tests/measure.py`. Minima over repetitions."""

import time
import warnings

import numpy as np
import polars as pl

import fewbits as fb
from fewbits._fewbits import _codec_seconds


def best(work, repetitions=5):
    times = []
    for _ in range(repetitions):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return min(times)


def codec():
    n = 500_000
    x = np.round(20 + np.sin(np.arange(n) / 300) + 0.02 * np.random.default_rng(1).standard_normal(n), 3)
    for effort in ("thorough", "fast"):
        blob = fb.encode(x, 0.02, effort=effort)
        # In turn, by the clock, so that both see the same machine: the library alone, and the way through Python.
        alone, through = [], []
        for _ in range(9):
            alone.append(_codec_seconds(x, 0.02, effort))
            began = time.perf_counter()
            fb.encode(x, 0.02, effort=effort)
            written = time.perf_counter()
            fb.decode(blob)
            through.append((written - began, time.perf_counter() - written))
        (write, read), (rust_write, rust_read) = np.min(through, axis=0), np.min(alone, axis=0)
        print(
            f"codec, {effort}: {n / write / 1e6:.2f}, {n / read / 1e6:.2f} million samples a second, "
            f"{100 * rust_write / write:.1f} and {100 * rust_read / read:.1f} % of the library's speed; {8 * len(blob) / n:.3f} bits"
        )


def move(x, dt, rng):
    x[0] += x[1]
    rng.add_normal(x[1], 0.05)


def root(x):
    """As `np.hypot(x, 3.0)`, whose time is that of the C library."""
    return np.sqrt(x * x + 9.0)


def hypot(x):
    return np.hypot(x, 3.0)


def particle_filters(distance=root, n=10_000, steps=200):
    def seen(x, z):
        return -0.5 * ((z - distance(x[0])) / 0.1) ** 2

    rng = np.random.default_rng(4)
    z = np.hypot(np.cumsum(np.cumsum(0.05 * rng.standard_normal(steps))), 3.0) + 0.1 * rng.standard_normal(steps)
    start = rng.standard_normal((2, n))
    mine = best(lambda: fb.ParticleFilter(start, move, seen, seed=1).run(z)) / steps
    print(f"particle filter, n = {n}, {distance.__name__}: {1e6 * mine:.0f} us a step")
    try:
        import particles
        from particles import distributions as dists
        from particles import state_space_models as ssm
    except ImportError:
        return

    class Model(ssm.StateSpaceModel):
        def PX0(self):
            return dists.IndepProd(dists.Normal(), dists.Normal())

        def PX(self, t, xp):
            return dists.IndepProd(dists.Dirac(loc=xp[:, 0] + xp[:, 1]), dists.Normal(loc=xp[:, 1], scale=0.05))

        def PY(self, t, xp, x):
            return dists.Normal(loc=distance(x[:, 0]), scale=0.1)

    class Lean(particles.FeynmanKac):
        def M0(self, N):
            return np.random.standard_normal((N, 2))

        def M(self, t, xp):
            x = np.empty_like(xp)
            x[:, 0] = xp[:, 0] + xp[:, 1]
            x[:, 1] = xp[:, 1] + 0.05 * np.random.standard_normal(len(xp))
            return x

        def logG(self, t, xp, x):
            return -0.5 * ((z[t] - distance(x[:, 0])) / 0.1) ** 2

    for name, model in (("StateSpaceModel", lambda: ssm.Bootstrap(ssm=Model(), data=z)), ("FeynmanKac", lambda: Lean(T=steps))):
        theirs = best(lambda model=model: particles.SMC(fk=model(), N=n, ESSrmin=0.5).run(), 3) / steps
        print(f"  particles, {name}: {1e6 * theirs:.0f} us a step, {theirs / mine:.1f} times as long")


def kalman_filters(rows=1_000_000, some=20_000):
    rng = np.random.default_rng(2)
    z = np.cumsum(rng.standard_normal(rows))
    z[rng.random(rows) < 0.1] = np.nan
    table = pl.DataFrame({"t": np.arange(rows) * 1.0, "z": z})

    def run(of):
        centre = fb.FusionCentre(
            fb.Model.velocity(0.1), mean=[0, 0], deviation=[3, 3], learn_noise=False, health="off", failures=0.0
        )
        centre.join("z", noise=2.0)
        return centre.run(of, time="t")

    mine = best(lambda: run(table), 2) / rows
    print(f"fusion centre, one sensor, {rows} rows: {1e-3 / mine:.0f} thousand rows a second")
    try:
        from filterpy.kalman import KalmanFilter
    except ImportError:
        return
    filtering = KalmanFilter(dim_x=2, dim_z=1)
    filtering.F, filtering.H = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    filtering.P, filtering.R = np.eye(2) * 9.0, np.array([[4.0]])
    filtering.Q = 0.1 * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
    means = []
    began = time.process_time()
    for row, one in enumerate(z[:some]):
        if row:
            filtering.predict()
        filtering.update(None if np.isnan(one) else one)
        means.append(filtering.x[0, 0])
    theirs = (time.process_time() - began) / some
    off = np.abs(run(table[:some])["x0"] - np.ravel(means)).max()
    print(f"  filterpy: {1e-3 / theirs:.1f} thousand rows a second, {theirs / mine:.0f} times as long; largest difference {off:.1e}")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    codec()
    particle_filters()
    particle_filters(hypot)
    kalman_filters()
