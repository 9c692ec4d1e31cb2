"""Quantizers by mutual information: the steps of Algorithm 7 (figures 4.2 to 4.4), folded cells, other channels, bounds."""

from functools import lru_cache

import numpy as np
from scipy.optimize import brentq

from common import numbers, phi
from mi import (LABELS, RECIPES, SIGN, Sensors, Unknown, best, ceo, greedy, lloyd, mi, mse, one_rate, random_starts, symmetric, table45,
                words)
from scipy.special import ndtr


# Algorithm 7, corrected (mi-1, mi-2): one step for one sensor in unit noise, the others fixed

def step(u, edges, others=None):
    """New breakpoints: y goes to the level z of the largest sum_k w pdf(y | x_k) sum_t P(t | x_k) ln p(t, z | x_k) / p(t, z)."""
    others = np.ones((1, len(u.x))) if others is None else others
    q = others[:, None, :] * u.cells(edges, 1.0)[None]
    scores = np.log(np.maximum(q, 1e-300)) - np.log(q @ u.w)[:, :, None]
    weight = u.w * np.einsum("tk,tzk->zk", others, scores)
    new = []
    for i, b in enumerate(edges):
        gap = lambda y: phi(y - u.x) @ (weight[i + 1] - weight[i])
        new.append(brentq(gap, b - 0.3, b + 0.3, xtol=1e-15))
    return np.array(new)


@lru_cache(None)
def iterations():
    """Figures 4.2 and 4.3: fifteen steps of sensor 1 for I(X; T1), fifteen of sensor 2 for I(X; T1, T2)."""
    u, b1, b2, kept = Unknown(), lloyd(4), lloyd(4), []
    for n in range(31):
        p1, p2 = u.cells(b1, 1.0), u.cells(b2, 1.0)
        q = u.joint([p1, p2])
        kept.append((mi(p1, u), mi(q, u), mse(q, u)))
        b1, b2 = (step(u, b1), b2) if n < 15 else (b1, step(u, b2, p1))
    return kept


RECIPES.of("mi-fig4-2/mi_x_z1_nats")(lambda row: iterations()[int(row[5:])][0])
RECIPES.of("mi-fig4-2/mi_x_z1z2_nats")(lambda row: iterations()[int(row[5:])][1])
RECIPES.of("mi-fig4-3/mse")(lambda row: iterations()[int(row[5:])][2])


@RECIPES.of("mi-fig4-4/greedy-loss")
def greedy_loss(row):
    sensors, start = Sensors(channel=words(float(row), LABELS["natural"])), [lloyd(4)] * 2
    return sensors.value("mi", greedy(sensors, start)) - sensors.value("mi", start)


@RECIPES.of("mi-beyond/alternating")
def alternating(row):
    """Steps of Algorithm 7 from Lloyd-Max until within 1e-8 of the limit."""
    u, course = Unknown(), [lloyd(int(row))]
    while len(course) < 400:
        course.append(step(u, course[-1]))
    limit = Sensors((1,)).design("mi", [course[-1]])[0]
    return int(np.argmax([np.max(np.abs(b - limit)) < 1e-8 for b in course]))


@RECIPES.of("mi-beyond/newton")
def newton(row):
    """Newton steps from Lloyd-Max until one is shorter than 1e-12."""
    s, b = Sensors((1,)), lloyd(int(row))
    gradient = lambda b: np.array([s.value("mi", [b + 1e-30j * e]).imag / 1e-30 for e in np.eye(len(b))])
    for count in range(1, 40):
        hessian = np.array([(gradient(b + 1e-5 * e) - gradient(b - 1e-5 * e)) / 2e-5 for e in np.eye(len(b))])
        values, vectors = np.linalg.eigh((hessian + hessian.T) / 2)
        move = vectors @ ((vectors.T @ gradient(b)) / np.maximum(np.abs(values), 1e-7))
        b = b + move * min(1, 0.4 / np.max(np.abs(move)))
        if np.max(np.abs(move)) < 1e-12:
            return count
    return count


# Best designs known: contiguous cells from many starts; any cells by assigning the cells of a grid to levels

def case(row):
    name, criterion, cells = row.split(" ")
    levels = int(name[-1])
    if name.startswith("correlated"):
        return criterion, cells, levels, Sensors(rho=0.85), 1.0
    sigma = float(name[5:-3])
    return criterion, cells, levels, Sensors((sigma, sigma), h=0.125 if sigma == 1 else 0.2 * sigma), sigma


def folded(sensors, criterion, levels, sigma, starts, seed=2):
    """Best design of any cells: coordinate ascent over the levels of 160 grid cells, then their edges by Newton."""
    u, rng = sensors.u, np.random.default_rng(seed)
    span = 4.2 * np.sqrt(1 + sigma**2)
    grid = np.linspace(-span, span, 161)
    fine = u.cells(grid[1:-1], sigma)  # P(grid cell | centre)
    back = np.eye(len(u.x)) if u.mix is None else u.mix
    found = None
    for _ in range(starts):
        edges = np.sort(rng.integers(0, 160, (2, rng.integers(levels - 1, 2 * levels + 2))), axis=1)
        assign = [rng.permutation(levels)[np.searchsorted(e, np.arange(160), side="right") % levels] for e in edges]
        last = np.inf
        for _ in range(60):
            for n in (0, 1):
                p = [np.array([fine[a == z].sum(0) for z in range(levels)]) for a in assign]
                other = p[1 - n]
                both = (other[:, None] * p[n]) @ back  # [t, z, x]
                total = np.maximum(both @ u.w, 1e-300)
                if criterion == "mi":
                    score = np.log(np.maximum(both, 1e-300)) - np.log(total)[:, :, None]
                else:
                    hat = ((both @ (u.w * u.x)) / total)[:, :, None]
                    score = 2 * u.x * hat - hat**2
                weight = np.einsum("tc,tzx,cx->zc", other, score * u.w, back, optimize=True)
                assign[n] = np.argmax(weight @ fine.T, axis=0)
            value = SIGN[criterion] * (mi if criterion == "mi" else mse)(both.reshape(-1, len(u.x)), u)
            if last - value < 1e-9:
                break
            last = value
        if any(len(np.unique(a)) < levels for a in assign):
            continue
        if found is None or value < found[0]:
            found = (value, [a.copy() for a in assign])
    value, assign = found
    cuts = [np.flatnonzero(np.diff(a)) for a in assign]
    sensors.labels = [tuple(a[np.append(c, 159)]) for a, c in zip(assign, cuts)]
    edges = sensors.design(criterion, [grid[c + 1] for c in cuts])
    return sensors.value(criterion, edges)


@lru_cache(None)
def known_best(row):
    criterion, cells, levels, sensors, sigma = case(row)
    starts = random_starts(levels, 14, 2.0 if sigma == 1 else 1.5)
    contiguous = sensors.value(criterion, best(sensors, criterion, starts))
    if cells == "contiguous":
        return contiguous
    other = folded(sensors, criterion, levels, sigma, 24)
    return max(contiguous, other) if criterion == "mi" else min(contiguous, other)


RECIPES.of("mi-beyond/value")(known_best)


@RECIPES.of("mi-beyond/symmetry")
def symmetry(row):
    """Where two sign quantizers at zero stop being a local optimum: the curvature along (1, -1) changes sign."""
    varied, criterion = row.split(" ")
    delta = 2e-5

    def slope(value):
        s = Sensors((value, value), h=0.0625) if varied == "noise_sd" else Sensors(rho=value, h=0.0625)
        d = delta + 1e-30j
        return s.value(criterion, [np.array([d]), np.array([-d])]).imag

    return brentq(slope, *((0.4, 0.9) if varied == "noise_sd" else (0.2, 0.7)), xtol=1e-11)


# Other channels

def four_pam(snr):
    """Levels -3, -1, 1, 3 in noise, decided at -2, 0, 2."""
    s = np.sqrt(5 / 10 ** (snr / 10))
    sent, cuts = np.array([-3, -1, 1, 3]), np.array([-np.inf, -2, 0, 2, np.inf])
    return ndtr((cuts[1:, None] - sent) / s) - ndtr((cuts[:-1, None] - sent) / s)


@lru_cache(None)
def other_channel(row):
    erased = np.vstack((0.9 * np.eye(4), np.full((1, 4), 0.1)))
    sensors = Sensors(channel=erased if row.startswith("erasure") else four_pam(10))
    return sensors, sensors.design("mi", [symmetric([1.2])] * 2)


RECIPES.of("mi-beyond/outer")(lambda row: other_channel(row)[1][0][-1])
RECIPES.of("mi-beyond/mse")(lambda row: other_channel(row)[0].value("mse", other_channel(row)[1]))


@RECIPES.of("mi-beyond/three-words")
def three_words(row):
    """Three levels that use the words 00, 01, 11."""
    sensors = Sensors(channel=words(float(row), (0, 1, 3)))
    starts = [[np.array([-a, b]), np.array([-c, d])] for a, b, c, d in ((0.7, 0.7, 0.7, 0.7), (0.3, 1, 0.3, 1), (0.3, 1, 1, 0.3))]
    return sensors.value("mse", best(sensors, "mse", starts))


@RECIPES.of("mi-beyond/bound")
def bound(row):
    sensors, levels, eps = numbers(row)
    if eps == 0:
        return one_rate(int(sensors), np.log(levels))
    capacity = 1 + eps * np.log2(eps) + (1 - eps) * np.log2(1 - eps)
    return one_rate(int(sensors), np.log(2) * np.log2(levels) * capacity)
