"""CFwMD's nonlinear example: nine sensors of received power on a grid, bootstrap filters. With fewer trials and particles than the
committed values have (160 of 3000 against 1000 of 10^4): the standard errors say what that leaves.
"""

from functools import lru_cache

import numpy as np

from cfwmd import RECIPES, budget, resample, three
from common import log_between
from scipy.special import ndtri

STEP, POWER = 0.5, 1000.0
SENSORS = np.array([(x, y) for x in (-10.0, 0.0, 10.0) for y in (-10.0, 0.0, 10.0)])
F = np.kron(np.eye(2), np.array([[1, STEP], [0, 1]]))  # state x, vx, y, vy
G = np.kron(np.eye(2), np.array([[STEP**2 / 2], [STEP]]))
Q = 0.1 * G @ G.T
MEAN, COV = np.array([-8.0, 2.0, -8.0, 2.0]), np.diag([9.0, 4.0, 9.0, 4.0])


def power(x):
    """sqrt(P0 / (1 + d^2)) at every sensor."""
    d2 = (x[..., 0, None] - SENSORS[:, 0]) ** 2 + (x[..., 2, None] - SENSORS[:, 1]) ** 2
    return np.sqrt(POWER / (1 + d2))


def gradient(x):
    """[trial, sensor, 4]."""
    dx, dy = x[:, 0, None] - SENSORS[:, 0], x[:, 2, None] - SENSORS[:, 1]
    c = -np.sqrt(POWER) * (1 + dx**2 + dy**2) ** -1.5
    return np.stack((c * dx, 0 * dx, c * dy, 0 * dx), axis=-1)


@lru_cache(None)
def field(scheme, messages, trials=160, particles=3000, batch=40):
    rng = np.random.default_rng(9)
    parts = [one_batch(rng, scheme, messages, batch, particles) for _ in range(trials // batch)]
    return {name: np.concatenate([p[name] for p in parts]) for name in parts[0]}


def one_batch(rng, scheme, messages, trials, particles):
    x, eta = np.tile(MEAN, (trials, 1)), ndtri(1 - messages / 18) ** 2
    cloud = MEAN + rng.normal(size=(trials, particles, 4)) * np.sqrt(np.diag(COV))
    estimate, own, central = np.tile(MEAN, (trials, 1)), np.tile(COV, (trials, 9, 1, 1)), np.tile(COV, (trials, 1, 1))
    errors, count = [], []
    for _ in range(20):
        x = x @ F.T + np.sqrt(0.1) * rng.normal(size=(trials, 2)) @ G.T
        z = power(x) + rng.normal(size=(trials, 9))
        cloud = cloud @ F.T + np.sqrt(0.1) * rng.normal(size=(trials, particles, 2)) @ G.T
        estimate = estimate @ F.T
        at, g = power(estimate), gradient(estimate)
        own = F @ own @ F.T + Q
        hp = np.einsum("tsi,tsij->tsj", g, own)
        s = np.einsum("tsi,tsi->ts", hp, g) + 1
        own = own - hp[..., :, None] * hp[..., None, :] / s[..., None, None]
        if scheme == "CFwMD2":
            s = np.einsum("tsi,tij,tsj->ts", g, F @ central @ F.T + Q, g) + 1
        c = np.sqrt(eta * s)
        sent = np.abs(z - at) >= c
        if scheme in ("all", "random"):
            sent = rng.random((trials, 9)) < (1 if scheme == "all" else messages / 9)
        h = power(cloud)
        logs = -0.5 * np.einsum("tns,ts->tn", (z[:, None] - h) ** 2, sent.astype(float))
        if scheme.startswith("CFwMD"):
            for t in range(trials):
                quiet = ~sent[t]
                mu = h[t][:, quiet] - at[t, quiet]
                logs[t] += log_between(-c[t, quiet] - mu, c[t, quiet] - mu).sum(1)
        w = np.exp(logs - logs.max(1, keepdims=True))
        w /= w.sum(1, keepdims=True)
        estimate = np.einsum("tn,tnd->td", w, cloud)
        d = cloud - estimate[:, None]
        central = np.einsum("tn,tni,tnj->tij", w, d, d, optimize=True)
        e = (estimate - x) ** 2
        errors.append(np.stack((e[:, 0] + e[:, 2], e[:, 1] + e[:, 3]), axis=-1))
        count.append(sent.sum(1))
        (cloud,) = resample(rng, w, cloud)
    return {"errors": np.swapaxes(errors, 0, 1), "count": np.array(count).T}


for figure in ("cfwmd-fig8", "cfwmd-fig9", "cfwmd-fig10", "cfwmd-table3"):
    three(figure, "", lambda row: field(row.split(",")[0], 9.0 if row.startswith("all") else budget(row)))
