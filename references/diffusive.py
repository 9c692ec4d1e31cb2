"""A diffusive source: Zhao and Nehorai, IEEE Trans. Signal Processing 55(4), 2007. Chains of nodes that carry the exact belief or one
Gaussian over the position; the release rate is known, or one unknown rate shared by all samples (errata `diffusive-1`, `-2`).
Mixtures and polynomial Gaussians are not recomputed: their values depend on the fit (starts, merging), not on the paper alone.
"""

from functools import lru_cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import erfc

from common import Recipes, log_between

RECIPES = Recipes()
K, RATES, BIAS = 40.0, (0.5, 1.5), 1e-5
EXAMPLES = {"A": ((73.0, 38.0), 4e-6, 10, 1e-6), "B": ((62.0, 50.0), 8e-6, 5, 1e-5)}  # source, noise, samples, threshold of det
START, PRIOR = np.array([44.396, 52.042]), 50.0


def response(r, times):
    """(9) on impermeable ground, both ends on it: concentration of a unit rate at distance r, one column a time."""
    r = np.maximum(r, 1e-3)[..., None]
    return erfc(r / np.sqrt(4 * K * times)) / (2 * np.pi * K * r)


class Search:
    """One deployment: nodes, their noisy samples, and what has been visited."""

    def __init__(self, example, reach, seed, quantized=False):
        source, self.sigma, count, self.threshold = EXAMPLES[example]
        rng = np.random.default_rng(seed)
        self.nodes, self.source = rng.uniform(0, 100, (300, 2)), np.array(source)
        self.first = int(np.argmin(np.linalg.norm(self.nodes - START, axis=1)))
        self.nodes[self.first] = START
        self.times = 5.0 * np.arange(1, count + 1)
        clean = response(np.linalg.norm(self.nodes - self.source, axis=1), self.times) + BIAS
        y = clean + self.sigma * rng.normal(size=clean.shape)
        if quantized:  # at a step of sigma: the receiver adds the rounding's variance
            y = np.round(y / self.sigma) * self.sigma
        self.y = y - BIAS
        self.variance = self.sigma**2 * (13 / 12 if quantized else 1)
        d = np.linalg.norm(self.nodes[:, None] - self.nodes, axis=2)
        self.near = [np.flatnonzero((row <= reach) & (row > 0)) for row in d]

    def log_density(self, theta, used, known, h=0.0, prior=None):
        """ln of the belief; with h > 0 of one that is widened so that no cell of side h misses a narrow peak."""
        mean, cov = (START, PRIOR**2 * np.eye(2)) if prior is None else prior
        d = theta - mean
        logs = -0.5 * np.einsum("ni,ij,nj->n", d, np.linalg.inv(cov + (h / 2) ** 2 * np.eye(2)), d)
        a2, ay, yy = 0.0, 0.0, 0.0
        for n in used:
            r = np.linalg.norm(theta - self.nodes[n], axis=1)
            a, y, v = response(r, self.times), self.y[n], self.variance
            if h:
                size = np.maximum(np.abs(y), self.sigma)
                slope = size / np.maximum(r - 0.7 * h, 0.3 * h)[:, None] + size * 2 * r[:, None] / (4 * K * self.times)
                v = v + (slope * h / 2) ** 2
            a2, ay, yy = a2 + (a * a / v).sum(1), ay + (a * y / v).sum(1), yy + (y * y / v * np.ones_like(a)).sum(1)
        if known:
            return logs - 0.5 * (a2 - 2 * ay + yy)
        a2 = np.maximum(a2, 1e-20)
        root, best = np.sqrt(a2), ay / a2
        inside = log_between((RATES[0] - best) * root, (RATES[1] - best) * root)
        inside = np.where(np.isfinite(inside), inside, -1e9)
        return logs - 0.5 * (yy - ay * best) - np.log(root) + inside

    def belief(self, used, known, prior=None):
        """Mean and covariance of the position, from cells that are refined until their side is small against it."""
        h, box = 2.0, np.arange(-59, 160, 2.0)
        theta = np.stack(np.meshgrid(box, box, indexing="ij"), -1).reshape(-1, 2)
        corners = np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)]) / 4
        for _ in range(14):
            wide = self.log_density(theta, used, known, h, prior)
            theta = theta[wide > wide.max() - 18]
            logs = self.log_density(theta, used, known, 0.0, prior)
            w = np.exp(logs - logs.max())
            w /= w.sum()
            mean = w @ theta
            d = theta - mean
            cov = (w[:, None] * d).T @ d
            sd = np.sqrt(np.linalg.eigvalsh(cov)[0])
            rough = 1 / np.sum(w**2) < 40
            if h < 0.35 * sd and not rough or h < 1e-3 or len(theta) > 60000:
                break
            theta, h = (theta[:, None] + corners * h).reshape(-1, 2), h / 2
        return mean, cov

    def candidates(self, at, used):
        """Unvisited neighbours; if there are none, the unvisited nodes fewest hops away."""
        seen, ring = {at}, [at]
        while ring:
            ring = sorted({int(m) for n in ring for m in self.near[n]} - seen)
            seen |= set(ring)
            fresh = [n for n in ring if n not in used]
            if fresh:
                return fresh
        return []

    def run(self, known, cap, gaussian):
        """(whether the determinant fell below the threshold, nodes used, distance of the estimate from the source)."""
        at, used, prior = self.first, [self.first], None
        while True:
            mean, cov = self.belief(used[-1:] if gaussian else used, known, prior)
            if gaussian:
                prior = mean, cov
            reached = np.linalg.det(cov) < self.threshold
            choice = self.candidates(at, used)
            if reached or len(used) >= cap or not choice:
                return reached, len(used), np.linalg.norm(mean - self.source)
            d = self.nodes[choice] - mean
            score = -np.einsum("ni,ij,nj->n", d, np.linalg.inv(cov), d)
            at = choice[int(np.argmax(score))]
            used.append(at)


@lru_cache(None)
def searches(example, reach, known=False, cap=30, gaussian=False, quantized=False, count=60):
    return np.array([Search(example, reach, 1000 + s, quantized).run(known, cap, gaussian) for s in range(count)], float)


def answer(quantity, runs):
    reached = runs[:, 0] > 0
    if quantity == "reach":
        p = reached.mean()
        return p, np.sqrt((p + 0.01) * (1.01 - p) / len(runs))
    samples = runs[reached, 1 if quantity.startswith("nodes") else 2]
    rng = np.random.default_rng(1)
    return np.median(samples), np.std([np.median(rng.choice(samples, len(samples))) for _ in range(300)])


def chain(figure):
    example = "A" if figure.endswith("fig4") else "B"

    def runs(row):
        belief, reach = row.rsplit(" ", 1)
        gaussian = belief.startswith("gaussian")
        return searches(example, float(reach), belief.endswith("known rate"), cap=40 if gaussian else 30, gaussian=gaussian)
    return runs


for quantity in ("reach", "nodes_median", "final_err_median"):
    for figure in ("diffusive-fig4", "diffusive-fig8"):
        RECIPES.of(f"{figure}/{quantity}", r"^(exact|exact known rate|gaussian known rate) 1[05]$")(
            lambda row, runs=chain(figure), quantity=quantity: answer(quantity, runs(row)))
    RECIPES.of(f"diffusive-bytes/{quantity}", "^raw")(
        lambda row, quantity=quantity: answer(quantity, searches("B", 15.0, quantized=True)))


@RECIPES.of("diffusive-envelope/radius")
def radius(row):
    """Where the concentration is 1e-4 on the ground, 100 s after the start of a unit rate, no wind."""
    return brentq(lambda r: response(np.array(r), np.array([100.0]))[0] - 1e-4, 1, 100, xtol=1e-12)
