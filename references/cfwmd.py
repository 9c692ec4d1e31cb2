"""Censoring with a fusion centre that uses silence (CFwMD): scalar measurements with feedback. Equations as in docs/cfwmd.md; errata
`cfwmd-1` ... are those of docs/errata.md. All trials of an experiment are simulated together; every scheme sees the same truth and noise.

The fusion centre's belief is Gaussian; the moments after silence are exact, by quadrature over y = h'x.
"""

from functools import lru_cache

import numpy as np
from scipy.special import ndtr, ndtri

from common import Recipes, between, numbers, phi

RECIPES = Recipes()
F = np.array([[1.0, 1.0], [0.0, 1.0]])
G = np.array([0.5, 1.0])
START = np.array([0.0, 10.0])
STEPS = 20


def truth(rng, trials, acceleration, start_variance=0.0):
    """x[k, trial, 2] for k = 0 ... STEPS."""
    x = [START + np.sqrt(start_variance) * rng.normal(size=(trials, 2))]
    for _ in range(STEPS):
        x.append(x[-1] @ F.T + np.sqrt(acceleration) * rng.normal(size=(trials, 1)) * G)
    return np.array(x)


def own_filter(acceleration, start_variance=0.0, r=1.0):
    """Innovation variance s_k of a sensor that hears only itself: free of data."""
    p, s = start_variance * np.eye(2), []
    for _ in range(STEPS):
        p = F @ p @ F.T + acceleration * np.outer(G, G)
        s.append(p[0, 0] + r)
        p = p - np.outer(p[:, 0], p[0]) / s[-1]
    return np.array(s)


def predict(mean, cov, acceleration):
    return mean @ F.T, F @ cov @ F.T + acceleration * np.outer(G, G)


def measure(mean, cov, z, r):
    """Kalman update with a value z of variance r of the position; where r is infinite nothing is known."""
    gain = cov[:, :, 0] / (cov[:, 0, 0] + r)[:, None]
    return mean + gain * (z - mean[:, 0])[:, None], cov - gain[:, :, None] * cov[:, 0][:, None]


def silence(mean, cov, factor):
    """Moments after a factor that depends on the position y alone; `factor(y)` takes [trial, node]."""
    p = cov[:, 0, 0]
    u = np.linspace(-6.5, 6.5, 45)
    y = mean[:, :1] + np.sqrt(p)[:, None] * u
    w = phi(u) * factor(y)
    total = w.sum(1)
    shift = (w @ u) / total
    shrink = (w @ u**2) / total - shift**2
    gain = cov[:, :, 0] / np.sqrt(p)[:, None]
    return mean + gain * shift[:, None], cov - (1 - shrink)[:, None, None] * gain[:, :, None] * gain[:, None, :]


def values(z, sent, r=1.0):
    """All values that arrived are one value: their mean, with the variance r over their number."""
    n = sent.sum(1)
    return np.where(n > 0, (z * sent).sum(1) / np.maximum(n, 1), 0.0), np.where(n > 0, r / np.maximum(n, 1), np.inf)


@lru_cache(None)
def scheduled_variances(sensors, messages, acceleration=4.0):
    """s_k = r + the mean of the fusion centre's predicted variance, from a simulation with covariance feedback."""
    return run("CFwMD2", sensors, messages, trials=500, seed=99)["s"]


@lru_cache(None)
def run(scheme, sensors=2, messages=1.0, acceleration=4.0, start_variance=0.0, loss=0.0, trials=5000, seed=1):
    """Squared errors [trial, step, 2] and messages [trial, step] of a scheme."""
    rng = np.random.default_rng(seed)
    x = truth(rng, trials, acceleration, start_variance)
    mean, cov = np.tile(START, (trials, 1)), np.tile(start_variance * np.eye(2), (trials, 1, 1))
    own = own_filter(acceleration, start_variance)
    eta = ndtri(1 - messages / (2 * sensors)) ** 2
    errors, count, used = [], [], []
    for k in range(STEPS):
        z = x[k + 1, :, :1] + rng.normal(size=(trials, sensors))
        chance, arrived = rng.random((trials, sensors)), rng.random((trials, sensors)) >= loss
        mean, cov = predict(mean, cov, acceleration)
        at = mean[:, 0].copy()
        nu = z - at[:, None]
        s = np.full(trials, own[k])
        if scheme in ("CFwMD2", "trigger, centre's s"):
            s = cov[:, 0, 0] + 1
        if scheme == "scheduled":
            s = np.full(trials, scheduled_variances(sensors, messages)[k])
        if scheme == "all":
            sent = np.ones_like(z, bool)
        elif scheme == "random":
            sent = chance < messages / sensors
        elif scheme.startswith("trigger"):
            strength = ((1 - messages / sensors) ** -2 - 1) / s
            sent = chance >= np.exp(-0.5 * nu**2 * strength[:, None])
        else:
            sent = nu**2 >= eta * s[:, None]
        heard = sent & arrived
        mean, cov = measure(mean, cov, *values(z, heard))
        quiet = sensors - heard.sum(1)
        if scheme.startswith("trigger"):  # silence is a measurement at the prediction with the variance r + 1/Y
            mean, cov = measure(mean, cov, at, np.where(quiet > 0, (1 + 1 / strength) / np.maximum(quiet, 1), np.inf))
        elif scheme not in ("all", "random", "CFoMD"):
            c = np.sqrt(eta * s)[:, None]

            def factor(y, c=c, at=at, quiet=quiet):  # (cfwmd-1): only eta s under the root
                inside = ndtr(c - (y - at[:, None])) - ndtr(-c - (y - at[:, None]))
                if scheme == "loss modelled":
                    inside = loss + (1 - loss) * inside
                return np.maximum(inside, 1e-300) ** quiet[:, None]

            mean, cov = silence(mean, cov, factor)
        errors.append((mean - x[k + 1]) ** 2)
        count.append(sent.sum(1))
        used.append(s.mean())
    return {"errors": np.swapaxes(errors, 0, 1), "count": np.array(count).T, "s": np.array(used)}


def rmse(squares):
    """Root of the mean over trials (first axis) and steps, with its standard error."""
    trials = squares.reshape(len(squares), -1).mean(1)
    root = np.sqrt(trials.mean())
    return root, trials.std(ddof=1) / np.sqrt(len(trials)) / (2 * root)


def rate(count):
    trials = count.mean(1)
    return trials.mean(), trials.std(ddof=1) / np.sqrt(len(trials))


def three(figure, pattern, simulate):
    """Position, velocity and rate of `simulate(row)`."""
    RECIPES.of(f"{figure}/position_rmse", pattern)(lambda row: rmse(simulate(row)["errors"][:, :, 0]))
    RECIPES.of(f"{figure}/velocity_rmse", pattern)(lambda row: rmse(simulate(row)["errors"][:, :, 1]))
    RECIPES.of(f"{figure}/rate", pattern)(lambda row: rate(simulate(row)["count"]))


def scheme_of(row):
    return row.rsplit(", ", 1)[0]


def budget(row):
    return float(row.rsplit("= ", 1)[1])


three("cfwmd-fig1", "", lambda row: run(scheme_of(row), 2, budget(row)))
three("cfwmd-fig2", "", lambda row: run(scheme_of(row), 4, budget(row)))
three("cfwmd-table1", "", lambda row: run(row.split(",")[0], 4, budget(row), start_variance=5.0))
three("cfwmd-lossy", "", lambda row: run(row.split(",")[0], 2, budget(row), loss=numbers(row)[0]))
three("cfwmd-scheduled", "^scheduled", lambda row: run("scheduled", int(numbers(row)[0]), budget(row)))
RECIPES.of("cfwmd-fig1/first-step")(lambda row: rmse(run(row.split(",")[0])["errors"][:, 0, 0]))


@RECIPES.of("cfwmd-lossy/gain")
def lossy_gain(row):
    """Squared position error, silence for every missing message minus losses modelled, on the same trials."""
    squares = [run(name, loss=numbers(row)[0])["errors"][:, :, 0].mean(1) for name in ("loss ignored", "loss modelled")]
    d = squares[0] - squares[1]
    return d.mean(), d.std(ddof=1) / np.sqrt(len(d))


@RECIPES.of("cfwmd-scheduled/bound")
def bound(row):
    """Recursion of the Fisher information of sent and silent sensors, averaged over the prediction's error."""
    sensors, messages = numbers(row)
    own, cov, sum_p = own_filter(4.0), np.zeros((2, 2)), 0.0
    u = np.linspace(-8, 8, 801)
    for k in range(STEPS):
        cov = F @ cov @ F.T + 4.0 * np.outer(G, G)
        c = np.sqrt(own[k]) * ndtri(1 - messages / (2 * sensors))
        mu = np.sqrt(cov[0, 0]) * u
        a, b = -c - mu, c - mu
        inside = between(a, b)
        j = 1 - (inside + a * phi(a) - b * phi(b)) + (phi(b) - phi(a)) ** 2 / np.maximum(inside, 1e-300)
        j = sensors * (phi(u) @ j) / phi(u).sum()
        cov = cov - np.outer(cov[:, 0], cov[0]) * j / (1 + j * cov[0, 0])
        sum_p += cov[0, 0]
    return np.sqrt(sum_p / STEPS)


# Particle filters of figure `cfwmd-cost`

def resample(rng, weights, *arrays):
    """Systematic resampling of each trial."""
    trials, n = weights.shape
    total = np.cumsum(weights, 1)
    total /= total[:, -1:]
    u = (np.arange(n) + rng.random((trials, 1))) / n
    index = np.minimum(np.array([np.searchsorted(t, v) for t, v in zip(total, u)]), n - 1)
    return [np.take_along_axis(a, index if a.ndim == 2 else index[:, :, None], 1) for a in arrays]


@lru_cache(None)
def bootstrap(particles, trials=1000, seed=2):
    """CFwMD with the bootstrap filter, two sensors, l = 1."""
    rng = np.random.default_rng(seed)
    x, own, eta = truth(rng, trials, 4.0), own_filter(4.0), ndtri(0.75) ** 2
    cloud, errors, count = np.tile(START, (trials, particles, 1)), [], []
    for k in range(STEPS):
        z = x[k + 1, :, :1] + rng.normal(size=(trials, 2))
        cloud = cloud @ F.T + 2.0 * rng.normal(size=(trials, particles, 1)) * G
        at, c = cloud[:, :, 0].mean(1), np.sqrt(eta * own[k])
        sent = np.abs(z - at[:, None]) >= c
        mu = cloud[:, :, 0] - at[:, None]
        logs = (2 - sent.sum(1))[:, None] * np.log(np.maximum(ndtr(c - mu) - ndtr(-c - mu), 1e-300))
        for i in (0, 1):
            logs = logs - 0.5 * np.where(sent[:, i : i + 1], z[:, i : i + 1] - cloud[:, :, 0], 0) ** 2
        w = np.exp(logs - logs.max(1, keepdims=True))
        w /= w.sum(1, keepdims=True)
        errors.append((np.einsum("tn,tnd->td", w, cloud) - x[k + 1]) ** 2)
        count.append(sent.sum(1))
        (cloud,) = resample(rng, w, cloud)
    return {"errors": np.swapaxes(errors, 0, 1), "count": np.array(count).T}


def draw_between(rng, a, b):
    """N(0, 1) between a and b by the inverse of the distribution function, in the left tail."""
    flip = a > 0
    lo, hi = np.where(flip, -b, a), np.where(flip, -a, b)
    p, q = ndtr(lo), ndtr(hi)
    u = ndtri(np.clip(p + (q - p) * rng.random(a.shape), 1e-300, 1 - 1e-16))
    return np.where(flip, -1, 1) * np.clip(u, lo, hi)


@lru_cache(None)
def imputing(particles, trials=1000, seed=3):
    """CFwMD where each particle imputes what the silent sensors measured; given that, everything is a Kalman filter."""
    rng = np.random.default_rng(seed)
    x, own, eta = truth(rng, trials, 4.0), own_filter(4.0), ndtri(0.75) ** 2
    means, cov = np.tile(START, (trials, particles, 1)), np.zeros((2, 2))
    logs, errors, count = np.zeros((trials, particles)), [], []
    for k in range(STEPS):
        z = x[k + 1, :, :1] + rng.normal(size=(trials, 2))
        means = means @ F.T
        cov = F @ cov @ F.T + 4.0 * np.outer(G, G)
        w = np.exp(logs - logs.max(1, keepdims=True))
        at = (w * means[:, :, 0]).sum(1) / w.sum(1)
        c = np.sqrt(eta * own[k])
        sent = np.abs(z - at[:, None]) >= c
        for order in (0, 1):  # those that sent come first
            i = np.where(sent[:, 0], order, 1 - order)
            s, m = cov[0, 0] + 1, means[:, :, 0]
            told = np.take_along_axis(sent, i[:, None], 1)
            value = np.take_along_axis(z, i[:, None], 1)
            a, b = ((at - c)[:, None] - m) / np.sqrt(s), ((at + c)[:, None] - m) / np.sqrt(s)
            inside = np.where(a > 0, ndtr(-a) - ndtr(-b), ndtr(b) - ndtr(a))
            imputed = np.where(told, value, m + np.sqrt(s) * draw_between(rng, a, b))
            logs = logs + np.where(told, -0.5 * (value - m) ** 2 / s, np.log(np.maximum(inside, 1e-300)))
            means = means + (imputed - m)[:, :, None] * cov[:, 0] / s
            cov = cov - np.outer(cov[:, 0], cov[0]) / s
        w = np.exp(logs - logs.max(1, keepdims=True))
        w /= w.sum(1, keepdims=True)
        errors.append((np.einsum("tn,tnd->td", w, means) - x[k + 1]) ** 2)
        count.append(sent.sum(1))
        poor = 1 / (w**2).sum(1) < particles / 2
        (fresh,) = resample(rng, w, means)
        means, logs = np.where(poor[:, None, None], fresh, means), np.where(poor[:, None], 0, logs)
    return {"errors": np.swapaxes(errors, 0, 1), "count": np.array(count).T}


three("cfwmd-cost", "^ADF", lambda row: run("CFwMD"))
three("cfwmd-cost", "^PF", lambda row: bootstrap(int(row.split(",")[0][3:])))
three("cfwmd-cost", "^RBPF", lambda row: imputing(int(row.split(",")[0][5:])))
