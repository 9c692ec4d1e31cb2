"""One bit a sensor: Movaghati, thesis, chapter 5 and appendix B. A mask m selects the natural patterns whose sum modulo 2 is a sensor's
pattern, the first the most significant digit. Errata `binary-1` ... are those of docs/errata.md; errors by quadrature of (5.4).
"""

from functools import lru_cache
from itertools import combinations, permutations

import numpy as np
from scipy.optimize import brentq
from scipy.special import comb, log_ndtr, ndtr

from common import Recipes, numbers, phi

RECIPES = Recipes()
PRINTED_EDGES = np.array([0.5006, 1.05, 1.748])  # Lloyd-Max of N(0, 1), as printed


class Source:
    """Uniform on [-1, 1], or Gaussian of variance 0.1, at a signal-to-noise ratio; nodes and the edges of 2^B cells."""

    def __init__(self, snr, bits=3, gaussian=False, nodes=12, pieces=2.0):
        self.gaussian, self.bits = gaussian, bits
        self.variance = 0.1 if gaussian else 1 / 3
        self.s = np.sqrt(self.variance / 10 ** (snr / 10))
        span = 9 * np.sqrt(0.1) if gaussian else 1.0
        count = int(np.ceil(2 * span / min(pieces * self.s, 0.5)))
        t, w = np.polynomial.legendre.leggauss(nodes)
        half = span / count
        self.x = (np.linspace(-span, span, count + 1)[:-1, None] + half * (t + 1)).ravel()
        density = phi(self.x / np.sqrt(0.1)) / np.sqrt(0.1) if gaussian else 0.5
        self.w = np.tile(w * half, count) * density
        if gaussian:
            self.edges = np.sqrt(0.1) * np.concatenate((-PRINTED_EDGES[::-1], [0], PRINTED_EDGES))
        else:
            self.edges = np.linspace(-1, 1, 2**bits + 1)[1:-1]
        u = (np.concatenate(([-np.inf], self.edges, [np.inf]))[:, None] - self.x) / self.s
        self.mass = np.where(u[:-1] > 0, ndtr(-u[:-1]) - ndtr(-u[1:]), ndtr(u[1:]) - ndtr(u[:-1]))

    def pattern(self, mask):
        word = np.arange(2**self.bits)
        return np.array([bin(mask & c).count("1") % 2 for c in word])

    def both(self, pattern):
        """P(0 | x) and P(1 | x), each a sum of positive masses."""
        pattern = np.asarray(pattern)
        return self.mass[pattern == 0].sum(0), self.mass[pattern == 1].sum(0)

    @lru_cache(None)
    def linear(self, mask):
        return self.both(self.pattern(mask))

    def score(self, q):
        """Explained variance: sum over outcomes of M1^2 / M0."""
        total, first = q @ self.w, q @ (self.w * self.x)
        return np.sum(np.where(total > 1e-290, first**2 / np.maximum(total, 1e-290), 0))

    def mse(self, masks):
        return self.variance - self.score(self.outcomes(masks))

    def outcomes(self, masks):
        q = np.ones((1, len(self.x)))
        for mask in sorted(set(masks)):
            q = self.extend(q, mask, list(masks).count(mask))
        return q

    def extend(self, q, mask, count):
        """Outcomes times the number of ones among `count` sensors of one mask."""
        zero, one = self.linear(mask)
        k = np.arange(count + 1)[:, None]
        p = comb(count, k) * one**k * zero ** (count - k)
        return (q[:, None] * p).reshape(-1, len(self.x))

    def search(self, sensors, full_rank=True):
        """Errors of all multisets of masks: list of (error, masks)."""
        found = []

        def descend(mask, left, q, masks):
            if mask == 2**self.bits:
                if left == 0 and (not full_rank or rank(masks) == self.bits):
                    found.append((self.variance - self.score(q), masks))
                return
            for count in range(left + 1) if mask < 2**self.bits - 1 else [left]:
                descend(mask + 1, left - count, self.extend(q, mask, count) if count else q, masks + (mask,) * count)

        descend(1, sensors, np.ones((1, len(self.x))), ())
        return sorted(found)

    def information(self, pattern):
        """Fisher information of a bit, averaged over X (B.17)."""
        zero, one = self.both(pattern)
        slope = np.diff(np.asarray(pattern)) @ phi((self.edges[:, None] - self.x) / self.s) / self.s
        return self.w @ (slope**2 / np.maximum(zero * one, 1e-300))

    def bound(self, masks):
        """(5.13)."""
        prior = 1 / self.variance if self.gaussian else 0.0
        return 1 / (prior + sum(self.information(self.pattern(m)) for m in masks))

    def dmap(self, masks, printed=False):
        """Error of the discrete MAP decoder (5.10); as printed without the division by P(c) (binary-4)."""
        ends = np.concatenate(([-np.inf], self.edges, [np.inf]))
        cells = np.array([(self.x >= a) & (self.x < b) for a, b in zip(ends[:-1], ends[1:])]) * self.w
        mass = cells.sum(1)
        centres = (cells @ self.x) / mass
        logs = np.log(mass)[:, None]
        q = np.ones((1, len(self.x)))
        for m in masks:
            p = np.array(self.linear(m))
            inside = np.log(np.maximum((cells @ p.T) / (1 if printed else mass[:, None]), 1e-300))
            logs = (logs[:, :, None] + inside[:, None, :]).reshape(len(mass), -1)
            q = (q[:, None] * p).reshape(-1, len(self.x))
        answer = centres[np.argmax(logs, 0)]
        return self.variance - 2 * answer @ (q @ (self.w * self.x)) + answer**2 @ (q @ self.w)


def rank(masks):
    basis = []
    for m in masks:
        for b in basis:
            m = min(m, m ^ b)
        if m:
            basis.append(m)
    return len(basis)


GRAY, NATURAL = {3: (4, 6, 3), 4: (8, 12, 6, 3)}, {3: (4, 2, 1), 4: (8, 4, 2, 1)}


class Fine(Source):
    """Nodes with breaks at the cells' edges too, for integrals over cells."""

    def __init__(self, snr, bits=3, gaussian=False):
        super().__init__(snr, bits, gaussian)
        span = 9 * np.sqrt(0.1) if gaussian else 1.0
        ends = np.concatenate(([-span], self.edges, [span]))
        t, w = np.polynomial.legendre.leggauss(12)
        x, weights = [], []
        for a, b in zip(ends[:-1], ends[1:]):
            cuts = np.linspace(a, b, 2 + int((b - a) / self.s))
            half = (cuts[1] - cuts[0]) / 2
            x.append((cuts[:-1, None] + half * (t + 1)).ravel())
            weights.append(np.tile(w * half, len(cuts) - 1))
        self.x = np.concatenate(x)
        self.w = np.concatenate(weights) * (phi(self.x / np.sqrt(0.1)) / np.sqrt(0.1) if gaussian else 0.5)
        u = (np.concatenate(([-np.inf], self.edges, [np.inf]))[:, None] - self.x) / self.s
        self.mass = np.where(u[:-1] > 0, ndtr(-u[:-1]) - ndtr(-u[1:]), ndtr(u[1:]) - ndtr(u[:-1]))


# Figure 5.6: (5.13) of one threshold at zero, natural and Gray words

@RECIPES.of("binary-fig5-6/crossing")
def fig56(row):
    pair, bits, _ = row.split(" ")
    bits = int(bits)
    sets = {"fixed": (2 ** (bits - 1),) * bits, "gray": GRAY[bits], "natural": NATURAL[bits]}
    one, other = (sets[name] for name in pair.split("-"))
    gap = lambda snr: np.log((s := Source(snr, bits)).bound(one) / s.bound(other))
    return brentq(gap, *((1, 11) if pair == "fixed-gray" else (11, 24)), xtol=1e-9)


# Figure 5.9 and Table 5.2: Gaussian source

def equal(one, other, low, high, gaussian):
    gap = lambda snr: (s := Source(snr, 3, gaussian)).mse(one) - s.mse(other)
    return brentq(gap, low, high, xtol=1e-9)


@RECIPES.of("binary-fig5-9/snr_db")
def fig59(row):
    return equal((4, 5, 6), (4, 6, 7), 4.5, 5.8, True) if row.startswith("{4,5,6}") else equal((4, 6, 7), GRAY[3], 5.5, 7, True)


RECIPES.of("binary-fig5-9/mse_signs")(lambda row: Source(-5, 3, True).mse((4, 4, 4)))


def rate_distortion(noise):
    """(5.12) with R = 3."""
    return 0.1 - 0.01 / (0.1 + noise) * (1 - 2.0**-6)


RECIPES.of("binary-fig5-9/dr_print")(lambda row: rate_distortion(0.1 * 10**0.5))
RECIPES.of("binary-fig5-9/dr_per_n")(lambda row: rate_distortion(0.1 * 10**0.5 / 3))


@RECIPES.of("binary-table5-2/mse_mmse")
def table52(row):
    s = Source(5.2, 3, True)
    if row == "printed":
        q = np.ones((1, len(s.x)))
        for p in ("01100110", "10001110", "01011010"):
            q = (q[:, None] * np.array(s.both([int(c) for c in p]))).reshape(-1, len(s.x))
        return s.variance - s.score(q)
    if row in ("Gray", "natural"):
        return s.mse((GRAY if row == "Gray" else NATURAL)[3])
    return s.search(3, row == "best basis")[0][0]


@RECIPES.of("binary-table5-2/count")
def labelings(row):
    """Labelings of eight cells by three bits, up to the order and the complement of the bits; bases of GF(2)^3."""
    if row == "linear bases":
        return sum(rank(m) == 3 for m in combinations(range(1, 8), 3))
    canonical = lambda p: p if p[0] == 0 else tuple(1 - b for b in p)
    mirrored = row.endswith("reflection")
    seen = set()
    for words in permutations(range(8)):
        if words[0]:
            continue  # complements bring the first cell's word to 000
        patterns = [tuple((w >> b) & 1 for w in words) for b in range(3)]
        form = tuple(sorted(patterns))
        if mirrored:
            form = min(form, tuple(sorted(canonical(p[::-1]) for p in patterns)))
        seen.add(form)
    return len(seen)


# Table 5.1 and figure 5.2: eight sensors at 18.2 dB

PRINTED51 = (4, 6, 3, 3, 3, 2, 1, 5)


@lru_cache(None)
def eight(snr=18.2, full_rank=True):
    return Source(snr, pieces=1.6, nodes=8).search(8, full_rank)


@lru_cache(None)
def eight_dmap():
    s = Fine(18.2)
    return sorted((s.dmap(masks), masks) for _, masks in eight())


@RECIPES.of("binary-table5-1/mse_mmse")
def table51(row):
    return Source(18.2).mse(PRINTED51 if row == "printed" else eight()[0][1])


RECIPES.of("binary-table5-1/rank")(lambda row: [m for _, m in eight()].index(tuple(sorted(PRINTED51))))
RECIPES.of("binary-table5-1/mse_dmap", "printed")(lambda row: Fine(18.2).dmap(PRINTED51))
RECIPES.of("binary-table5-1/mse_dmap")(lambda row: eight_dmap()[0][0])
RECIPES.of("binary-table5-1/rank_dmap")(lambda row: [m for _, m in eight_dmap()].index(tuple(sorted(PRINTED51))))


@RECIPES.of("binary-fig5-2/mse")
def fig52(row):
    s = Source(18.2)
    if row.startswith("sides swapped"):  # (binary-1): below -V counts as the last cell, above V as the first
        below, above = ndtr((-1 - s.x) / s.s), ndtr((s.x - 1) / s.s)
        s.mass[0] += above - below
        s.mass[-1] += below - above
    return s.search(8)[0][0]


# Figure 5.7

@RECIPES.of("binary-fig5-7/strategy-3")
def strategy3(row):
    """Gray basis filled up by (5.13): information adds over sensors, so one mask is repeated."""
    s = Source(numbers(row)[1])
    extra = max(range(1, 8), key=lambda m: s.information(s.pattern(m)))
    return s.mse(GRAY[3] + (extra,) * 5) / eight(numbers(row)[1])[0][0]


@RECIPES.of("binary-fig5-7/value")
def special(row):
    if row.startswith("Gray crosses"):
        return equal(GRAY[3], (4, 5, 6), 7, 9, False)
    return eight(22)[0][0] if "22 dB" in row else 0.25**2 / 12


def descent(source, masks, banned=()):
    """Best response of one sensor at a time among all masks, until none changes."""
    masks, table = list(masks), np.array([source.linear(m) for m in range(1, 2**source.bits)])
    changed = True
    while changed:
        changed = False
        for n in range(len(masks)):
            q = source.outcomes(masks[:n] + masks[n + 1 :])
            weighted = (table * source.w).reshape(-1, len(source.x)).T
            total, first = q @ weighted, (q * source.x) @ weighted
            gain = np.where(total > 1e-290, first**2 / np.maximum(total, 1e-290), 0).sum(0).reshape(-1, 2).sum(1)
            if gain.max() > gain[masks[n] - 1] * (1 + 1e-12):
                masks[n], changed = int(np.argmax(gain)) + 1, True
    return source.mse(masks), tuple(masks)


@RECIPES.of("binary-fig5-7/mse")
def tiling(row):
    s = Source(18.2)
    if row.startswith("best"):
        best = eight()[0][1] if row.startswith("best 8") else s.search(4)[0][1]
        return s.mse(best * (16 // len(best)))
    starts = [eight()[0][1] * 2] + [tuple(np.random.default_rng(k).integers(1, 8, 16)) for k in range(6)]
    return min(descent(s, [int(m) for m in start])[0] for start in starts)


# Figure 5.8

RECIPES.of("binary-fig5-8/dmap_print")(lambda row: Fine(float(row[9:-3]), 3, True).dmap(GRAY[3], True))
RECIPES.of("binary-fig5-8/dmap")(lambda row: Fine(float(row[9:-3]), 3, True).dmap(GRAY[3]))
RECIPES.of("binary-fig5-8/crlb")(lambda row: Source(float(row[:-3])).bound(GRAY[3]))
