"""The sign-bit Kalman filter: Ribeiro and Giannakis, "Distributed Kalman filtering based on severely quantized WSN data".

Everything in units of the measurement noise (sigma = 1); `gamma` is the process variance. Equation numbers are the paper's; where
docs/errata.md corrects one, its id (`dymbo-1`) stands beside it.
"""

from functools import lru_cache

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from common import Recipes, between, mean_and_error, ndtr, numbers, phi, truncated

RECIPES = Recipes()
ONE_BIT = 2 / np.pi


# Computed variances

def predicted(a, gamma, m):
    """(8): variance before the message."""
    return a * a * m + gamma


def filtered(p, c):
    """(23) with the information coefficient c: 1 without quantization, 2/pi for a sign bit."""
    return p * (1 + (1 - c) * p) / (1 + p)


def steady_predicted(a, gamma, c):
    """Positive root of A p^2 + B p - gamma = 0, the fixed point of (13) and (24) (erratum dymbo-2)."""
    big, linear = 1 - a * a * (1 - c), 1 - gamma - a * a
    return (np.sqrt(linear**2 + 4 * big * gamma) - linear) / (2 * big)


def steady(a, gamma, c=ONE_BIT):
    return filtered(steady_predicted(a, gamma, c), c)


def loss(a, gamma):
    """(25), the right way up (erratum dymbo-3)."""
    return steady(a, gamma) / steady(a, gamma, 1.0)


def variances(a, gamma, start, steps, c=ONE_BIT):
    """M(0) = start, M(1), ... M(steps)."""
    m = [start]
    for _ in range(steps):
        m.append(filtered(predicted(a, gamma, m[-1]), c))
    return np.array(m)


# The error chain: with the threshold at the prediction (erratum dymbo-1) the error is a Markov chain of its own

class Chain:
    """Densities of the error on a grid; the trapezoid rule is spectrally accurate here."""

    def __init__(self, a, gamma, width=None):
        h = min(np.sqrt(gamma), 1) / 2.5
        half = width or 14 * np.sqrt(steady_predicted(a, gamma, ONE_BIT))
        self.a, self.gamma, self.h = a, gamma, h
        self.x = h * np.arange(-np.ceil(half / h), np.ceil(half / h) + 1)

    def branch(self, probability, move):
        """Transition to e = e_p - move, when that happens with `probability(e_p)`: matrix from densities to densities."""
        before = self.x[:, None] + move
        noise = phi((before - self.a * self.x[None, :]) / np.sqrt(self.gamma)) / np.sqrt(self.gamma)
        return probability(before) * noise * self.h

    def signs(self, gain, crossover=0.0):
        """(22): the error after one bit moves by -K b; a bit arrives inverted with probability `crossover`."""
        sent = lambda b: lambda e: crossover + (1 - 2 * crossover) * ndtr(b * e)
        return self.branch(sent(1), gain) + self.branch(sent(-1), -gain)

    def moment(self, density, power=2):
        return self.h * np.sum(density * self.x**power)

    def stationary(self, step):
        """Density that `step` keeps."""
        system = step - np.eye(len(self.x))
        system[len(self.x) // 2] = self.h
        right = np.zeros(len(self.x))
        right[len(self.x) // 2] = 1
        return np.linalg.solve(system, right)

    def after_first(self, tau=1.0):
        """Error of a first message of resolution tau, no prior (Proposition 2)."""
        return between((self.x - tau / 2), (self.x + tau / 2)) / tau


def gain(p, crossover=0.0):
    """(22)."""
    return np.sqrt(ONE_BIT) * (1 - 2 * crossover) * p / np.sqrt(1 + p)


@lru_cache(None)
def exact(a, gamma, crossover=0.0, believed=None):
    """Exact steady error of the filter that believes in a crossover of `believed`."""
    believed = crossover if believed is None else believed
    p = steady_predicted(a, gamma, ONE_BIT * (1 - 2 * believed) ** 2)
    chain = Chain(a, gamma, 14 * np.sqrt(p * (1 + 8 * (crossover > 0))))
    return chain.moment(chain.stationary(chain.signs(gain(p, believed), crossover)))


def exact_course(a, gamma, start, steps, density=None, chain=None):
    """Exact errors n = 0, 1, ... of the filter that starts from the variance `start` after the first message."""
    chain = chain or Chain(a, gamma, 14 * max(1.1, np.sqrt(steady_predicted(a, gamma, ONE_BIT))))
    density = chain.after_first() if density is None else density
    errors = [chain.moment(density)]
    for m in variances(a, gamma, start, steps)[:-1]:
        density = chain.signs(gain(predicted(a, gamma, m))) @ density
        errors.append(chain.moment(density))
    return np.array(errors)


FIRST = 1 + 1 / 12  # sigma^2 + tau^2 / 12 (erratum dymbo-7)


@lru_cache(None)
def course(a, gamma, start=FIRST):
    return exact_course(a, gamma, start, 30)


def plant(row):
    a, gamma, *rest = numbers(row)
    return a, gamma, rest


# Figures 3 to 5

RECIPES.of("dymbo-fig3/kf_reduction")(lambda row: steady(*numbers(row), 1.0))
RECIPES.of("dymbo-fig4/gamma", "^riccati")(
    lambda row: brentq(lambda g: loss(float(row.split()[-1]), g) - 2, 1e-3, 50, xtol=1e-14))
RECIPES.of("dymbo-loss/exact")(lambda row: exact(*numbers(row)) / steady(*numbers(row), 1.0))
RECIPES.of("dymbo-fig4/gamma", "^exact")(
    lambda row: brentq(lambda g: exact(float(row.split()[-1]), g) / steady(float(row.split()[-1]), g, 1.0) - 2, 0.5, 1.5, xtol=1e-9))


@RECIPES.of("dymbo-fig5/dymbo_exact")
def fig5_exact(row):
    a, gamma, (n,) = plant(row)
    return course(a, gamma)[int(n)]


@RECIPES.of("dymbo-fig5/kf_pred")
def fig5_kalman(row):
    a, gamma, (n,) = plant(row)
    return variances(a, gamma, 1.0, 50, 1.0)[int(n)]


def steps_to(values, level):
    return int(np.argmax(np.abs(np.array(values) / level - 1) <= 0.05))


@RECIPES.of("dymbo-fig5/steps-dymbo")
def steps_dymbo(row):
    a, gamma, _ = plant(row)
    return steps_to(variances(a, gamma, FIRST, 50), steady(a, gamma))


@RECIPES.of("dymbo-fig5/steps-kf")
def steps_kf(row):
    a, gamma, _ = plant(row)
    return steps_to(variances(a, gamma, 1.0, 50, 1.0), steady(a, gamma, 1.0))


@RECIPES.of("dymbo-fig5/peak-computed")
def peak_computed(row):
    a, gamma, _ = plant(row)
    return np.max(variances(a, gamma, FIRST, 30) / variances(a, gamma, 1.0, 30, 1.0))


@RECIPES.of("dymbo-fig5/peak-exact")
def peak_exact(row):
    a, gamma, _ = plant(row)
    return np.max(course(a, gamma) / variances(a, gamma, 1.0, 30, 1.0))


@RECIPES.of("dymbo-start/cold-sign-bit")
def cold_bit(row):
    a, gamma, (start,) = plant(row)
    return steps_to(variances(a, gamma, start, 60), steady(a, gamma))


@RECIPES.of("dymbo-start/cold-Kalman")
def cold_kalman(row):
    a, gamma, (start,) = plant(row)
    return steps_to(variances(a, gamma, start, 60, 1.0), steady(a, gamma, 1.0))


def first_cells(a, gamma):
    """First message of resolution 1 with the stationary prior N(0, S): edges, probabilities and variances of the cells (erratum dymbo-13)."""
    prior = gamma / (1 - a * a)
    s = np.sqrt(prior + 1)
    edges = np.arange(-np.ceil(9 * s), np.ceil(9 * s) + 1) + 0.5
    mean, variance = truncated(edges[:-1] / s, edges[1:] / s)
    return prior, edges, between(edges[:-1] / s, edges[1:] / s), prior / s * mean, (prior + prior**2 * variance) / (prior + 1)


@RECIPES.of("dymbo-start/e13")
def e13(row):
    _, _, mass, _, variance = first_cells(*numbers(row))
    return mass @ variance


@RECIPES.of("dymbo-start/entropy")
def entropy(row):
    mass = first_cells(*numbers(row))[2]
    return -np.sum(mass * np.log2(mass))


@lru_cache(None)
def informed_course(a, gamma):
    """Exact errors after prior and first message together: one error chain a cell."""
    prior, edges, mass, means, cells = first_cells(a, gamma)
    chain = Chain(a, gamma, 16)
    total = 0
    for lo, hi, weight, mean, variance in zip(edges[:-1], edges[1:], mass, means, cells):
        if weight > 1e-12:
            theta = chain.x + mean
            density = phi(theta / np.sqrt(prior)) / np.sqrt(prior) * between(lo - theta, hi - theta) / weight
            total = total + weight * exact_course(a, gamma, variance, 3, density, chain)
    return total


@RECIPES.of("dymbo-fig5/informed_mse")
def informed(row):
    a, gamma, (n,) = plant(row)
    return informed_course(a, gamma)[int(n)]


# Propositions

@RECIPES.of("dymbo-prop1b/distance")
def distance(row):
    """Proposition 1(b) (erratum dymbo-11): the posterior of one bit is skew-normal; greatest distance from the normal of its moments."""
    sigma = float(row)
    mean, variance = np.sqrt(ONE_BIT / (1 + sigma**2)), 1 - ONE_BIT / (1 + sigma**2)
    gap = lambda t: np.abs(2 * phi(t) * ndtr(t / sigma) - phi((t - mean) / np.sqrt(variance)) / np.sqrt(variance))
    t = np.linspace(-6, 6, 4001)
    best = t[np.argmax(gap(t))]
    return -minimize_scalar(lambda t: -gap(t), bounds=(best - 0.01, best + 0.01), method="bounded", options={"xatol": 1e-9}).fun


@RECIPES.of("dymbo-prop2/exact_sup")
def proposition2(row):
    """Largest mean squared error of the first message: the state midway between two levels."""
    tau = float(row)
    k = np.arange(-int(60 / tau) - 2, int(60 / tau) + 3)
    return np.sum((k * tau - tau / 2) ** 2 * between((k - 1) * tau, k * tau))


@RECIPES.of("dymbo-prop2/mse")
def first_bit(row):
    return course(0.9, numbers(row)[0], 2.25 if row.startswith("printed") else FIRST)[1]


@RECIPES.of("dymbo-prop2/nees")
def cautious(row):
    step = int(row.split()[-1])
    return course(0.9, 0.5, 2.25)[step] / variances(0.9, 0.5, 2.25, 5)[step]


# Threshold of (14) as printed (erratum dymbo-1)

@lru_cache(None)
def thresholds(a, gamma, chains=4000, steps=1200):
    """Mean squared errors of three filters on common noise: threshold at the prediction; (14); (14) with the exact update."""
    rng = np.random.default_rng(14)
    theta = rng.normal(0, np.sqrt(gamma / (1 - a * a)), chains)
    means, variance = np.zeros((3, chains)), np.full((3, chains), gamma / (1 - a * a))
    total = np.zeros((3, chains))
    for step in range(steps):
        theta = a * theta + rng.normal(0, np.sqrt(gamma), chains)
        x = theta + rng.normal(0, 1, chains)
        threshold = np.array([a, 1, 1])[:, None] * means
        m, p = a * means, a * a * variance + gamma
        bit = np.where(x >= threshold, 1.0, -1.0)
        s = np.sqrt(p + 1)
        zeta = bit * (m - threshold) / s
        zeta[:2] = 0  # the printed update takes the threshold for the prediction
        lam = np.exp(-0.5 * zeta**2) / np.sqrt(2 * np.pi) / np.maximum(ndtr(zeta), 1e-300)
        means, variance = m + bit * p / s * lam, p - p * p / (p + 1) * lam * (lam + zeta)
        if step >= 100:
            total += (means - theta) ** 2
    return total / (steps - 100)


RULES = {"prediction": 0, "eq14": 1, "eq14_exact": 2}


@RECIPES.of("dymbo-threshold/mse")
def threshold_mse(row):
    a, gamma, _ = plant(row)
    rule = row.split()[-1]
    return exact(a, gamma) if rule == "prediction" else mean_and_error(thresholds(a, gamma)[RULES[rule]])


@RECIPES.of("dymbo-threshold/excess")
def threshold_excess(row):
    a, gamma, _ = plant(row)
    runs = thresholds(a, gamma)
    mean, error = mean_and_error(runs[RULES[row.split()[-1]]] - runs[0])
    return mean / exact(a, gamma), error / exact(a, gamma)


RECIPES.of("dymbo-escape/riccati")(lambda row: steady(*numbers(row)))
RECIPES.of("dymbo-threshold/nees")(lambda row: exact(*numbers(row)[:2]) / steady(*numbers(row)[:2]))


@RECIPES.of("dymbo-escape/escaped")
def escaped(row):
    """Share of the runs of an unstable plant whose error passes 50 within 500 steps, after a first message of tau = 1."""
    a, gamma, _ = plant(row)
    rng = np.random.default_rng(12)
    state, m, runs = np.zeros(200_000), FIRST, 200_000
    error = -(np.round(rng.normal(0, 1, runs) + (offset := rng.uniform(-0.5, 0.5, runs))) - offset)
    gone = np.zeros(runs, bool)
    for _ in range(500):
        p = predicted(a, gamma, m)
        error = a * error + rng.normal(0, np.sqrt(gamma), runs)
        error -= gain(p) * np.where(error + rng.normal(0, 1, runs) >= 0, 1, -1)
        gone |= np.abs(error) > 50
        error[gone] = 1e6
        m = filtered(p, ONE_BIT)
    return mean_and_error(gone)
