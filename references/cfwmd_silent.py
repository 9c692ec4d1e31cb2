"""CFwMD with vectors and without feedback (figure 6): two sensors with their own filters, l = 1, and the joint Gaussian of the state and
both estimates. The exact filter by particles is not recomputed.
"""

from functools import lru_cache

import numpy as np

from cfwmd import F, G, START, STEPS, predict, three, truth
from cfwmd_more import AREA, R, UNIT, own_covariances, vector_update
from common import numbers

ETA = -2 * np.log(0.5)


def inside(mu, v, s):
    """Mean and covariance of N(mu, v) inside nu' s^-1 nu < eta, in polar coordinates that s whitens."""
    nu = np.sqrt(ETA) * np.linalg.cholesky(s) @ UNIT
    d = nu - mu[:, :, None]
    w = AREA * np.exp(-0.5 * np.einsum("tin,tij,tjn->tn", d, np.linalg.inv(v), d, optimize=True))
    w /= w.sum(1, keepdims=True)
    mean = np.einsum("tn,tin->ti", w, nu)
    return mean, np.einsum("tn,tin,tjn->tij", w, nu, nu, optimize=True) - mean[:, :, None] * mean[:, None]


POINTS = np.stack([g.ravel() for g in np.meshgrid(*(np.linspace(-4.5, 4.5, 31),) * 2)])


def outside(mu, v, s):
    """The same outside the ellipsoid, and its probability: sums over a grid that v whitens."""
    nu = mu[:, :, None] + np.linalg.cholesky(v) @ POINTS
    far = np.einsum("tin,ij,tjn->tn", nu, np.linalg.inv(s), nu, optimize=True) >= ETA
    w = far * np.exp(-0.5 * (POINTS**2).sum(0))
    total = np.maximum(w.sum(1, keepdims=True), 1e-300)
    mean = np.einsum("tn,tin->ti", w / total, nu)
    d = nu - mean[:, :, None]
    return total[:, 0] / np.exp(-0.5 * (POINTS**2).sum(0)).sum(), mean, np.einsum("tn,tin,tjn->tij", w / total, d, d, optimize=True)


def linear(m, c, a, y, noise, keep):
    """Law of X after its image a X (variance v with noise) takes the mean y and the covariance `keep`."""
    v = a @ c @ a.T + noise
    gain = c @ a.T @ np.linalg.inv(v)
    return m + np.einsum("tij,tj->ti", gain, y - m @ a.T), c - gain @ (v - keep) @ np.swapaxes(gain, 1, 2), gain


def joint_vector(m, c, s, gain, i, z, sent):
    """A message or silence of sensor i in the joint Gaussian of (x, xhat_1, xhat_2)."""
    h, t = np.eye(2, 6), np.zeros((2, 6))
    t[:, 2 + 2 * i : 4 + 2 * i] = np.eye(2)
    # sent: z is known; xhat lies outside the ellipsoid about z (cfwmd-4); then xhat takes z in
    ms, cs, _ = linear(m, c, h, z, R, np.zeros((2, 2)))
    mt, vt = ms @ t.T, t @ cs @ t.T
    safe = vt + 1e-9 * np.eye(2)
    p, mo, vo = outside(mt - z, safe, s)
    use = ((p > 1e-3) & (vt[:, 0, 0] > 1e-6))[:, None]
    m2, c2, _ = linear(ms, cs, t, mo + z, 1e-9 * np.eye(2), vo)
    ms, cs = np.where(use, m2, ms), np.where(use[:, :, None], c2, cs)
    step = np.eye(6) - t.T @ gain @ t
    ms = ms @ step.T + np.einsum("ij,tj->ti", t.T @ gain, z)
    cs = step @ cs @ step.T
    # silent: nu = x - xhat + n lies inside; then xhat takes the unknown nu in
    d = h - t
    v = d @ c @ d.T + R
    mi, vi = inside(m @ d.T, v, np.tile(s, (len(z), 1, 1)))
    mq, cq, g = linear(m, c, d, mi, R, vi)
    b = t.T @ gain
    cross = g @ vi @ b.T
    mq, cq = mq + mi @ b.T, cq + cross + np.swapaxes(cross, 1, 2) + b @ vi @ b.T
    return np.where(sent[:, None], ms, mq), np.where(sent[:, None, None], cs, cq)


@lru_cache(None)
def alone(scheme, acceleration, trials=3000):
    rng = np.random.default_rng(16)
    x, (s, gains) = truth(rng, trials, acceleration), own_covariances(acceleration)
    own, mean, cov = np.tile(START, (2, trials, 1)), np.tile(START, (trials, 1)), np.zeros((trials, 2, 2))
    m, c, step = np.tile(START, (trials, 3)), np.zeros((trials, 6, 6)), np.kron(np.eye(3), F)
    errors, count = [], []
    for k in range(STEPS):
        z = x[k + 1] + rng.normal(size=(2, trials, 2)) * np.sqrt(np.diag(R))
        own = own @ F.T
        nu = z - own
        sent = np.einsum("nti,ij,ntj->nt", nu, np.linalg.inv(s[k]), nu) >= ETA
        own = own + nu @ gains[k].T
        if scheme == "CFoMD":
            mean, cov = predict(mean, cov, acceleration)
            for i in (0, 1):
                mean, cov = vector_update(mean, cov, z[i], sent[i])
        else:
            m, c = m @ step.T, step @ c @ step.T
            c[:, :2, :2] += acceleration * np.outer(G, G)
            for i in (0, 1):
                m, c = joint_vector(m, c, s[k], gains[k], i, z[i], sent[i])
            mean = m[:, :2]
        errors.append((mean - x[k + 1]) ** 2)
        count.append(sent.sum(0))
    return {"errors": np.swapaxes(errors, 0, 1), "count": np.array(count).T}


three("cfwmd-fig6", "^CF", lambda row: alone(row.split(" ")[0].strip(","), numbers(row)[0]))
