"""One bit a sensor: the van Trees bound with the best weight, ten sensors with many thresholds or with feedback (figure 5.10), and searches
among other patterns.
"""

from functools import lru_cache

import numpy as np
from scipy.linalg import solve_banded
from scipy.special import log_ndtr, ndtr

import assign
from binary import GRAY, RECIPES, Source, descent
from common import phi


@RECIPES.of("binary-fig5-8/ratio")
def tightness(row):
    """-q'' + J(x) q = 1, q(-1) = q(1) = 0; the bound is the mean of q. Second differences, extrapolated to step 0."""
    source = Source(float(row[:-3]))

    def bound(cells):
        x = np.linspace(-1, 1, cells + 1)[1:-1]
        h, j = 2 / cells, 0.0
        for mask in GRAY[3]:
            pattern = source.pattern(mask)
            u = (np.concatenate(([-np.inf], source.edges, [np.inf]))[:, None] - x) / source.s
            mass = np.where(u[:-1] > 0, ndtr(-u[:-1]) - ndtr(-u[1:]), ndtr(u[1:]) - ndtr(u[:-1]))
            slope = np.diff(pattern) @ phi((source.edges[:, None] - x) / source.s) / source.s
            j = j + slope**2 / np.maximum(mass[pattern == 0].sum(0) * mass[pattern == 1].sum(0), 1e-300)
        bands = np.vstack((np.full(cells - 1, -1 / h**2), 2 / h**2 + j, np.full(cells - 1, -1 / h**2)))
        return solve_banded((1, 1), bands, np.ones(cells - 1)).sum() * h / 2

    coarse, fine = bound(20000), bound(40000)
    return (fine + (fine - coarse) / 3) / source.mse(GRAY[3])


# Figure 5.10: ten sensors

RECIPES.of("binary-fig5-10/lbqp_b3")(lambda row: Source(float(row[:-3]), pieces=1.6, nodes=8).search(10)[0][0])


@lru_cache(None)
def ten(bits, snr, sensors=10, starts=3):
    """Best masks that descents find, from the repeated Gray basis and from scattered starts."""
    s = Source(snr, bits, pieces=2.0, nodes=6)
    basis = [2 ** (bits - 1)] + [3 << k for k in range(bits - 2, -1, -1)]
    rng = np.random.default_rng(bits)
    tries = [[basis[n % bits] for n in range(sensors)]]
    tries += [basis + [int(m) for m in rng.integers(1, 2**bits, sensors - bits)] for _ in range(starts - 1)]
    return min(descent(s, t) for t in tries)[0]


@lru_cache(None)
def resolutions(snr):
    return {bits: ten(bits, snr) for bits in range(3, 8)}


RECIPES.of("binary-fig5-10/lbqp_best")(lambda row: min(resolutions(float(row[:-3])).values()))
RECIPES.of("binary-fig5-10/bits")(lambda row: min((error, bits) for bits, error in resolutions(float(row[:-3])).items())[1])


def most_likely(thresholds, bits, s):
    """Maximum of the likelihood of bits over [-1, 1], by bisection on the sign of the score, from logarithms (binary-21).
    One row a string."""
    low, high = np.full(len(bits), -1.0), np.full(len(bits), 1.0)
    for _ in range(60):
        x = (low + high) / 2
        u = (x[:, None] - thresholds) / s * np.where(bits, 1, -1)
        logs = -0.5 * u**2 - log_ndtr(u)
        top = logs.max(1, keepdims=True)
        rises = np.sum(np.exp(logs - top) * np.where(bits, 1, -1), 1) > 0
        up = np.max(np.where(bits, logs, -np.inf), 1), np.max(np.where(bits, -np.inf, logs), 1)
        rises = np.where(np.abs(up[0] - up[1]) > 30, up[0] > up[1], rises)
        low, high = np.where(rises, x, low), np.where(rises, high, x)
    return (low + high) / 2


@RECIPES.of("binary-fig5-10/aqml_mle")
def adaptive(row):
    """Each threshold at the most likely state so far, the answer the most likely state: exact over all 1024 strings."""
    s = Source(float(row[:-3]), nodes=12, pieces=1.0)
    thresholds, bits = np.zeros((1, 0)), np.zeros((1, 0), bool)
    q = np.ones((1, len(s.x)))
    for n in range(10):
        t = most_likely(thresholds, bits, s.s) if n else np.zeros(1)
        one = ndtr((s.x - t[:, None]) / s.s)
        q = np.concatenate((q * one, q * ndtr((t[:, None] - s.x) / s.s)))
        thresholds = np.tile(np.hstack((thresholds, t[:, None])), (2, 1))
        bits = np.hstack((np.tile(bits, (2, 1)), np.repeat([True, False], len(t))[:, None]))
    answer = most_likely(thresholds, bits, s.s)
    return np.sum(q * (s.x - answer[:, None]) ** 2 @ s.w)


@RECIPES.of("binary-fig5-10/ribeiro_relaxed")
def multi_threshold(row):
    """Least E[1 / sum_k rho_k I(x; t_k)] over rho >= 0 that sum to ten, 401 thresholds."""
    s = Source(float(row[:-3]), nodes=6)
    t = np.linspace(-1 - 2 * s.s, 1 + 2 * s.s, 401)
    u = (s.x - t[:, None]) / s.s
    information = np.exp(-(u**2) - log_ndtr(u) - log_ndtr(-u)) / (2 * np.pi * s.s**2)
    rho = np.full(401, 10 / 401)
    for _ in range(5000):
        total = rho @ information
        value, slope = s.w @ (1 / total), information @ (s.w / total**2)
        rho *= np.sqrt(10 * slope / value)
        rho *= 10 / rho.sum()
        if np.max(10 * slope / value) - 1 < 3e-4:
            break
    return value


# Other patterns

@RECIPES.of("binary-beyond/change")
def any_rank(row):
    """Percent that patterns of any rank gain over those of full rank."""
    _, _, source, sensors, snr = row.split("-")
    s = Source(float(snr), 3, source == "gaussian")
    best = lambda full: s.search(int(sensors[1:]), full)[0][0]
    return 100 * (best(False) / best(True) - 1)


@RECIPES.of("binary-beyond/after", "^bits")
def finer(row):
    _, bits, sensors, snr = row.split("-")
    return ten(int(bits), float(snr), int(sensors[1:]), 6)


RECIPES.of("binary-beyond/after", "assign-mmse")(lambda row: assign.table61().posterior_mean(assign.table61().best()))


@RECIPES.of("binary-beyond/after", "exchange")
def exchange(row):
    """Two sensors exchanged at a time while that lowers the posterior mean's error, from the linear assignment."""
    net = assign.table61()
    who = list(net.best())
    error, improved = net.posterior_mean(who), True
    while improved:
        improved = False
        for i in range(8):
            for j in range(i):
                other = list(who)
                other[i], other[j] = other[j], other[i]
                if (e := net.posterior_mean(other)) < error - 1e-15:
                    who, error, improved = other, e, True
    return error
