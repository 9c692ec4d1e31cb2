"""CFwMD with vectors of position and velocity, and without feedback (docs/cfwmd.md; errata `cfwmd-2` to `cfwmd-4`)."""

from functools import lru_cache

import numpy as np
from scipy.special import ndtr, ndtri

from cfwmd import F, G, RECIPES, START, STEPS, budget, draw_between, measure, own_filter, predict, resample, scheme_of, silence, three, truth, values
from common import mean_and_error, numbers

# Vectors: R = diag(2, 4), z = x + n; send iff nu' S^-1 nu >= eta, eta = -2 ln(l/N)

R = np.diag([2.0, 4.0])


def own_covariances(acceleration):
    """S_k and the gains of a sensor that hears only itself."""
    p, s, gains = np.zeros((2, 2)), [], []
    for _ in range(STEPS):
        p = F @ p @ F.T + acceleration * np.outer(G, G)
        s.append(p + R)
        gains.append(p @ np.linalg.inv(s[-1]))
        p = p - gains[-1] @ p
    return np.array(s), np.array(gains)


RADII, RADIAL = np.polynomial.legendre.leggauss(12)
RADII, RADIAL = (RADII + 1) / 2, RADIAL / 2
ANGLES = 2 * np.pi * np.arange(24) / 24
UNIT = np.stack((np.outer(RADII, np.cos(ANGLES)).ravel(), np.outer(RADII, np.sin(ANGLES)).ravel()))
AREA = np.repeat(RADII * RADIAL, 24)


def ellipsoid(mu, v, s, eta):
    """Mean and covariance of N(mu, v) inside nu' s^-1 nu < eta, in polar coordinates that s whitens."""
    nu = np.sqrt(eta) * np.linalg.cholesky(s) @ UNIT  # [trial, 2, node]
    d = nu - mu[:, :, None]
    w = AREA * np.exp(-0.5 * np.einsum("tin,tij,tjn->tn", d, np.linalg.inv(v), d, optimize=True))
    w /= w.sum(1, keepdims=True)
    mean = np.einsum("tn,tin->ti", w, nu)
    return mean, np.einsum("tn,tin,tjn->tij", w, nu, nu, optimize=True) - mean[:, :, None] * mean[:, None, :]


def vector_update(mean, cov, z, which):
    """Kalman update with a vector where `which` holds."""
    gain = cov @ np.linalg.inv(cov + R)
    new = mean + np.einsum("tij,tj->ti", gain, z - mean)
    return np.where(which[:, None], new, mean), np.where(which[:, None, None], cov - gain @ cov, cov)


@lru_cache(None)
def vectors(scheme, sensors, messages, acceleration, trials=3000, seed=4):
    rng = np.random.default_rng(seed)
    x, own = truth(rng, trials, acceleration), own_covariances(acceleration)[0]
    mean, cov, eta = np.tile(START, (trials, 1)), np.zeros((trials, 2, 2)), -2 * np.log(messages / sensors)
    errors, count = [], []
    for k in range(STEPS):
        z = x[k + 1][:, None] + rng.normal(size=(trials, sensors, 2)) * np.sqrt(np.diag(R))
        chance = rng.random((trials, sensors))
        mean, cov = predict(mean, cov, acceleration)
        at, nu = mean.copy(), z - mean[:, None]
        s = cov + R if scheme == "CFwMD2" else np.tile(own[k], (trials, 1, 1))
        sent = np.einsum("tni,tij,tnj->tn", nu, np.linalg.inv(s), nu) >= eta
        if scheme in ("all", "random"):
            sent = chance < (1 if scheme == "all" else messages / sensors)
        for i in range(sensors):
            mean, cov = vector_update(mean, cov, z[:, i], sent[:, i])
        for i in range(sensors) if scheme.startswith("CFwMD") else ():
            v, quiet = cov + R, ~sent[:, i]
            inside, spread = ellipsoid(mean - at, v, s, eta)
            gain = cov @ np.linalg.inv(v)
            new = mean + np.einsum("tij,tj->ti", gain, inside - (mean - at))
            mean = np.where(quiet[:, None], new, mean)
            cov = np.where(quiet[:, None, None], cov - gain @ (v - spread) @ np.swapaxes(gain, 1, 2), cov)
        errors.append((mean - x[k + 1]) ** 2)
        count.append(sent.sum(1))
    return {"errors": np.swapaxes(errors, 0, 1), "count": np.array(count).T}


def vector_row(sensors):
    return lambda row: vectors(row.split(",")[0], sensors, budget(row), numbers(row)[0])


three("cfwmd-fig4", "", vector_row(2))
three("cfwmd-fig5", "", vector_row(4))
three("cfwmd-table2", "", vector_row(4))


# Without feedback: each sensor compares with its own filter's prediction xhat_i, which the fusion centre does not know

def doubly_truncated(m, v, lo, hi):
    """Probability, mean and variance of N(m, v) between lo and hi."""
    s = np.sqrt(v)
    a, b = (lo - m) / s, (hi - m) / s
    flip = a > 0
    a, b = np.where(flip, -b, a), np.where(flip, -a, b)
    mass = np.maximum(ndtr(b) - ndtr(a), 1e-300)
    fa, fb = (np.exp(-0.5 * e * e) / np.sqrt(2 * np.pi) / mass for e in (a, b))
    mean = fa - fb
    variance = np.maximum(1 + a * fa - b * fb - mean**2, 1e-9)
    return mass, m + np.where(flip, -1, 1) * s * mean, v * variance


class Alone:
    """Truth, values and decisions of two scalar sensors that run their own filters; l = 1."""

    def __init__(self, trials, seed):
        rng = np.random.default_rng(seed)
        self.trials, self.x, self.rng = trials, truth(rng, trials, 4.0), rng
        self.s, self.eta = own_filter(4.0), ndtri(0.75) ** 2
        self.z = self.x[1:, :, :1] + rng.normal(size=(STEPS, trials, 2))
        p, own = np.zeros((2, 2)), np.tile(START, (2, trials, 1))
        self.gains, self.own, self.p, sent = [], [], [], []
        for k in range(STEPS):
            p = F @ p @ F.T + 4.0 * np.outer(G, G)
            own = own @ F.T
            self.own.append(own)
            self.p.append(p)
            self.gains.append(p[:, 0] / self.s[k])
            nu = self.z[k] - own[:, :, 0].T
            sent.append(np.abs(nu) >= np.sqrt(self.eta * self.s[k]))
            own = own + nu.T[:, :, None] * self.gains[k]
            p = p - np.outer(p[:, 0], p[0]) / self.s[k]
        self.sent = np.array(sent)
        self.count = self.sent.sum(2).T

    def result(self, means):
        return {"errors": np.swapaxes((np.array(means) - self.x[1:]) ** 2, 0, 1), "count": self.count}


def joint_step(c, m, cov, gain, i, z, sent):
    """One sensor's message or silence in the joint Gaussian of (x, xhat_1, xhat_2); c = sqrt(eta s)."""
    h, t = np.zeros(6), 2 + 2 * i
    h[0] = 1
    # sent: z is known, then |z - xhat| >= c tells about xhat (cfwmd-4), then xhat takes z in
    v = cov[:, 0, 0] + 1
    g = cov[:, :, 0] / v[:, None]
    ms, cs = m + g * (z - m[:, 0])[:, None], cov - g[:, :, None] * cov[:, :1, :]
    mt, vt = ms[:, t], cs[:, t, t]
    safe = np.maximum(vt, 1e-12)
    p, mi, vi = doubly_truncated(mt, safe, z - c, z + c)
    out = np.maximum(1 - p, 1e-12)
    mo = (mt - p * mi) / out
    vo = (safe + mt**2 - p * (vi + mi**2)) / out - mo**2
    use = (p < 0.999) & (vt > 1e-9)
    gt = np.where(use[:, None], cs[:, :, t] / safe[:, None], 0)
    ms, cs = ms + gt * (mo - mt)[:, None], cs - gt[:, :, None] * gt[:, None, :] * (safe - vo)[:, None, None]
    keep = np.eye(6)
    keep[t : t + 2, t] -= gain
    ms, cs = ms @ keep.T, keep @ cs @ keep.T
    ms[:, t : t + 2] += gain * z[:, None]
    # silent: y = x - xhat + n lies within c, then xhat takes the unknown z in
    d = h.copy()
    d[t] = -1
    vy, my = np.einsum("i,tij,j->t", d, cov, d) + 1, m @ d
    _, mi, vi = doubly_truncated(my, vy, -c, c)
    g = (cov @ d) / vy[:, None]
    mq, cq = m + g * (mi - my)[:, None], cov - g[:, :, None] * g[:, None, :] * (vy - vi)[:, None, None]
    b = np.zeros(6)
    b[t : t + 2] = gain
    cross = (g * vi[:, None])[:, :, None] * b
    mq, cq = mq + mi[:, None] * b, cq + cross + np.swapaxes(cross, 1, 2) + vi[:, None, None] * np.outer(b, b)
    return np.where(sent[:, None], ms, mq), np.where(sent[:, None, None], cs, cq)


@lru_cache(None)
def no_feedback(rule, trials=3000, seed=6):
    w = Alone(trials, seed)
    mean, cov, means = np.tile(START, (trials, 1)), np.zeros((trials, 2, 2)), []
    m6, c6, prior = np.tile(START, (trials, 3)), np.zeros((trials, 6, 6)), np.zeros((2, 2))
    step = np.kron(np.eye(3), F)
    start = START.copy()
    for k in range(STEPS):
        c, sent, z = np.sqrt(w.eta * w.s[k]), w.sent[k], w.z[k]
        if rule == "joint Gaussian":
            m6, c6 = m6 @ step.T, step @ c6 @ step.T
            c6[:, :2, :2] += 4.0 * np.outer(G, G)
            for i in (0, 1):
                m6, c6 = joint_step(c, m6, c6, w.gains[k], i, z[:, i], sent[:, i])
            means.append(m6[:, :2])
            continue
        mean, cov = predict(mean, cov, 4.0)
        start, prior = F @ start, F @ prior @ F.T + 4.0 * np.outer(G, G)
        at = mean[:, 0].copy()
        mean, cov = measure(mean, cov, *values(z, sent))
        quiet = (~sent).sum(1)[:, None]
        if rule == "heuristic":  # xhat ~ N(the centre's prediction, P_i), whatever x is
            s = np.sqrt(w.s[k])
            mean, cov = silence(mean, cov, lambda y: (ndtr((c - y + at[:, None]) / s) - ndtr((-c - y + at[:, None]) / s)) ** quiet)
        if rule == "no history":  # (cfwmd-3): E[xhat | x] = m + A (x - m), A = (Sigma - P) Sigma^-1, from the open loop
            a = (prior - w.p[k]) @ np.linalg.pinv(prior)
            g = np.array([1.0, 0.0]) @ (np.eye(2) - a)
            left = (prior - w.p[k]) - a @ (prior - w.p[k]).T
            s = np.sqrt(left[0, 0] + 1)
            if np.abs(g).max() > 1e-9:
                # y = g x: turn the belief so that y is its first coordinate
                turn = np.array([g, [-g[1], g[0]]])
                tm, tc = (mean - start) @ turn.T, turn @ cov @ turn.T
                tm, tc = silence(tm, tc, lambda y: np.maximum(ndtr((c - y) / s) - ndtr((-c - y) / s), 1e-300) ** quiet)
                back = np.linalg.inv(turn)
                mean, cov = tm @ back.T + start, back @ tc @ back.T
        means.append(mean)
    return w.result(means)


@lru_cache(None)
def exact_alone(trials=500, particles=300, seed=8):
    """The exact filter: a particle imputes what silent sensors measured; the central covariance is common and free of data."""
    w = Alone(trials, seed)
    rng, central = w.rng, np.tile(START, (trials, particles, 1))
    own, cov = np.tile(START, (2, trials, particles, 1)), np.zeros((2, 2))
    logs, means = np.zeros((trials, particles)), []
    for k in range(STEPS):
        central, own = central @ F.T, own @ F.T
        cov = F @ cov @ F.T + 4.0 * np.outer(G, G)
        c, z = np.sqrt(w.eta * w.s[k]), w.z[k]
        for order in (0, 1):
            i = np.where(w.sent[k][:, 0], order, 1 - order)
            told, value = (np.take_along_axis(a, i[:, None], 1) for a in (w.sent[k], z))
            hat = np.where((i == 0)[:, None], own[0, :, :, 0], own[1, :, :, 0])
            s, m = cov[0, 0] + 1, central[:, :, 0]
            a, b = (hat - c - m) / np.sqrt(s), (hat + c - m) / np.sqrt(s)
            inside = np.where(a > 0, ndtr(-a) - ndtr(-b), ndtr(b) - ndtr(a))
            imputed = np.where(told, value, m + np.sqrt(s) * draw_between(rng, a, b))
            known = -0.5 * (value - m) ** 2 / s - 1e5 * (np.abs(value - hat) < c)
            logs = logs + np.where(told, known, np.log(np.maximum(inside, 1e-300)))
            central = central + (imputed - m)[:, :, None] * cov[:, 0] / s
            cov = cov - np.outer(cov[:, 0], cov[0]) / s
            for n in (0, 1):
                own[n] += np.where((i == n)[:, None], imputed - own[n, :, :, 0], 0)[:, :, None] * w.gains[k]
        weights = np.exp(logs - logs.max(1, keepdims=True))
        weights /= weights.sum(1, keepdims=True)
        means.append(np.einsum("tn,tnd->td", weights, central))
        poor = 1 / (weights**2).sum(1) < particles / 2
        fresh = resample(rng, weights, central, own[0], own[1])
        pick = poor[:, None, None]
        central, own[0], own[1] = (np.where(pick, f, o) for f, o in zip(fresh, (central, own[0], own[1])))
        logs = np.where(poor[:, None], 0, logs)
    return w.result(means)


three("cfwmd-nofeedback", "^exact", lambda row: exact_alone())
three("cfwmd-nofeedback", "", lambda row: no_feedback(row.split(",")[0]))
three("cfwmd-fig3", "", lambda row: no_feedback({"CFoMD": "ignored", "CFwMD": "joint Gaussian"}[row.split(",")[0]]))
