"""Which sensor sends which bit: Movaghati, thesis, chapter 6 and appendix C. X is uniform on [-1, 1], N sensors send the N bits of the
Gray word of the cell; errata `assign-1` ... are those of docs/errata.md. The row "sigma" of Table 6.1 holds variances (assign-1).
"""

from functools import lru_cache
from itertools import permutations

import numpy as np
from scipy.optimize import linear_sum_assignment

from common import Recipes, mean_and_error, ndtr

RECIPES = Recipes()


@lru_cache(None)
def nodes(bits, width):
    """Gauss-Legendre nodes of [-1, 1] with breaks at every cell; pieces no longer than `width`."""
    cells = 2**bits
    pieces = cells * max(1, int(np.ceil(2 / cells / width)))
    t, w = np.polynomial.legendre.leggauss(6)
    edges = np.linspace(-1, 1, pieces + 1)
    half = 1 / pieces
    x = (edges[:-1, None] + half * (t + 1)).ravel()
    return x, np.tile(w * half, pieces) / 2  # density 1/2


def gray(bits):
    """Gray bits of every cell, the first the coarsest: [bit, cell]."""
    cell = np.arange(2**bits)
    word = cell ^ (cell >> 1)
    return (word[None, :] >> np.arange(bits - 1, -1, -1)[:, None]) & 1


def one_probability(bits, x, sigma):
    """P(bit b = 1 | x) for every bit b; the outer cells reach to infinity."""
    edges = np.concatenate(([-np.inf], np.linspace(-1, 1, 2**bits + 1)[1:-1], [np.inf]))
    mass = np.diff(ndtr((edges[:, None] - x) / sigma), axis=0)
    return gray(bits) @ mass


class Network:
    """N sensors of given variances; `p[b, n, x]` is the probability of a 1 if sensor n sends bit b."""

    def __init__(self, variances):
        self.sigmas = np.sqrt(variances)
        self.n = len(self.sigmas)
        self.x, self.w = nodes(self.n, 2 * self.sigmas.min())
        self.p = np.stack([one_probability(self.n, self.x, s) for s in self.sigmas], axis=1)
        cells = 2**self.n
        cell = np.minimum(((self.x + 1) / 2 * cells).astype(int), cells - 1)
        self.bit = gray(self.n)[:, cell]
        centre = -1 + (2 * cell + 1) / cells
        self.flipped = np.empty((self.n, len(self.x)))  # centre of the cell whose Gray word differs in bit b: a mirror in its block
        for b in range(self.n):
            block = 2 / 2**b
            low = -1 + block * np.floor((centre + 1) / block)
            self.flipped[b] = 2 * low + block - centre

    def cost(self):
        """(6.5): Gamma[b, n], the error that sensor n adds when it sends bit b wrongly."""
        wrong = np.where(self.bit[:, None] == 1, 1 - self.p, self.p)
        return np.einsum("bx,bnx,x->bn", (self.x - self.flipped) ** 2, wrong, self.w)

    def approximate(self, who):
        return 1 / (3 * 4**self.n) + self.cost()[np.arange(self.n), list(who)].sum()

    def best(self):
        return tuple(linear_sum_assignment(self.cost())[1])

    def centre(self, who):
        """Exact error of the decoder that answers the centre of the cell (assign-2), bit by bit from the finest:
        with s = (-1)^z the estimate is -u_1, u_k = s_k (1/2 + u_(k+1)/2)."""
        first, second = np.zeros_like(self.x), np.zeros_like(self.x)
        for b in range(self.n - 1, -1, -1):
            first, second = (1 - 2 * self.p[b, who[b]]) * (0.5 + first / 2), 0.25 + first / 2 + second / 4
        return self.w @ (self.x**2 + 2 * self.x * first + second)

    def posterior_mean(self, who):
        """Exact error of the posterior mean, over all words."""
        q = np.ones((1, len(self.x)))
        for b in range(self.n):
            one = self.p[b, who[b]]
            q = np.concatenate((q * one, q * (1 - one)))
        total, first = q @ self.w, q @ (self.w * self.x)
        return self.w @ self.x**2 - np.sum(first**2 / np.maximum(total, 1e-300))


# Table 6.1

TABLE = np.array([0.04, 0.03, 0.02, 0.01, 0.008, 0.006, 0.005, 0.001])


@lru_cache(None)
def table61():
    return Network(TABLE)


def assignment(row):
    return {"I": tuple(range(8)), "II": tuple(range(7, -1, -1))}.get(row) or table61().best()


RECIPES.of("assign-table6-1/approx")(lambda row: table61().approximate(assignment(row)))
RECIPES.of("assign-table6-1/center")(lambda row: table61().centre(assignment(row)))
RECIPES.of("assign-table6-1/mmse")(lambda row: table61().posterior_mean(assignment(row)))


# Figures 6.3 and 6.4: four sensors, variances of given mean and deviation

def variances(rng, mean, deviation):
    """Uniform on the sphere of these moments, all at least 1e-4."""
    while True:
        z = rng.normal(size=4)
        z -= z.mean()
        v = mean + deviation * z / np.sqrt(np.mean(z**2))
        if v.min() >= 1e-4:
            return v


@lru_cache(None)
def networks(mean, deviation, count=400):
    """[network, (alg, min, ii, avg)] for each decoder."""
    rng = np.random.default_rng(63)
    result = {"centre": [], "posterior mean": []}
    for _ in range(count):
        v = variances(rng, mean, deviation)
        net = Network(v)
        ways = list(permutations(range(4)))
        chosen = ways.index(net.best()), ways.index(tuple(np.argsort(v)))
        for decoder, error in (("centre", net.centre), ("posterior mean", net.posterior_mean)):
            e = np.array([error(w) for w in ways])
            result[decoder].append((e[chosen[0]], e.min(), e[chosen[1]], e.mean()))
    return {name: np.array(rows) for name, rows in result.items()}


for place, quantity in enumerate(("alg", "min", "ii", "avg")):
    def answer(row, figure, place=place):
        at, decoder = row.split(" ", 1)
        mean, deviation = (0.03, float(at)) if figure == 3 else (float(at), 0.015)
        return mean_and_error(networks(mean, deviation)[decoder][:, place])

    for figure in (3, 4):
        RECIPES.of(f"assign-fig6-{figure}/{quantity}")(lambda row, answer=answer, figure=figure: answer(row, figure))


@RECIPES.of("assign-figC-1/pa1")
def figure_c1(row):
    """Probability that the first bit is wrong at x > 0, noise variance 0.03."""
    return ndtr(-float(row) / np.sqrt(0.03))
