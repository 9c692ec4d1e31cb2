"""A particle filter whose belief is handed on as a Gaussian mixture: Ihler, Fisher and Willsky, "Particle filtering under
communications constraints". Equation numbers are the paper's; errata `handoff-1` ... are those of docs/errata.md.
"""

from functools import lru_cache

import numpy as np

from common import Recipes, between, mean_and_error

RECIPES = Recipes()


# Figure 2: widths that shrink by a ratio each step

@RECIPES.of("handoff-fig2/kl-total")
def kl_total(row):
    """KL[N(0, 1), N(0, ratio^(2t))], forward as the paper means it (handoff-1)."""
    ratio, t = (float(w[1:]) for w in row.split("-"))
    b = ratio**t
    return np.log(b) + 1 / (2 * b * b) - 0.5


@RECIPES.of("handoff-fig2/kl-total-reverse")
def kl_reverse(row):
    ratio, t = (float(w[1:]) for w in row.split("-"))
    b = ratio**t
    return -np.log(b) + b * b / 2 - 0.5


# Figure 3: two lobes, the small one misplaced; y tells whether x > 0.5

LOBES = ((0.9, 0.25, 0.05), (0.1, 0.65, 0.025)), ((0.9, 0.25, 0.05), (0.1, 0.85, 0.025))


def two_lobes():
    x = np.concatenate((np.linspace(-0.5, 0.5, 200001), np.linspace(0.5, 1.5, 200001)))
    w = np.full(len(x), 1 / 200000)
    w[[0, 200000, 200001, -1]] /= 2
    p, q = (sum(m * np.exp(-0.5 * ((x - c) / s) ** 2) / s / np.sqrt(2 * np.pi) for m, c, s in lobes) for lobes in LOBES)
    return x, w, p, q


def mass(lobes, low, high):
    return sum(m * float(between((low - c) / s, (high - c) / s)) for m, c, s in lobes)


@RECIPES.of("handoff-fig3/l1")
def fig3(row):
    x, w, p, q = two_lobes()
    if row == "prior":
        return w @ np.abs(p - q)
    chance = {y: [mass(l, *ends) for l in LOBES] for y, ends in (("y0", (-np.inf, 0.5)), ("y1", (0.5, np.inf)))}
    half = {"y0": slice(0, 200001), "y1": slice(200001, None)}
    l1 = {y: w[half[y]] @ np.abs(p[half[y]] / chance[y][0] - q[half[y]] / chance[y][1]) for y in chance}
    return sum(chance[y][0] * l1[y] for y in l1) if row == "expected" else l1[row]


RECIPES.of("handoff-fig3/probability")(lambda row: mass(LOBES[0], 0.5, np.inf))


# Figure 6(a), (b): the world, the filter, and the reduction by a KD-tree

PARTICLES, STEPS, WORLDS = 500, 10, 48


def world(rng):
    """Leader's position and measurement at each step; redrawn if no sensor qualifies."""
    while True:
        sensors = rng.uniform((-1, -4), (11, 4), (25, 2))
        x, last, steps = 0.25 * rng.normal(size=2), -1, []
        for _ in range(STEPS):
            angle = rng.uniform(-np.pi / 4, np.pi / 4)
            x = x + np.array([np.cos(angle), np.sin(angle)]) + rng.uniform(0, 0.1, 2)
            d = np.linalg.norm(sensors - x, axis=1)
            free = np.where((d >= 0.7) & (np.arange(25) != last), d, np.inf)
            last = int(np.argmin(free))
            if np.isinf(free[last]):
                break
            steps.append((sensors[last], 1 / (d[last] + 0.05) + np.sqrt(0.05) * rng.normal()))
        if len(steps) == STEPS:
            return steps


def propagate(rng, x):
    angle = rng.uniform(-np.pi / 4, np.pi / 4, len(x))
    return x + np.stack((np.cos(angle), np.sin(angle)), 1) + rng.uniform(0, 0.1, x.shape)


def weigh(x, sensor, y, trim):
    """Weights; those below trim/N are dropped."""
    logs = -((y - 1 / (np.linalg.norm(x - sensor, axis=1) + 0.05)) ** 2) / (2 * 0.05)
    w = np.exp(logs - logs.max())
    w /= w.sum()
    keep = w >= trim / len(x)
    return x[keep], w[keep] / w[keep].sum()


def widths(x, w, factor, effective):
    """Silverman's rule: kernel deviations of each axis."""
    mean = w @ x
    n = 1 / np.sum(w**2) if effective else PARTICLES
    return factor * n ** (-1 / 6) * np.sqrt(w @ (x - mean) ** 2)


class Node:
    """A block of kernels, and the Gaussian of its moments: coordinates in kernel deviations h, so that every kernel is N(., I)."""

    def __init__(self, index, x, w, h, kernels, criterion):
        self.index, self.weight = index, w[index].sum()
        v, c = w[index] / self.weight, x[index]
        self.mean = v @ c
        d = c - self.mean
        centres = (v[:, None] * d).T @ d
        self.cov = centres + np.eye(2)
        self.axis = int(np.argmax(np.diag(centres) * h**2))  # the wider one, in metres
        f = np.log(kernels[np.ix_(index, index)] @ v) - self.log(c) if len(index) > 1 else np.zeros(1)
        self.error = {
            "ml": np.max(np.abs(f)),
            "kl": self.weight * max(v @ f, 0.0),
            "l1": self.weight * (v @ np.abs(1 - np.exp(-f))),
        }[criterion]

    def log(self, points):
        """ln of the Gaussian, kernels without their normalisation 1/(2 pi) too."""
        d = points - self.mean
        return -0.5 * np.einsum("ni,ij,nj->n", d, np.linalg.inv(self.cov), d) - 0.5 * np.log(np.linalg.det(self.cov))


def reduce(x, w, h, most, criterion):
    """Algorithm 1, corrected (handoff-6, -7, -8): the greedy cut of at most `most` nodes with the least bound."""
    kernels = np.exp(-0.5 * ((x[:, None] - x) ** 2).sum(2))
    make = lambda index: Node(index, x, w, h, kernels, criterion)
    bound = (lambda cut: max(n.error for n in cut)) if criterion == "ml" else (lambda cut: sum(n.error for n in cut))
    cut = [make(np.arange(len(x)))]
    best, least = list(cut), bound(cut)
    while len(cut) < most:
        worst = max(range(len(cut)), key=lambda i: cut[i].error)
        node = cut[worst]
        if len(node.index) == 1:
            break
        order = node.index[np.argsort(x[node.index, node.axis], kind="stable")]
        half = (len(order) + 1) // 2
        cut[worst : worst + 1] = [make(np.sort(order[:half])), make(np.sort(order[half:]))]
        if bound(cut) < least:
            best, least = list(cut), bound(cut)
    p = np.log(kernels @ w)
    q = np.log(sum(n.weight * np.exp(n.log(x)) for n in best))
    f = p - q
    return best, (np.max(np.abs(f)), (f.max() - f.min()) / 2, w @ f, w @ np.abs(1 - np.exp(-f)), len(best))


def draw(rng, mixture, scale):
    """Systematic choice of the component, one draw each."""
    edges = np.cumsum([n.weight for n in mixture])
    which = np.searchsorted(edges / edges[-1], (np.arange(PARTICLES) + rng.random()) / PARTICLES)
    roots = np.array([np.linalg.cholesky(n.cov) for n in mixture])
    means = np.array([n.mean for n in mixture])
    return (means[which] + np.einsum("nij,nj->ni", roots[which], rng.normal(size=(PARTICLES, 2)))) * scale


KERNELS = {"silverman": (1.0, False, 0.01), "preset": (1.5, True, 0.5)}


@lru_cache(None)
def handovers(kernel, most, criterion):
    """[world, step, (ml, dr, kl, l1, size)] at the centres, of a filter that is handed over at every step."""
    factor, effective, trim = KERNELS[kernel]
    result = []
    for trial in range(WORLDS):
        steps, rng = world(np.random.default_rng(600 + trial)), np.random.default_rng([trial, most, len(criterion)])
        x, errors = 0.25 * rng.normal(size=(PARTICLES, 2)), []
        for sensor, y in steps:
            x, w = weigh(propagate(rng, x), sensor, y, trim)
            h = np.maximum(widths(x, w, factor, effective), 1e-6)
            mixture, e = reduce(x / h, w, h, most, criterion)
            errors.append(e)
            x = draw(rng, mixture, h)
        result.append(errors)
    return np.array(result)


PLACES = {"ml": 0, "dr": 1, "kl": 2, "l1": 3, "size": 4}


def jackknife(runs, f):
    """f of the means over worlds, and its standard error by leaving out one world at a time."""
    n, total = len(runs), runs.sum(0)
    others = np.array([f((total - r) / (n - 1)) for r in runs])
    return f(total / n), np.sqrt((n - 1) * others.var())


def phi_bound(h):
    """Largest KL of densities whose log ratio spans h."""
    return h - np.log(h) - 1 + np.log1p(-np.exp(-h)) + h * np.exp(-h) / (1 - np.exp(-h))


def register(figure, most):
    def split(row):
        kernel, last = row.split("-")
        return kernel, last

    def mean_error(quantity):
        def recipe(row):
            kernel, criterion = split(row)
            return mean_and_error(handovers(kernel, most, criterion)[:, :, PLACES[quantity]].mean(1))
        return recipe

    for quantity in PLACES:
        RECIPES.of(f"{figure}/{quantity}")(mean_error(quantity))

    def ml_bound(row):
        kernel, t = split(row)
        return mean_and_error(2 * handovers(kernel, most, "ml")[:, : int(t[1:]), 0].sum(1))

    def printed(criterion, factor):
        """Sum over i of factor exp(A_i) e_i, A_i twice the sum of the ML errors before, all averaged over worlds (handoff-4)."""
        def recipe(row):
            kernel, t = split(row)
            runs = handovers(kernel, most, criterion)[:, : int(t[1:])]

            def log10(mean):
                before = np.concatenate(([0], np.cumsum(2 * mean[:-1, 0])))
                return np.log10(np.sum(factor * np.exp(before) * mean[:, PLACES[criterion]]))

            return jackknife(runs, log10)
        return recipe

    def from_dr(f):
        def recipe(row):
            kernel, t = split(row)
            return mean_and_error(f(handovers(kernel, most, "ml")[:, : int(t[1:]), 1].sum(1)))
        return recipe

    RECIPES.of(f"{figure}/ml_printed")(ml_bound)
    RECIPES.of(f"{figure}/log10_kl_printed")(printed("kl", 1))
    RECIPES.of(f"{figure}/log10_l1_printed")(printed("l1", 2))
    RECIPES.of(f"{figure}/l1-from-dr")(from_dr(lambda total: 2 * np.tanh(total / 2)))
    RECIPES.of(f"{figure}/kl-from-dr")(from_dr(lambda total: phi_bound(2 * total)))


register("handoff-fig6a", 5)
register("handoff-fig6b", 10)


# Lengths of messages that are not coded: 6M - 1 numbers of 32 bits of a mixture, two of each particle

RECIPES.of("handoff-rate/bits", "^f32-")(lambda row: 32 * (6 * int(row[4:]) - 1))
RECIPES.of("handoff-rate/bits", "^particles-")(lambda row: 64 * int(row[10:]))
