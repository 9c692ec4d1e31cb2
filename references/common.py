"""What the programs of all systems share: the committed values, the list of functions that recompute them, a few formulas."""

import csv
import os
import re

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")  # before NumPy is loaded

import numpy as np
from scipy.special import log_ndtr, ndtr  # noqa: F401  (for the modules)

HERE = os.path.dirname(os.path.abspath(__file__))
VALUES = os.path.join(HERE, "..", "crates", "experiments", "references")
SYSTEMS = ("dymbo", "mi", "binary", "assign", "cfwmd", "mpa", "handoff", "diffusive", "problems", "targets")


def committed(system):
    """The rows of `crates/experiments/references/<system>.csv`, as dictionaries."""
    with open(os.path.join(VALUES, system + ".csv"), newline="") as file:
        return list(csv.DictReader(file))


class Recipes:
    """Which function recomputes which values. A key is `<figure>/<quantity>/<row>`."""

    def __init__(self):
        self.known = []

    def of(self, quantity, row=""):
        """Decorates `f(row)`, which returns a value or (value, standard error).

        `quantity` is `<figure>/<quantity>`, `row` a regular expression (all rows if it is empty).
        """

        def add(function):
            self.known.append((quantity, re.compile(row), function))
            return function

        return add

    def find(self, key):
        figure, quantity, row = key.split("/", 2)
        for name, pattern, function in self.known:
            if name == figure + "/" + quantity and pattern.search(row):
                return lambda: function(row)
        return None


def numbers(row):
    """The numbers of a row's label that stand alone: `0.9 0.5 eq14` has 0.9 and 0.5."""
    return [float(word) for word in re.split(r"[ ,=]+", row) if re.fullmatch(r"-?\d+(\.\d+)?", word)]


def phi(x):
    """Standard normal density."""
    return np.exp(-0.5 * np.square(x)) / np.sqrt(2 * np.pi)


def between(a, b):
    """Phi(b) - Phi(a) for a <= b, from the side where nothing cancels."""
    a, b = np.broadcast_arrays(np.asarray(a, float), np.asarray(b, float))
    right = a > 0
    return np.where(right, ndtr(-a) - ndtr(-b), ndtr(b) - ndtr(a))


def log_between(a, b):
    """ln(Phi(b) - Phi(a)) for a < b, in the tails too."""
    a, b = np.broadcast_arrays(np.asarray(a, float), np.asarray(b, float))
    flip = a > 0
    a, b = np.where(flip, -b, a), np.where(flip, -a, b)
    upper, lower = log_ndtr(b), log_ndtr(a)
    with np.errstate(divide="ignore", invalid="ignore"):
        return upper + np.log(-np.expm1(np.where(np.isneginf(lower), -np.inf, lower - upper)))


def truncated(a, b):
    """Mean and variance of N(0, 1) between a and b."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    mass = between(a, b)
    fa, fb = phi(a) / mass, phi(b) / mass
    edge = lambda x, f: np.where(np.isfinite(x), np.where(np.isfinite(x), x, 0.0) * f, 0.0)
    mean = fa - fb
    return mean, 1 + edge(a, fa) - edge(b, fb) - mean**2


def lloyd_max(levels):
    """Edges and centroids of the Lloyd-Max quantizer of N(0, 1)."""
    from scipy.optimize import root

    def centroids(edges):
        e = np.concatenate(([-np.inf], edges, [np.inf]))
        return (phi(e[:-1]) - phi(e[1:])) / between(e[:-1], e[1:])

    def gap(edges):
        c = centroids(np.sort(edges))
        return np.sort(edges) - (c[:-1] + c[1:]) / 2

    if levels == 2:
        return np.zeros(1), centroids(np.zeros(1))
    from scipy.special import ndtri

    # Panter and Dite: the point density goes with the cube root of the density, a normal one of variance 3.
    start = np.sqrt(3) * ndtri(np.arange(1, levels) / levels)
    edges = np.sort(root(gap, start, tol=1e-14).x)
    return edges, centroids(edges)


def mean_and_error(samples):
    """Mean and its standard error of independent samples."""
    samples = np.asarray(samples, float)
    return samples.mean(), samples.std(ddof=1) / np.sqrt(len(samples))
