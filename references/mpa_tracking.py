"""Trackers of chapter 3 that need no message passing by particles: Kalman filters, quadrature and guided draws on the cells' exact
likelihood, bootstrap filters. All trajectories of a setting are filtered together; every method sees the same tracks and noise.
"""

import zlib
from functools import lru_cache

import numpy as np
from scipy.special import ndtr

from common import log_between, mean_and_error
from mpa import RECIPES

STEPS, TRIALS, JUMP = 25, 200, 0.1
CANONICAL = np.array([(4, 4), (16, 4), (10, 10), (4, 16), (16, 16)], float)
F = np.kron(np.array([[1, 1], [0, 1]]), np.eye(2))  # state x, y, vx, vy; one second
G = np.vstack((0.5 * np.eye(2), np.eye(2)))
MEAN, COV = np.array([13, 17, 0, -0.6]), np.diag([0.04, 0.04, 0.01, 0.01])
FIRST, CHANGE = np.array([0.7, 0.15, 0.15]), np.array([[0.6, 0.2, 0.2], [0.4, 0.5, 0.1], [0.4, 0.1, 0.5]])
VALUES = JUMP * np.array([0, 1, -1])
SPREAD = [JUMP**2 * (FIRST @ np.linalg.matrix_power(CHANGE, k))[1:].sum() for k in range(STEPS)]  # variance of a_k
LAYOUTS = [np.array(layout).reshape(5, 2) for layout in (
    (3.314263649845593, 9.98700152392207, 11.82697043722044, 1.516402150695002, 3.662669522394207, 17.70779841328665,
     2.267570370775543, 3.335931089187364, 18.06991215925195, 12.19390467033489),
    (7.641876227136238, 10.20502039245873, 12.93117314530239, 5.955558683700327, 3.483425311605196, 15.18471270107185,
     13.06649051384471, 10.22288164269689, 15.70125584745385, 10.88335483966047),
    (18.6564455073515, 4.681170303940808, 10.9671465315741, 9.705244544620978, 7.358947391088066, 11.64871547108278,
     5.23542217001645, 15.4396483080127, 16.61200393316346, 3.317674082101319),
    (9.40731772128888, 5.988608065606678, 2.496105959234363, 17.12699754850662, 8.739076456861037, 3.658443399317693,
     13.12052243096639, 4.639888500184687, 17.22575941638718, 4.908668633533507),
)]  # data of the figure, drawn once
LOADING = {2: 1.596, 4: 1.991, 8: 2.344, 16: 2.682}


def draw_modes(rng, before, shape):
    """Next acceleration's index; `before` None at the first step."""
    chances = np.broadcast_to(FIRST, shape + (3,)) if before is None else CHANGE[before]
    return np.minimum((rng.random(shape)[..., None] > np.cumsum(chances, -1)).sum(-1), 2)


@lru_cache(None)
def tracks(confined=True, trials=TRIALS, seed=20):
    """Tracks [trial, step, 4], and a standard normal number for each of five sensors and steps."""
    rng = np.random.default_rng(seed)
    kept = np.zeros((0, STEPS, 4))
    while len(kept) < trials:
        x, modes, path = MEAN + rng.normal(size=(2000, 4)) * np.sqrt(np.diag(COV)), None, []
        for _ in range(STEPS):
            modes = draw_modes(rng, modes, (2000, 2))
            x = x @ F.T + (VALUES[modes] + np.sqrt(0.02) * rng.normal(size=(2000, 2))) @ G.T
            path.append(x)
        path = np.swapaxes(path, 0, 1)
        inside = np.all((path[..., :2] >= 0) & (path[..., :2] <= 20), axis=(1, 2))
        kept = np.concatenate((kept, path[inside] if confined else path))
    return kept[:trials], rng.normal(size=(trials, STEPS, 5))


class Setting:
    def __init__(self, snr, levels, sensors=CANONICAL, speed=3.0, encoder="published", loading=None):
        self.c, self.levels, self.sensors, self.speed = 10 ** (snr / 20), levels, sensors, speed
        self.encoder, self.loading = encoder, loading or LOADING.get(levels)

    def geometry(self, p):
        """Distances and unit vectors from the sensors; p [..., 2]."""
        d = p[..., None, :] - self.sensors
        r = np.maximum(np.linalg.norm(d, axis=-1), 1e-9)
        return r, d / r[..., None]

    def code(self, z, last, mean, cov):
        """Cells [lo, hi] of the measured ranges, ends that are half-infinite, and the middle of each cell (errata mpa-1, mpa-2)."""
        if self.encoder == "published":
            reference = self.geometry(last[:, :2])[0]
        else:
            reference, unit = self.geometry(mean[:, :2])
        if self.encoder == "adaptive":
            spread = np.einsum("tsi,tij,tsj->ts", unit, cov[:, :2, :2], unit)
            width = self.loading * np.sqrt(spread + (reference / self.c) ** 2)
        else:
            width = self.speed + JUMP / 2 + 2.5 * reference / self.c
        q = np.clip(np.floor(((z - reference) / width + 1) * self.levels / 2), 0, self.levels - 1)
        edge = lambda n: reference + width * (-1 + 2 * n / self.levels)
        lo, hi = np.where(q == 0, -np.inf, edge(q)), np.where(q == self.levels - 1, np.inf, edge(q + 1))
        return lo, hi, edge(q + 0.5), 2 * width / self.levels


def kalman(s, mean, cov, z, extra):
    """Update with all ranges, linearised at the prediction; `extra` is added to the noise's variance."""
    r, unit = s.geometry(mean[:, :2])
    h = np.concatenate((unit, np.zeros_like(unit)), -1)
    hp = h @ cov
    total = hp @ np.swapaxes(h, 1, 2)
    total[:, range(5), range(5)] += (r / s.c) ** 2 + extra
    gain = np.swapaxes(np.linalg.solve(total, hp), 1, 2)
    new = cov - gain @ hp
    return mean + np.einsum("tij,tj->ti", gain, z - r), (new + np.swapaxes(new, 1, 2)) / 2


def probability(s, p, lo, hi):
    """Product over the sensors of P(cell | p): p [trial, node, 2]."""
    r = s.geometry(p)[0]
    with np.errstate(invalid="ignore"):
        a, b = (lo[:, None] / r - 1) * s.c, (hi[:, None] / r - 1) * s.c
    flip = a > 0
    return np.prod(ndtr(np.where(flip, -a, b)) - ndtr(np.where(flip, -b, a)), axis=-1)


def regress(mean, cov, p, pp):
    """Whole state from the moments of its position, the velocity by regression on the predicted law."""
    a = cov[:, 2:, :2] @ np.linalg.inv(cov[:, :2, :2])
    v = mean[:, 2:] + np.einsum("tij,tj->ti", a, p - mean[:, :2])
    pv = pp @ np.swapaxes(a, 1, 2)
    vv = cov[:, 2:, 2:] - a @ cov[:, :2, 2:] + a @ pv
    return np.concatenate((p, v), 1), np.concatenate((np.concatenate((pp, pv), 2), np.concatenate((np.swapaxes(pv, 1, 2), vv), 2)), 1)


def moments(w, p):
    w = w / w.sum(1, keepdims=True)
    m = np.einsum("tn,tni->ti", w, p)
    d = p - m[:, None]
    return m, np.einsum("tn,tni,tnj->tij", w, d, d, optimize=True)


def grid(s, mean, cov, lo, hi, n):
    """Quadrature over +-4 deviations of the whitened predicted position, once more around the first result; failed where no mass."""
    root = np.linalg.cholesky(cov[:, :2, :2])
    base = np.stack(np.meshgrid(*(np.linspace(-4, 4, n),) * 2, indexing="ij"), -1).reshape(-1, 2)
    centre, scale = np.zeros((len(mean), 2)), np.ones((len(mean), 2))
    failed = np.zeros(len(mean), bool)
    for again in (0, 1):
        u = centre[:, None] + base * scale[:, None]
        p = mean[:, None, :2] + np.einsum("tij,tnj->tni", root, u)
        w = probability(s, p, lo, hi) * np.exp(-0.5 * (u**2).sum(-1))
        failed |= ~(w.sum(1) > 1e-250)
        w[failed] = 1
        m, c = moments(w, u)
        spacing = 8 * scale / (n - 1)
        c[:, range(2), range(2)] = np.maximum(c[:, range(2), range(2)], spacing**2 / 12)
        sd = np.sqrt(c[:, range(2), range(2)])
        if not again:
            narrow = sd < 0.5
            centre, scale = np.where(narrow, m, 0), np.where(narrow, np.maximum(1.2 * sd, 0.02), 1)
    return mean[:, :2] + np.einsum("tij,tj->ti", root, m), root @ c @ np.swapaxes(root, 1, 2), failed


def guided(s, rng, mean, cov, updated, lo, hi, n):
    """n draws from the Gaussian update, its covariance times 1.5, weighted by prior and cells; failed below 2.5 effective draws."""
    m, c = updated[0][:, :2], 1.5 * updated[1][:, :2, :2]
    root = np.linalg.cholesky(c)
    e = rng.normal(size=(len(mean), n, 2))
    p = m[:, None] + np.einsum("tij,tnj->tni", root, e)
    d = p - mean[:, None, :2]
    prior = -0.5 * np.einsum("tni,tij,tnj->tn", d, np.linalg.inv(cov[:, :2, :2]), d, optimize=True)
    r = s.geometry(p)[0]
    with np.errstate(invalid="ignore"):
        logs = log_between((lo[:, None] / r - 1) * s.c, (hi[:, None] / r - 1) * s.c).sum(-1)
    logs = logs + prior + 0.5 * (e**2).sum(-1)
    logs = np.where(np.isfinite(logs), logs, -1e300)
    w = np.exp(logs - logs.max(1, keepdims=True))
    w /= w.sum(1, keepdims=True)
    ess = 1 / (w**2).sum(1)
    failed = (ess < 2.5) | (logs.max(1) < -1e200)
    pm, pp = moments(np.where(failed[:, None], 1.0, w), p)
    return pm, pp * (ess / np.maximum(ess - 1, 1e-3))[:, None, None], failed


@lru_cache(None)
def positions(method, s, confined=True, trials=TRIALS):
    """Estimated positions [trial, step, 2]."""
    name, _, count = method.rpartition("-") if method[-1].isdigit() else (method, "", "0")
    count, rng = int(count), np.random.default_rng(zlib.crc32(method.encode()))
    truth, noise = tracks(confined, trials)
    if name in ("bootstrap", "unquantized"):
        return particles(name, count, s, rng, truth, noise)
    mean, cov = np.tile(MEAN, (trials, 1)), np.tile(COV, (trials, 1, 1))
    total, message = [], not name.startswith("EKF")
    for k in range(STEPS):
        r = s.geometry(truth[:, k, :2])[0]
        z = r * (1 + noise[:, k] / s.c)
        last, mean = mean, mean @ F.T
        cov = F @ cov @ F.T + (0.02 + message * SPREAD[k]) * G @ G.T
        if name == "EKF-U":
            mean, cov = kalman(s, mean, cov, z, 0)
        else:
            lo, hi, middle, width = s.code(z, last, mean, cov)
            updated = kalman(s, mean, cov, middle, 0 if name == "EKF-Q-naive" else width**2 / 12)
            if name in ("grid", "guided"):
                exact = grid(s, mean, cov, lo, hi, count) if name == "grid" else guided(s, rng, mean, cov, updated, lo, hi, count)
                better = regress(mean, cov, exact[0], exact[1])
                updated = [np.where(exact[2].reshape(-1, *[1] * (b.ndim - 1)), u, b) for u, b in zip(updated, better)]
            if name == "GMPA-transfer":  # velocity passed on unchanged (erratum mpa-7)
                old = mean, cov
                mean, cov = updated
                mean[:, 2:] = old[0][:, 2:]
                cov[:, 2:, 2:], cov[:, :2, 2:], cov[:, 2:, :2] = old[1][:, 2:, 2:], 0, 0
            else:
                mean, cov = updated
        total.append(mean[:, :2])
    return np.swapaxes(total, 0, 1)


def particles(name, n, s, rng, truth, noise):
    """Bootstrap filter of state and acceleration, on the cells or on the ranges; resampled below n/2 effective draws."""
    trials = len(truth)
    x = MEAN + rng.normal(size=(trials, n, 4)) * np.sqrt(np.diag(COV))
    modes, logs, mean, total = None, np.zeros((trials, n)), np.tile(MEAN, (trials, 1)), []
    for k in range(STEPS):
        z = s.geometry(truth[:, k, :2])[0] * (1 + noise[:, k] / s.c)
        modes = draw_modes(rng, modes, (trials, n, 2))
        x = x @ F.T + (VALUES[modes] + np.sqrt(0.02) * rng.normal(size=(trials, n, 2))) @ G.T
        r = s.geometry(x[..., :2])[0]
        if name == "unquantized":
            logs = logs + (-0.5 * ((z[:, None] / r - 1) * s.c) ** 2 - np.log(r)).sum(-1)
        else:
            lo, hi = s.code(z, mean, mean, None)[:2]
            a, b = (lo[:, None] / r - 1) * s.c, (hi[:, None] / r - 1) * s.c
            outside = np.maximum(np.maximum(a, -b), 0)
            exact = log_between(np.where(outside > 30, -1, a), np.where(outside > 30, 1, b))
            logs = logs + np.where(outside > 30, -0.5 * outside**2, exact).sum(-1)
        w = np.exp(logs - logs.max(1, keepdims=True))
        w /= w.sum(1, keepdims=True)
        mean = np.einsum("tn,tni->ti", w, x)
        total.append(mean[:, :2])
        u = (np.arange(n) + rng.random((trials, 1))) / n
        index = np.array([np.minimum(np.searchsorted(np.cumsum(v), q), n - 1) for v, q in zip(w, u)])
        poor = 1 / (w**2).sum(1) < n / 2
        index = np.where(poor[:, None], index, np.arange(n))
        x, modes = np.take_along_axis(x, index[..., None], 1), np.take_along_axis(modes, index[..., None], 1)
        logs = np.where(poor[:, None], 0, np.log(np.maximum(w, 1e-300)))
    return np.swapaxes(total, 0, 1)


def errors(method, s, confined=True, trials=TRIALS):
    """Squared position errors [trial, step]."""
    return ((positions(method, s, confined, trials) - tracks(confined, trials)[0][..., :2]) ** 2).sum(2)


# From errors to values

def median(samples):
    """Median and its standard error, by resampling the trajectories."""
    rng = np.random.default_rng(1)
    again = [np.median(rng.choice(samples, len(samples))) for _ in range(300)]
    return np.median(samples), np.std(again)


def statistic(quantity, squares):
    runs = squares.mean(1)
    if quantity.endswith("mse"):
        return mean_and_error(runs)
    if quantity.endswith("median"):
        return median(runs)
    lost = np.mean(runs > 4)
    return lost, np.sqrt((lost + 0.005) * (1 - lost) / len(runs))


@lru_cache(None)
def layout(number):
    return Setting(50.0, 4, LAYOUTS[number])


@lru_cache(None)
def setting(point, encoder="published", loading=None, speed=3.0):
    """`50dB-L4`."""
    snr, levels = point.split("dB-L")
    return Setting(float(snr), int(levels), encoder=encoder, loading=loading, speed=speed)


def answer(quantity, method, s):
    trials = 80 if method in ("grid-31",) or method.endswith("-4000") else TRIALS
    return statistic(quantity, errors(method, s, True, trials))


METHODS = r"(EKF-U|EKF-Q|EKF-Q-naive|GMPA|GMPA-transfer|grid-\d+|guided-\d+|bootstrap-\d+|unquantized-\d+)$"


def register(figure, quantity, pattern, parse):
    def recipe(row):
        method, s = parse(row)
        return answer(quantity, method, s)

    RECIPES.of(f"{figure}/{quantity}", pattern)(recipe)


def plain(row):
    point, method = row.split(" ")
    return method, setting(point)


def by_speed(row):
    speed, method = row.split(" ")
    return method, setting("50dB-L4", speed=float(speed[1:]))


def by_layout(row):
    number, method = row.split(" ")
    return method, layout(int(number[-1]))


def by_encoder(row):
    encoder, point, method = row.split(" ")
    return method, setting(point, encoder)


def by_loading(row):
    loading, point, method = row.split(" ")
    return method, setting(point, "adaptive", None if loading == "best" else float(loading))


for what in ("mse", "median", "lost"):
    for figure in ("mpa-table3-mse", "mpa-fig3-4", "mpa-fig3-5", "mpa-table3-low"):
        register(figure, what, r"^\d+dB-L\d+ " + METHODS, plain)
    register("mpa-table3-mse", what, "^V", by_speed)
    register("mpa-table3-mse", what, r"^layout\d " + METHODS, by_layout)
    register("mpa-table3-mse", "floor-" + what, METHODS, plain)
    register("mpa-encoder", what, r"^(\d|best)", by_loading)
    register("mpa-encoder", what, "", by_encoder)
