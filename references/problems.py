"""Twelve problems with curved models and two bits a report: a bootstrap particle filter of 20000 particles for each.

The equations are those of `docs/problems.md`. The report is one of four cells about the receiver's own prediction `h(mean)`, with edges 1.5
deviations of the measurement noise apart. The value is the root mean squared error of the scored coordinates over 40 steps and RUNS runs.
"""

import numpy as np
from scipy.special import ndtr

from common import Recipes

RECIPES = Recipes()
STEPS, RUNS, COUNT, WIDTH = 40, 60, 20000, 1.5


def straight(x, k):
    return np.array([x[0] + x[1], x[1], x[2] + x[3], x[3]])


def turning(x, k):
    w = x[4]
    safe = np.where(np.abs(w) < 1e-6, 1e-6, w)
    along, across = np.sin(safe) / safe, (1 - np.cos(safe)) / safe
    s, c = np.sin(w), np.cos(w)
    return np.array(
        [x[0] + x[1] * along - x[3] * across, x[1] * c - x[3] * s, x[2] + x[1] * across + x[3] * along, x[1] * s + x[3] * c, w]
    )


def flow(rate, seconds):
    """Runge-Kutta of order four, two steps."""

    def step(x, k):
        h = seconds / 2
        for _ in range(2):
            a = rate(x)
            b = rate(x + 0.5 * h * a)
            c = rate(x + 0.5 * h * b)
            d = rate(x + h * c)
            x = x + h / 6 * (a + 2 * b + 2 * c + d)
        return x

    return step


def growth(x, k):
    return np.array([x[0] / 2 + 25 * x[0] / (1 + x[0] ** 2) + 8 * np.cos(1.2 * k)])


def bearing(x, at):
    return np.arctan2(x[0] - at[0], x[2] - at[1])


def distance(x, at):
    return np.hypot(x[0] - at[0], x[2] - at[1])


LEFT, RIGHT, ABOVE = (0, 0), (20, 0), (10, 30)
ANGLE, METRES = 0.03, 0.5


def bearings(*places):
    return lambda k: [((lambda x, at=at: bearing(x, at)), ANGLE) for at in places]


def observer(k):
    at = (0.5 * min(k, 20), 0.25 * max(k - 20, 0))
    return [((lambda x: bearing(x, at)), ANGLE)]


def radar(k):
    return [((lambda x: distance(x, LEFT)), METRES), ((lambda x: bearing(x, LEFT)), ANGLE)]


def ranges(k):
    return [((lambda x, at=at: distance(x, at)), METRES) for at in (LEFT, RIGHT, ABOVE)]


def one(h, deviation):
    return lambda k: [(h, deviation)]


STRAIGHT = (straight, [8, -0.1, 15, -0.1], [2, 0.2, 2, 0.2], [1e-4, 1e-3, 1e-4, 1e-3], [0, 2])
TURNING = (turning, [8, 0.3, 15, -0.2, 0.1], [2, 0.2, 2, 0.2, 0.1], [1e-4, 1e-3, 1e-4, 1e-3, 1e-4], [0, 2])
PROBLEMS = {
    "moving observer": (STRAIGHT, observer),
    "two bearings": (STRAIGHT, bearings(LEFT, RIGHT)),
    "range and bearing": (STRAIGHT, radar),
    "turn, two bearings": (TURNING, bearings(LEFT, RIGHT)),
    "turn, range and bearing": (TURNING, radar),
    "turn, three ranges": (TURNING, ranges),
    "pendulum": (
        (flow(lambda x: np.array([x[1], -9.81 * np.sin(x[0]) - 0.1 * x[1]]), 0.1), [0.8, 0], [0.3, 0.3], [1e-5, 1e-2], [0]),
        one(lambda x: np.sin(x[0]), 0.1),
    ),
    "two wells": (
        (flow(lambda x: np.array([x[1], x[0] - x[0] ** 3 - 0.3 * x[1]]), 0.2), [0, 0], [0.7, 0.3], [1e-4, 1e-2], [0]),
        one(lambda x: x[0], 0.2),
    ),
    "limit cycle": (
        (flow(lambda x: np.array([x[1], (1 - x[0] ** 2) * x[1] - x[0]]), 0.2), [1, 0], [1, 1], [1e-4, 1e-2], [0]),
        one(lambda x: x[0], 0.3),
    ),
    "Lorenz": (
        (
            flow(lambda x: np.array([10 * (x[1] - x[0]), x[0] * (28 - x[2]) - x[1], x[0] * x[1] - 8 / 3 * x[2]]), 0.05),
            [3, 5, 20],
            [2, 2, 2],
            [0.1, 0.1, 0.1],
            [0, 1, 2],
        ),
        one(lambda x: x[0], 1.0),
    ),
    "re-entry": (
        (
            flow(lambda x: np.array([-x[1], 0.0098 - 0.5 * np.exp(x[2] - x[0] / 6.1) * x[1] ** 2, 0 * x[0]]), 0.3),
            [60, 6, 0],
            [1, 0.2, 0.3],
            [1e-4, 1e-4, 1e-5],
            [0],
        ),
        one(lambda x: np.hypot(x[0], 30.0), 0.1),
    ),
    "growth": ((growth, [0], [2], [10.0], [0]), one(lambda x: x[0] ** 2 / 20, 1.0)),
}


def run(name, rng):
    """Mean squared error of one run."""
    (move, mean, deviations, variances, scored), sensors = PROBLEMS[name]
    mean, deviations = np.array(mean, float), np.array(deviations, float)
    roots = np.sqrt(np.array(variances))[:, None]
    truth = (mean + deviations * rng.standard_normal(len(mean)))[:, None]
    cloud = mean[:, None] + deviations[:, None] * rng.standard_normal((len(mean), COUNT))
    total = 0.0
    for k in range(STEPS):
        truth = move(truth, k) + roots * rng.standard_normal(truth.shape)
        cloud = move(cloud, k) + roots * rng.standard_normal(cloud.shape)
        # The question is about the mean of the prediction.
        centre = cloud.mean(axis=1)[:, None]
        weights = np.ones(COUNT)
        for h, deviation in sensors(k):
            z = h(truth)[0] + deviation * rng.standard_normal()
            about, width = h(centre)[0], WIDTH * deviation
            edges = np.array([-np.inf, about - width, about, about + width, np.inf])
            index = np.searchsorted(edges[1:-1], z, side="right")
            values = h(cloud)
            weights = weights * (ndtr((edges[index + 1] - values) / deviation) - ndtr((edges[index] - values) / deviation))
        if weights.sum() <= 0 or not np.isfinite(weights.sum()):
            weights = np.ones(COUNT)
        weights = weights / weights.sum()
        estimate = cloud @ weights
        total += sum((estimate[d] - truth[d, 0]) ** 2 for d in scored)
        places = (np.arange(COUNT) + rng.random()) / COUNT
        cloud = cloud[:, np.minimum(np.searchsorted(np.cumsum(weights), places), COUNT - 1)]
    return total / STEPS


@RECIPES.of("problems-filters/particles")
def particles(row):
    rng = np.random.default_rng([2026, *row.encode()])
    squares = np.array([run(row, rng) for _ in range(RUNS)])
    root = np.sqrt(squares.mean())
    return root, squares.std(ddof=1) / np.sqrt(RUNS) / (2 * root)
