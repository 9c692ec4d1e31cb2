"""Two targets on a line whose measurements come in random order (section 3.5): which is whose. All tracks are followed together.
The rule that each pair of particles weighs by itself (`pf-tanh`) is not recomputed: its definition is not in the thesis.
"""

from functools import lru_cache

import numpy as np

from common import mean_and_error
from mpa import RECIPES

WALK, START, STEPS, TRACKS = 1e-4, 1e-6, 100, 1500


def likelihood(z, mean, variance):
    return -0.5 * (z - mean) ** 2 / variance - 0.5 * np.log(2 * np.pi * variance)


def sigmoid(x):
    return 0.5 * (1 + np.tanh(x / 2))


@lru_cache(None)
def scores(method, r, apart):
    """[track, (labelled error, unlabelled error, association error)], means over the steps."""
    rng = np.random.default_rng(5)
    start = np.array([1.0, 1.0 + apart])
    truth = start + np.sqrt(START) * rng.normal(size=(TRACKS, 2))
    mean, var = np.tile(start, (TRACKS, 1)), np.full((TRACKS, 2), START)
    histories, weights = mean[:, None, :].copy(), np.zeros((TRACKS, 1))
    cloud = start + np.sqrt(START) * rng.normal(size=(TRACKS if method == "pf-exact" else 1, 300, 2))
    total = np.zeros((TRACKS, 3))
    for _ in range(STEPS):
        truth = truth + np.sqrt(WALK) * rng.normal(size=truth.shape)
        z = truth + np.sqrt(r) * rng.normal(size=truth.shape)
        swapped = rng.random(TRACKS) < 0.5
        za, zb = np.where(swapped, z[:, 1], z[:, 0]), np.where(swapped, z[:, 0], z[:, 1])
        both = np.stack((za, zb), 1)
        var = var + WALK
        s = var + r
        if method == "mht":  # covariances do not depend on the labels
            p, gain = var[0, 0], var[0, 0] / s[0, 0]
            direct = likelihood(both[:, None], histories, p + r).sum(2)
            other = likelihood(both[:, None, ::-1], histories, p + r).sum(2)
            new = np.concatenate((histories + gain * (both[:, None] - histories), histories + gain * (both[:, None, ::-1] - histories)), 1)
            logs = np.concatenate((weights + direct, weights + other), 1)
            w = np.exp(logs - logs.max(1, keepdims=True))
            half = w.shape[1] // 2
            p0 = w[:, :half].sum(1) / w.sum(1)
            keep = np.argsort(-w, axis=1)[:, :16]
            histories = np.take_along_axis(new, keep[:, :, None], 1)
            w = np.take_along_axis(w, keep, 1)
            weights = np.log(np.maximum(w / w.sum(1, keepdims=True), 1e-300))
            mean = (w[:, :, None] * histories).sum(1) / w.sum(1, keepdims=True)
            var = var * (1 - gain)
        elif method == "pf-exact":  # each target's particles take the mixture of both orders by their evidence
            cloud = cloud + np.sqrt(WALK) * rng.normal(size=cloud.shape)
            l = np.exp(-0.5 * (cloud[:, :, :, None] - both[:, None, None, :]) ** 2 / r)  # [track, particle, target, measurement]
            e = np.maximum(l.mean(1), 1e-300)
            p0 = e[:, 0, 0] * e[:, 1, 1] / (e[:, 0, 0] * e[:, 1, 1] + e[:, 0, 1] * e[:, 1, 0])
            own = np.stack((p0, 1 - p0), 1)
            w = np.stack((l[:, :, 0] / e[:, None, 0] @ own[:, :, None], l[:, :, 1] / e[:, None, 1] @ own[:, ::-1, None]), 2)[..., 0]
            w /= w.sum(1, keepdims=True)
            mean = (w * cloud).sum(1)
            u = (np.arange(300) + rng.random((TRACKS, 1))) / 300
            for t in (0, 1):
                index = [np.minimum(np.searchsorted(c, q), 299) for c, q in zip(np.cumsum(w[:, :, t], 1), u)]
                picked = np.take_along_axis(cloud[:, :, t], np.array(index), 1)
                cloud[:, :, t] = rng.permuted(picked, axis=1)
        else:
            if method == "genie":
                p0 = 1.0 - swapped
            elif method in ("jpda", "gnn"):
                gap = likelihood(both, mean, s).sum(1) - likelihood(both[:, ::-1], mean, s).sum(1)
                p0 = sigmoid(gap) if method == "jpda" else (gap > 0) * 1.0
            else:
                d = np.abs(mean[:, 0] - zb) * np.abs(mean[:, 1] - za) / np.maximum(np.abs(mean[:, 0] - za) * np.abs(mean[:, 1] - zb), 1e-300)
                p0 = np.tanh(0.55 * d) if method == "tanh" else d / (1 + d)
            chance = np.stack((p0, 1 - p0), 1)  # that target 1 made za, and zb; target 2 the other way round
            gain = var / s
            options = mean[:, :, None] + gain[:, :, None] * (both[:, None, :] - mean[:, :, None])
            share = np.stack((chance, chance[:, ::-1]), 1)
            mean = (share * options).sum(2)
            var = var * (1 - gain) + (share * (options - mean[:, :, None]) ** 2).sum(2)
        labelled = ((mean - truth) ** 2).sum(1)
        total[:, 0] += labelled
        total[:, 1] += np.minimum(labelled, ((mean[:, ::-1] - truth) ** 2).sum(1))
        total[:, 2] += np.abs(p0 - (1 - swapped))
    return total / STEPS


for place, quantity in enumerate(("labelled", "unlabelled", "association")):
    def recipe(row, place=place):
        r, apart, method = row.split("-", 2)
        return mean_and_error(scores(method, float(r[1:]), float(apart[3:]))[:, place])

    RECIPES.of(f"mpa-table3-da/{quantity}", "-(genie|mht|jpda|pf-exact|logistic|(?<!pf-)tanh|gnn)$")(recipe)
