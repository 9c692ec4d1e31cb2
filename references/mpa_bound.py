"""Posterior Cramer-Rao bound of tracking from quantized ranges, averaged over free trajectories (docs/pf-mpa.md)."""

import numpy as np
from scipy.special import ndtr

from common import phi
from mpa import RECIPES
from mpa_tracking import COV, F, G, MEAN, STEPS, TRIALS, errors, median, positions, setting, tracks


def recursion(s, information):
    """Mean over the steps of the position bound; J_k = (F J^-1 F' + 0.02 G G')^-1 + sum E[I u u']. The accelerations are taken as known.
    The standard error leaves out one of twenty groups of tracks at a time: the mean of I has heavy tails, or none exists (mpa-17)."""
    truth, _ = tracks(False)
    told = []
    for k in range(STEPS):
        r, unit = s.geometry(truth[:, k, :2])
        told.append(np.einsum("ts,tsi,tsj->tij", information(k, r), unit, unit))
    told = np.array(told)

    def bound(kept):
        cov, total = COV.copy(), 0.0
        for k in range(STEPS):
            cov = np.linalg.inv(F @ cov @ F.T + 0.02 * G @ G.T)
            cov[:2, :2] += told[k, kept].mean(0)
            cov = np.linalg.inv(cov)
            total += np.trace(cov[:2, :2]) / STEPS
        return total

    group = np.arange(TRIALS) % 20
    others = np.array([bound(group != g) for g in range(20)])
    return bound(group >= 0), np.sqrt(19 * others.var())


RECIPES.of("mpa-crlb/unquantized")(lambda row: recursion(s := setting(row), lambda k, r: (s.c**2 + 2) / r**2))


@RECIPES.of("mpa-crlb/quantized")
def quantized(row):
    """sum_q (dP_q / dd)^2 / P_q at the true range; the cells are those of the published encoder around the grid's estimates."""
    s = setting(row)
    estimates = positions("grid-15", s, False)

    def information(k, r):
        last = estimates[:, k - 1] if k else np.tile(MEAN[:2], (TRIALS, 1))
        reference = s.geometry(last)[0]
        width = s.speed + 0.05 + 2.5 * reference / s.c
        edges = reference[..., None] + width[..., None] * (-1 + 2 * np.arange(1, s.levels) / s.levels)
        u = s.c * (edges / r[..., None] - 1)
        ends, zero = np.full(r.shape + (1,), np.inf), np.zeros(r.shape + (1,))
        a, b = np.concatenate((-ends, u), 2), np.concatenate((u, ends), 2)
        p = np.where(a > 0, ndtr(-a) - ndtr(-b), ndtr(b) - ndtr(a))
        slope = np.concatenate((zero, -s.c * edges / r[..., None] ** 2 * phi(u), zero), 2)
        return np.where(p > 1e-290, np.diff(slope, axis=2) ** 2 / np.maximum(p, 1e-290), 0).sum(2)

    return recursion(s, information)


RECIPES.of("mpa-crlb/grid-median")(lambda row: median(errors("grid-25", setting(row), False).mean(1)))
