"""The sign-bit Kalman filter against the exact posterior of its bits, and its extensions: words, noisy and lost bits, several sensors, a
state of two dimensions. The formulas are derived from the paper's (22), (23), (29) as docs/dymbo.md states them.
"""

from functools import lru_cache

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import comb

from common import between, lloyd_max, mean_and_error, ndtr, numbers, phi, truncated
from dymbo import FIRST, ONE_BIT, RECIPES, Chain, exact, filtered, gain, plant, predicted, steady, steady_predicted, variances


# Distance from the exact posterior of the same bits

@RECIPES.of("dymbo-gap/mmse")
def tree(row):
    """Exact minimum error after n bits, over all strings: densities of the error that carry the string's probability."""
    a, gamma, (bits,) = plant(row)
    chain = Chain(a, gamma, 14 * max(1.1, np.sqrt(steady_predicted(a, gamma, ONE_BIT))))
    densities = chain.after_first()[None, :]
    for m in variances(a, gamma, FIRST, int(bits))[:-1]:
        k = gain(predicted(a, gamma, m))
        up, down = chain.branch(lambda e: ndtr(e), k), chain.branch(lambda e: ndtr(-e), -k)
        densities = np.concatenate((densities @ up.T, densities @ down.T))
    mass = chain.h * densities.sum(1)
    mean = chain.h * densities @ chain.x / mass
    return chain.h * np.sum(densities @ chain.x**2) - mass @ mean**2


@lru_cache(None)
def posterior_runs(a, gamma, chains=192, steps=900, lags=(), every=30):
    """Simulated bits with the exact density of the error given them; per chain the mean squared posterior mean (the excess), and
    for each lag the mean error of the exact smoother and what the Rauch-Tung-Striebel smoother adds to it."""
    rng = np.random.default_rng(7)
    p = steady_predicted(a, gamma, ONE_BIT)
    k, m = gain(p), filtered(p, ONE_BIT)
    chain = Chain(a, gamma, 9 * np.sqrt(p))
    branches = {b: chain.branch(lambda e, b=b: ndtr(b * e), b * k) for b in (1, -1)}
    density = np.tile(phi(chain.x / np.sqrt(m)) / np.sqrt(m), (chains, 1))
    bits_of, kept, excess = [], {}, np.zeros(chains)
    for step in range(steps):
        before = density.copy()
        up = density @ branches[1].T
        share = chain.h * up.sum(1) / (chain.h * density.sum(1))  # probability of +1 given the past
        bits = rng.random(chains) < share
        down = density @ branches[-1].T
        density = np.where(bits[:, None], up, down)
        density /= chain.h * density.sum(1, keepdims=True)
        bits_of.append(bits)
        if step >= 60:
            excess += (chain.h * density @ chain.x) ** 2 / (steps - 60)
            if lags and step % every == 0:
                kept[step] = density
        del before
    smoothed = {}
    for lag in lags:
        exact_error, added = np.zeros(chains), np.zeros(chains)
        starts = [s for s in kept if s + lag < steps]
        for s in starts:
            later, shift, back = np.ones_like(kept[s]), np.zeros(chains), a * m / p
            for n in range(s + lag, s, -1):
                b = bits_of[n]
                later = np.where(b[:, None], later @ branches[1], later @ branches[-1])
                shift = back * (np.where(b, k, -k) + shift)  # RTS: s(n-1) - th(n-1) = J (th(n) - a th(n-1) + s(n) - th(n))
            joint = kept[s] * later
            joint /= joint.sum(1, keepdims=True)
            mean = joint @ chain.x
            exact_error += (joint @ chain.x**2 - mean**2) / len(starts)
            added += (mean - shift) ** 2 / len(starts)
        smoothed[lag] = (exact_error, added)
    return excess, smoothed


RECIPES.of("dymbo-gap/excess")(lambda row: mean_and_error(posterior_runs(*numbers(row))[0]))
RECIPES.of("dymbo-gap/nees")(lambda row: exact(*numbers(row)) / steady(*numbers(row)))


@RECIPES.of("dymbo-gap/percent")
def gap_percent(row):
    a, gamma, _ = plant(row)
    mean, error = mean_and_error(posterior_runs(a, gamma)[0])
    return 100 * mean / exact(a, gamma), 100 * error / exact(a, gamma)


@RECIPES.of("dymbo-gap/kurtosis")
def kurtosis(row):
    a, gamma, _ = plant(row)
    chain = Chain(a, gamma)
    density = chain.stationary(chain.signs(gain(steady_predicted(a, gamma, ONE_BIT))))
    return chain.moment(density, 4) / chain.moment(density) ** 2


@RECIPES.of("dymbo-gap/tuned")
def tuned(row):
    """Percent by which the best constant gain is better."""
    a, gamma, _ = plant(row)
    chain, k = Chain(a, gamma), gain(steady_predicted(a, gamma, ONE_BIT))
    error = lambda k: chain.moment(chain.stationary(chain.signs(k)))
    return 100 * (1 - minimize_scalar(error, bounds=(0.8 * k, 1.2 * k), method="bounded").fun / error(k))


SMOOTHED = {(0.9, 0.5): (1, 2, 5, 20), (0.9, 0.05): (1, 5, 20), (0.99, 1.0): (1, 20)}


def smoother_runs(a, gamma, lag):
    return posterior_runs(a, gamma, 192, 900, SMOOTHED[(a, gamma)])[1][int(lag)]


@RECIPES.of("dymbo-smoother/exact")
def smoother_exact(row):
    a, gamma, (lag,) = plant(row)
    return mean_and_error(smoother_runs(a, gamma, lag)[0])


@RECIPES.of("dymbo-smoother/rts")
def smoother_rts(row):
    a, gamma, (lag,) = plant(row)
    best, added = smoother_runs(a, gamma, lag)
    return mean_and_error(best + added)


@RECIPES.of("dymbo-smoother/predicted")
def smoother_predicted(row):
    a, gamma, (lag,) = plant(row)
    p = steady_predicted(a, gamma, ONE_BIT)
    m = filtered(p, ONE_BIT)
    smoothed, back = m, a * m / p
    for _ in range(int(lag)):
        smoothed = m + back**2 * (smoothed - p)
    return smoothed


# Words of several bits: (22) and (23) with the innovation's Lloyd-Max quantizer

def information(bits):
    """c: the part of the innovation's variance that its word explains, 1 minus the quantizer's distortion."""
    edges, centroids = lloyd_max(2**bits)
    e = np.concatenate(([-np.inf], edges, [np.inf]))
    return between(e[:-1], e[1:]) @ centroids**2


RECIPES.of("dymbo-bits/c")(lambda row: information(int(row.split()[-1])))


@lru_cache(None)
def word_error(a, gamma, bits):
    """Exact steady error with words: cell j moves the error by -(P/s) c_j."""
    p = steady_predicted(a, gamma, information(bits))
    s, chain = np.sqrt(p + 1), Chain(a, gamma)
    edges, centroids = lloyd_max(2**bits)
    e = s * np.concatenate(([-np.inf], edges, [np.inf]))
    step = sum(chain.branch(lambda x, lo=lo, hi=hi: between(lo - x, hi - x), p / s * c) for lo, hi, c in zip(e[:-1], e[1:], centroids))
    return chain.moment(chain.stationary(step))


@RECIPES.of("dymbo-bits/exact_mse")
def bits_mse(row):
    a, gamma, (bits,) = plant(row)
    return word_error(a, gamma, int(bits))


@RECIPES.of("dymbo-bits/loss")
def bits_loss(row):
    a, gamma, (bits,) = plant(row)
    return word_error(a, gamma, int(bits)) / steady(a, gamma, 1.0)


def successive(bits, exactly):
    """Cells of `bits` bits about one sample of N(0, 1), each threshold at the mean so far; and the means that the filter believes in.
    `exactly`: the cell's mean; else the mean of (22), which takes every cell for normal."""
    cells = [(-np.inf, np.inf, 0.0, 1.0)]
    for _ in range(bits):
        split = []
        for lo, hi, mean, variance in cells:
            step = np.sqrt(ONE_BIT * variance)
            for sign, (a, b) in ((-1, (lo, mean)), (1, (mean, hi))):
                empty = a >= b
                level = float(truncated(a, b)[0]) if exactly and not empty else mean + sign * step
                split.append((max(lo, a), min(hi, b), level, variance * (1 - ONE_BIT)) if not empty else (0.0, 0.0, level, 0.0))
        cells = split
    lo, hi, level, _ = np.array(cells).T
    mass = between(lo, hi)
    centre = np.where(mass > 0, phi(lo) - phi(hi), 0) / np.where(mass > 0, mass, 1)
    return mass, centre, level


RECIPES.of("dymbo-bits/claimed")(lambda row: 1 - (1 - ONE_BIT) ** int(row))


@RECIPES.of("dymbo-bits/own-levels")
def own_levels(row):
    mass, centre, level = successive(int(row), False)
    return mass @ (2 * level * centre - level**2)


@RECIPES.of("dymbo-bits/centroids")
def centroids(row):
    mass, centre, _ = successive(int(row), False)
    return mass @ centre**2


@RECIPES.of("dymbo-bits/exact-tree")
def exact_tree(row):
    mass, centre, _ = successive(int(row), True)
    return mass @ centre**2


# Bits inverted with a known probability: c = 2/pi (1 - 2 eps)^2

RECIPES.of("dymbo-bsc/aware")(lambda row: exact(*numbers(row)))
RECIPES.of("dymbo-bsc/naive")(lambda row: exact(*numbers(row), 0.0))
RECIPES.of("dymbo-bsc/cost")(lambda row: exact(*numbers(row), 0.0) / exact(*numbers(row)) - 1)


# Bits lost with a known probability

@RECIPES.of("dymbo-erasure/bound")
def erasure_bound(row):
    """The variance's map is concave, so its mean is below the fixed point of the mean map."""
    a, gamma, (lost,) = plant(row)
    return steady(a, gamma, (1 - lost) * ONE_BIT)


@RECIPES.of("dymbo-erasure/mean")
def erasure_mean(row):
    a, gamma, (lost,) = plant(row)
    rng = np.random.default_rng(3)
    m, total = np.full(2000, steady(a, gamma)), np.zeros(2000)
    for step in range(1600):
        p = predicted(a, gamma, m)
        m = np.where(rng.random(2000) < lost, p, filtered(p, ONE_BIT))
        total += m * (step >= 100)
    return mean_and_error(total / 1500)


# Several one-bit sensors a slot

@RECIPES.of("dymbo-sensors/sequential")
def sequential(row):
    a, gamma, (sensors,) = plant(row)
    m = 1.0
    for _ in range(2000):
        m = predicted(a, gamma, m)
        for _ in range(int(sensors)):
            m = filtered(m, ONE_BIT)
    return m


@RECIPES.of("dymbo-sensors/kalman")
def sensors_kalman(row):
    a, gamma, (sensors,) = plant(row)
    return steady(a, gamma * sensors, 1.0) / sensors


def count_error(a, gamma, sensors, fuse):
    """Exact steady error with all bits at once: `fuse(P)` gives the variance after them and the move for each count of +1."""
    p = 1.0
    for _ in range(500):
        p = predicted(a, gamma, fuse(p)[0])
    chain, moves = Chain(a, gamma), fuse(p)[1]
    chance = lambda r: lambda e: comb(sensors, r) * ndtr(e) ** r * ndtr(-e) ** (sensors - r)
    return chain.moment(chain.stationary(sum(chain.branch(chance(r), move) for r, move in enumerate(moves))))


@RECIPES.of("dymbo-sensors/parallel")
def parallel(row):
    """Linear estimate from the sum of the bits; two bits correlate by the arcsine law."""
    a, gamma, (sensors,) = plant(row)
    k = int(sensors)

    def fuse(p):
        spread = 1 + (k - 1) * ONE_BIT * np.arcsin(p / (p + 1))
        g = np.sqrt(ONE_BIT) * p / np.sqrt(p + 1) / spread
        return p - ONE_BIT * p * p / (p + 1) * k / spread, g * (2 * np.arange(k + 1) - k)

    return count_error(a, gamma, k, fuse)


@RECIPES.of("dymbo-sensors/table")
def table(row):
    """Posterior mean given the count, the error before being N(0, P)."""
    a, gamma, (sensors,) = plant(row)
    k = int(sensors)

    def fuse(p):
        e = np.sqrt(p) * np.linspace(-9, 9, 2001)
        r = np.arange(k + 1)[:, None]
        joint = comb(k, r) * ndtr(e) ** r * ndtr(-e) ** (k - r) * phi(e / np.sqrt(p))
        joint /= joint.sum()
        means = joint @ e / joint.sum(1)
        return p - joint.sum(1) @ means**2, means

    return count_error(a, gamma, k, fuse)


# A state of two dimensions

A = np.array([[0.95, 0.25], [-0.1, 0.9]])
Q = 0.3 * np.eye(2)
DIRECTIONS = {"one sensor": [(1, 0)]}
DIRECTIONS["three in turn"] = DIRECTIONS["three at once"] = [(1, 0), (0, 1), (0.5**0.5, 0.5**0.5)]


def linear_fusion(cov, h):
    """Gain and covariance of the linear estimate from sign bits against one common prediction, arcsine law."""
    total = h @ cov @ h.T + np.eye(len(h))
    scale = np.sqrt(np.diag(total))
    c_bits = ONE_BIT * np.arcsin(np.clip(total / np.outer(scale, scale), -1, 1))
    np.fill_diagonal(c_bits, 1)
    cross = np.sqrt(ONE_BIT) * cov @ h.T / scale
    k = cross @ np.linalg.inv(c_bits)
    return k, cov - k @ cross.T


def vector_slot(scheme, cov):
    """Gains of a slot, (index of the sensors that answer together, gain), and the covariance after it."""
    h, gains = np.array(DIRECTIONS[scheme], float), []
    groups = [np.arange(len(h))] if scheme.endswith("once") else [np.array([i]) for i in range(len(h))]
    for group in groups:
        k, cov = linear_fusion(cov, h[group])
        gains.append((group, k))
    return gains, cov


def vector_steady(scheme):
    cov = np.eye(2)
    for _ in range(1000):
        gains, after = vector_slot(scheme, A @ cov @ A.T + Q)
        cov = after
    return gains, cov


RECIPES.of("dymbo-vector/trace")(lambda row: np.trace(vector_steady(row)[1]))


@RECIPES.of("dymbo-vector/kalman")
def vector_kalman(row):
    cov, h = np.eye(2), np.array(DIRECTIONS[row], float)
    for _ in range(1000):
        p = A @ cov @ A.T + Q
        cov = p - p @ h.T @ np.linalg.inv(h @ p @ h.T + np.eye(len(h))) @ h @ p
    return np.trace(cov)


@lru_cache(None)
def vector_runs(scheme, runs=24, steps=60, burn=15):
    """Simulated bits with the exact density of the error in the plane: per run trace of the exact covariance, squared posterior mean
    (the excess) and normalised error over the dimension."""
    rng = np.random.default_rng(5)
    gains, cov = vector_steady(scheme)
    precision, h = np.linalg.inv(cov), np.array(DIRECTIONS[scheme], float)
    x = np.linspace(-8.5, 8.5, 63)
    e1, e2 = (g.ravel() for g in np.meshgrid(x, x, indexing="ij"))
    result = []
    for _ in range(runs):
        truth = np.linalg.cholesky(cov) @ rng.normal(size=2)
        density = np.exp(-0.5 * (precision[0, 0] * e1**2 + 2 * precision[0, 1] * e1 * e2 + precision[1, 1] * e2**2))
        offset, sums = np.zeros(2), np.zeros(3)
        for step in range(steps):
            # density holds p(e before the bits' moves); `offset` is what those moves sum to
            c1 = A[0, 0] * (e1 - offset[0]) + A[0, 1] * (e2 - offset[1])
            c2 = A[1, 0] * (e1 - offset[0]) + A[1, 1] * (e2 - offset[1])
            keep = density > density.max() * 1e-13
            g1 = np.exp(-((x[:, None] - c1[keep]) ** 2) / (2 * Q[0, 0])) * density[keep]
            g2 = np.exp(-((x[:, None] - c2[keep]) ** 2) / (2 * Q[1, 1]))
            density = (g1 @ g2.T).ravel()
            truth = A @ (truth - offset) + np.sqrt(0.3) * rng.normal(size=2)
            offset = np.zeros(2)
            for group, k in gains:
                start = offset.copy()
                for i, column in zip(group, k.T):
                    bit = 1 if h[i] @ (truth - start) + rng.normal() >= 0 else -1
                    density = density * ndtr(bit * (h[i, 0] * (e1 - start[0]) + h[i, 1] * (e2 - start[1])))
                    offset = offset + column * bit
            density /= density.sum()
            d1, d2 = e1 - offset[0], e2 - offset[1]
            mean = np.array([density @ d1, density @ d2])
            second = np.array([[density @ d1**2, density @ (d1 * d2)], [density @ (d1 * d2), density @ d2**2]])
            if step >= burn:
                sums += np.array([np.trace(second) - mean @ mean, mean @ mean, np.trace(precision @ second) / 2])
        result.append(sums / (steps - burn))
    return np.array(result)


RECIPES.of("dymbo-vector/mmse")(lambda row: mean_and_error(vector_runs(row)[:, 0]))
RECIPES.of("dymbo-vector/excess")(lambda row: mean_and_error(vector_runs(row)[:, 1]))
RECIPES.of("dymbo-vector/nees")(lambda row: mean_and_error(vector_runs(row)[:, 2]))


@RECIPES.of("dymbo-vector/percent")
def vector_percent(row):
    mean, error = mean_and_error(vector_runs(row)[:, 1])
    trace = vector_runs(row)[:, 0].mean()
    return 100 * mean / trace, 100 * error / trace
