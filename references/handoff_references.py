"""Figure 6(c): what a hand-over costs against reference filters that hand nothing over. KL[A, X] - KL[A, B] = E_A[ln p_B - ln p_X]: A and
B are bootstrap filters of 2000 particles, X is what a filter of 500 sends (five components, or one Gaussian) or has before it sends.
"""

from functools import lru_cache

import numpy as np

from common import mean_and_error
from handoff import KERNELS, PARTICLES, RECIPES, draw, propagate, reduce, weigh, widths, world

WORLDS, LARGE, TIMES = 80, 2000, (1, 5, 10)


def reference(rng, steps):
    """(particles, weights, kernel deviations) after each step."""
    x, result = 0.25 * rng.normal(size=(LARGE, 2)), []
    for sensor, y in steps:
        x, w = weigh(propagate(rng, x), sensor, y, 0.0)
        mean = w @ x
        h = LARGE ** (-1 / 6) * np.sqrt(w @ (x - mean) ** 2)
        result.append((x, w, h))
        pick = np.searchsorted(np.cumsum(w), (np.arange(LARGE) + rng.random()) / LARGE)
        x = x[np.minimum(pick, LARGE - 1)]
    return result


def log_kernels(points, x, w, h):
    d2 = (((points[:, None] - x) / h) ** 2).sum(2)
    low = d2.min(1)
    return np.log(np.exp(-0.5 * (d2 - low[:, None])) @ w) - 0.5 * low - np.log(2 * np.pi * h.prod())


def log_mixture(points, mixture, h):
    logs = np.array([np.log(n.weight) + n.log(points / h) for n in mixture])
    top = logs.max(0)
    return top + np.log(np.exp(logs - top).sum(0)) - np.log(2 * np.pi * h.prod())


@lru_cache(None)
def pair(trial):
    """A world and its two reference filters at the times asked for."""
    steps = world(np.random.default_rng(900 + trial))
    return steps, *(reference(np.random.default_rng([trial, which]), steps) for which in (1, 2))


@lru_cache(None)
def increases(criterion, most):
    """[world, time, (after, before)] the hand-over, at TIMES."""
    result = []
    for trial in range(WORLDS):
        steps, a, b = pair(trial)
        rng = np.random.default_rng([trial, 3])
        x, row = 0.25 * rng.normal(size=(PARTICLES, 2)), []
        for t, ((sensor, y), (xa, wa, _), other) in enumerate(zip(steps, a, b), 1):
            x, w = weigh(propagate(rng, x), sensor, y, KERNELS["silverman"][2])
            h = np.maximum(widths(x, w, 1.0, False), 1e-6)
            mixture, _ = reduce(x / h, w, h, most, criterion)
            known, x = x, draw(rng, mixture, h)
            if t not in TIMES:
                continue
            pick = np.searchsorted(np.cumsum(wa), (np.arange(250) + rng.random()) / 250)
            points = xa[np.minimum(pick, LARGE - 1)]
            against = log_kernels(points, *other)
            row.append((np.mean(against - log_mixture(points, mixture, h)), np.mean(against - log_kernels(points, known, w, h))))
        result.append(row)
    return np.array(result)


def of(name):
    return increases("kl", 1) if name == "gauss" else increases(name, 5)


@RECIPES.of("handoff-fig6c/kl_increase", "^(ml|kl|l1|gauss)-")
def after(row):
    name, t = row.split("-t")
    return mean_and_error(of(name)[:, TIMES.index(int(t)), 0])


@RECIPES.of("handoff-fig6c/before_reduction", "^(ml|kl|l1)-")
def before(row):
    name, t = row.split("-t")
    return mean_and_error(of(name)[:, TIMES.index(int(t)), 1])


@RECIPES.of("handoff-fig6c/kl")
def difference(row):
    one, other, t = row.split("-")
    return mean_and_error(of(one)[:, TIMES.index(int(t[1:])), 0] - of(other)[:, TIMES.index(int(t[1:])), 0])
