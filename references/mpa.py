"""Tracking from quantized ranges: Movaghati, thesis, chapter 3. What is exact: rings, products of mixtures, kernels, weights
(docs/pf-mpa.md; errata `mpa-1` ... of docs/errata.md). Trackers are in mpa_tracking.py, the two targets in mpa_association.py.
"""

from itertools import product

import numpy as np
from scipy.integrate import quad
from scipy.special import ndtr

from common import Recipes

RECIPES = Recipes()

# Rings: a cell [a, b] of range in noise of deviation s has the radial law l(d); the message needs d l(d) (erratum mpa-3)

DEVIATION = {"9-10.5": 0.03, "1-2.5": 0.005, "0.2-1.7": 0.003, "4-5": 0.3}


def ring(row):
    a, b = (float(v) for v in row.split("-"))
    s = DEVIATION[row]
    law = lambda d: ndtr((b - d) / s) - ndtr((a - d) / s)
    low, high = max(0.0, a - 9 * s), b + 9 * s
    inner = [p for p in (a - 3 * s, a, a + 3 * s, a + 9 * s, (a + b) / 2, b - 9 * s, b - 3 * s, b, b + 3 * s) if low < p < high]
    pieces = np.unique([low, *inner, high])
    total = lambda f: sum(quad(f, p, q, epsabs=1e-14, epsrel=1e-13)[0] for p, q in zip(pieces[:-1], pieces[1:]))
    mass, first, second = total(law), total(lambda d: d * law(d)), total(lambda d: d * d * law(d))
    mean = first / mass
    # the two densities l(d) / mass and d l(d) / first cross at d = mean
    pieces = np.unique([*pieces, mean])
    apart = total(lambda d: abs(d / first - 1 / mass) * law(d)) / 2
    return mean, second / first, apart


RECIPES.of("mpa-ring/printed")(lambda row: ring(row)[0])
RECIPES.of("mpa-ring/exact")(lambda row: ring(row)[1])
RECIPES.of("mpa-ring/tv")(lambda row: ring(row)[2])


@RECIPES.of("mpa-ring/weights")
def weights(row):
    """Second moment of Algorithm 4's ratio (1/N) sum_j f(x | j) / f(x | i), x from f(. | i), n components d deviations apart (erratum mpa-4)."""
    n, d = (int(v) for v in row.split("x"))
    m = d * np.arange(n)
    exponent = (m[None, :, None] - m[:, None, None]) * (m[None, None, :] - m[:, None, None])
    return np.exp(exponent).sum((1, 2)).mean() / n**2


def kernel_error(points, dimensions, factor):
    """Integrated squared error of a kernel estimate of N(0, I), kernel covariance `factor` I."""
    size = lambda v: (4 * np.pi * v) ** (-dimensions / 2)
    return size(factor) / points + (1 - 1 / points) * size(1 + factor) - 2 * size(1 + factor / 2) + size(1)


@RECIPES.of("mpa-ring/kernel-printed")
def kernel_printed(row):
    points, d = (int(w[1:]) for w in row.split("-"))
    return kernel_error(points, d, points ** (-1 / 6))


@RECIPES.of("mpa-ring/kernel-silverman")
def kernel_silverman(row):
    points, d = (int(w[1:]) for w in row.split("-"))
    return kernel_error(points, d, (4 / ((d + 2) * points)) ** (2 / (d + 4)))


# Products of mixtures by enumeration, and the Gibbs sampler's label chain (3.10), (3.11)

LINE = ([[0.0], [1.0], [2.5]], [[0.5], [1.5], [3.0]], [[0.2], [1.1], [2.0]])
CASES = {
    "A": (LINE, ([[0.25]], [[0.36]], [[0.5]]), ([0.2, 0.5, 0.3], [0.3, 0.3, 0.4], [0.6, 0.3, 0.1])),
    "B": (([[0.0], [4.0]],) * 2, ([[0.25]],) * 2, ([0.5, 0.5],) * 2),
    "C": (([[0, 0], [1, 0.5], [2, 1]], [[0.3, 0.2], [1.2, 0.2], [1.5, 1.5]]),
          ([[0.3, 0.1], [0.1, 0.2]], [[0.5, -0.1], [-0.1, 0.4]]), ([0.4, 0.4, 0.2], [0.2, 0.5, 0.3])),
}


def normal(x, mean, cov):
    d = np.subtract(x, mean)
    return np.exp(-0.5 * d @ np.linalg.solve(cov, d)) / np.sqrt(np.linalg.det(2 * np.pi * np.array(cov)))


def enumeration(case):
    """Labels, their joint weights (not normalised) and the mean of each component of the product."""
    means, covs, weights = CASES[case]
    precision = sum(np.linalg.inv(c) for c in covs)
    labels = list(product(*(range(len(m)) for m in means)))
    mass, centres = [], []
    for b in labels:
        centre = np.linalg.solve(precision, sum(np.linalg.solve(c, np.array(m[i])) for m, c, i in zip(means, covs, b)))
        parts = [w[i] * normal(centre, m[i], c) for m, c, w, i in zip(means, covs, weights, b)]
        mass.append(np.prod(parts) * np.sqrt(np.linalg.det(2 * np.pi * np.linalg.inv(precision))))
        centres.append(centre)
    return labels, np.array(mass), np.array(centres)


@RECIPES.of("mpa-gibbs/mean")
def gibbs_mean(row):
    _, mass, centres = enumeration(row[0])
    return mass @ centres[:, int(row[1])] / mass.sum()


RECIPES.of("mpa-gibbs/log-mass")(lambda row: np.log(enumeration(row[0])[1].sum()))


def sweep(case):
    """Transition of the labels in one sweep: each in turn is drawn given the others."""
    labels, mass, _ = enumeration(case)
    step = np.eye(len(labels))
    for l in range(len(labels[0])):
        same = np.array([[all(a[i] == b[i] for i in range(len(a)) if i != l) for b in labels] for a in labels])
        step = step @ (same * mass / (same @ mass)[:, None])
    return step


@RECIPES.of("mpa-gibbs/tv")
def gibbs_tv(row):
    labels, mass, _ = enumeration(row[0])
    law = np.array([np.prod([w[i] for w, i in zip(CASES[row[0]][2], b)]) for b in labels])
    law = law @ np.linalg.matrix_power(sweep(row[0]), int(row.split("t")[1]))
    return np.abs(law - mass / mass.sum()).sum() / 2


RECIPES.of("mpa-gibbs/eigenvalue")(lambda row: np.sort(np.abs(np.linalg.eigvals(sweep(row[0]))))[-2])
