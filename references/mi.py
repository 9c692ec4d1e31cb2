"""Quantizers by mutual information: Movaghati, thesis, chapter 4 and appendix A. Equation numbers are the thesis's, errata `mi-1` ...
those of docs/errata.md. Information in nats, errors in prior variances; X is N(0, 1).
"""

from functools import lru_cache, partial

import numpy as np
from scipy.optimize import brentq, minimize
from scipy.special import gammaln, ndtr

from common import Recipes, lloyd_max, numbers, phi

RECIPES = Recipes()


class Unknown:
    """Nodes and weights of X; `rho` > 0 correlates unit noises through a factor that X + sqrt(rho) U takes in."""

    def __init__(self, rho=0.0, h=0.125, half=9.0):
        self.x = h * np.arange(-np.ceil(half / h), np.ceil(half / h) + 1)
        self.w = phi(self.x) / phi(self.x).sum()
        self.centre, self.mix, self.shrink = self.x, None, np.sqrt(1 - rho)
        if rho > 0:
            self.centre = np.arange(-14, 14.001, min(0.1, h))
            self.mix = phi((self.centre[:, None] - self.x) / np.sqrt(rho))
            self.mix /= self.mix.sum(0)

    def cells(self, edges, sigma, labels=None):
        """P(z | centre), one row a level; `labels` names the level of each cell, from left to right. Any complex edges."""
        u = (np.asarray(edges)[:, None] - self.centre) / (sigma * self.shrink)
        p = np.diff(np.concatenate((0 * u[:1], ndtr(u), 0 * u[:1] + 1)), axis=0)
        return p if labels is None else np.array([p[np.array(labels) == z].sum(0) for z in range(max(labels) + 1)])

    def joint(self, received):
        """q[t, x] of all combinations of the sensors' received words."""
        q = received[0]
        for p in received[1:]:
            q = (q[:, None] * p).reshape(-1, len(self.centre))
        return q if self.mix is None else q @ self.mix


def xlogx(p):
    return p * np.log(np.where(p.real > 1e-300, p, 1e-300))


def mi(q, u, count=1):
    """I(X; T), (4.2)."""
    count = np.broadcast_to(count, len(q))
    return count @ (xlogx(q) @ u.w - xlogx(q @ u.w))


def mse(q, u, count=1):
    total = q @ u.w
    return u.w @ u.x**2 - np.broadcast_to(count, len(q)) @ ((q @ (u.w * u.x)) ** 2 / np.where(total.real > 1e-300, total, 1e-300))


SIGN = {"mi": -1, "mse": 1}
CRITERION = {"mi": mi, "mse": mse}


def words(eps, labels):
    """C[t, z] of two- or three-bit words over a binary symmetric channel (natural words: mi-14)."""
    bits = max(1, int(np.ceil(np.log2(max(labels) + 1))))
    distance = np.array([[bin(t ^ z).count("1") for z in labels] for t in range(2**bits)])
    return eps**distance * (1 - eps) ** (bits - distance)


LABELS = {"natural": (0, 1, 2, 3), "gray": (0, 1, 3, 2), "third": (0, 3, 1, 2)}


class Sensors:
    """Two (or more) sensors; the parameters are all their breakpoints in turn."""

    def __init__(self, sigmas=(1, 1), rho=0.0, channel=None, h=0.125, labels=None):
        self.u, self.sigmas, self.channel, self.labels = Unknown(rho, h), sigmas, channel, labels

    def q(self, edges):
        received = []
        for n, (e, sigma) in enumerate(zip(edges, self.sigmas)):
            p = self.u.cells(e, sigma, None if self.labels is None else self.labels[n])
            received.append(p if self.channel is None else self.channel @ p)
        return self.u.joint(received)

    def value(self, criterion, edges):
        return CRITERION[criterion](self.q(edges), self.u)

    def design(self, criterion, start, free=None, polish=True):
        """Breakpoints at a stationary point near `start`; `free` names the sensors that may move."""
        start = [np.array(e, float) for e in start]
        free = range(len(start)) if free is None else free
        cuts = np.cumsum([len(start[n]) for n in free])[:-1]

        def unpack(b):
            edges = list(start)
            for n, part in zip(free, np.split(b, cuts)):
                edges[n] = part
            return edges

        f = lambda b: SIGN[criterion] * self.value(criterion, unpack(b))

        def gradient(b):
            return np.array([f(b + 1e-30j * unit).imag / 1e-30 for unit in np.eye(len(b))])

        b = np.concatenate([start[n] for n in free])
        bad = lambda b: any(np.any(np.diff(e) <= 1e-3) for e in unpack(b))
        b = minimize(lambda b: 1e3 if bad(b) else f(b).real, b, jac=gradient, method="BFGS", options={"gtol": 1e-6}).x
        for _ in range(8 if polish else 0):  # Newton: to the stationary point, a saddle too
            hessian = np.array([(gradient(b + 1e-5 * e) - gradient(b - 1e-5 * e)) / 2e-5 for e in np.eye(len(b))])
            move = np.linalg.solve(hessian, gradient(b))
            b = b - move * min(1, 0.05 / np.max(np.abs(move)))
        return unpack(b)


@lru_cache(None)
def lloyd(levels, scale=1.0):
    return scale * lloyd_max(levels)[0]


def greedy(sensors, start, order=(0, 1)):
    """(4.4): each sensor for I(X; T_1 ... T_n), those before it fixed."""
    edges = [np.array(e) for e in start]
    for n, which in enumerate(order):
        chosen = order[: n + 1]
        part = Sensors([sensors.sigmas[i] for i in chosen], channel=sensors.channel)
        part.u = sensors.u
        edges[which] = part.design("mi", [edges[i] for i in chosen], free=[n])[-1]
    return edges


def best(sensors, criterion, starts):
    designs = [sensors.design(criterion, start, polish=False) for start in starts]
    values = [SIGN[criterion] * sensors.value(criterion, d) for d in designs]
    return sensors.design(criterion, designs[int(np.argmin(values))])


def random_starts(levels, count, scale=2.0, seed=1):
    rng = np.random.default_rng(seed)
    return [[np.sort(rng.normal(0, scale / 1.4, levels - 1)) + 0.05 * np.arange(levels - 1) for _ in range(2)] for _ in range(count)]


def symmetric(outer):
    """Printed outer breakpoints to a full list: 0.73, 1.51, 2.49 to seven."""
    outer = np.array(outer)
    return np.concatenate((-outer[::-1], [0], outer))


# Table 4.1

PRINTED41 = {"rho0-L4": ([1.37], [1.37]), "rho0-L8": ([0.73, 1.51, 2.49],) * 2, "rho85-L4": ([1.15], [2.10])}


@lru_cache(None)
def table41(row):
    case, method, design = row.split(" ")
    rho, levels = 0.85 if case.startswith("rho85") else 0.0, int(case[-1])
    sensors = Sensors(rho=rho)
    x, y = [lloyd(levels)] * 2, [lloyd(levels, np.sqrt(2))] * 2
    if design == "printed":
        edges = [symmetric(p) for p in PRINTED41[case]]
    elif design == "independent":
        edges = x if method == "lloyd-x" else y
    elif design == "greedy":
        edges = greedy(sensors, x)
    elif design == "symmetric":  # the saddle (mi-10)
        edges = sensors.design(method, [symmetric([1.1]), symmetric([2.0])])
    elif rho:
        edges = best(sensors, method, random_starts(levels, 12))
    else:
        edges = sensors.design(method, x)
    return sensors, edges


RECIPES.of("mi-table4-1/mse")(lambda row: mse((s := table41(row))[0].q(s[1]), s[0].u))
RECIPES.of("mi-table4-1/mi_nats")(lambda row: table41(row)[0].value("mi", table41(row)[1]))
RECIPES.of("mi-table4-1/outer1")(lambda row: table41(row)[1][0][-1])


@RECIPES.of("mi-table4-1/chain-loss")
def chain_loss(row):
    value = lambda design: table41(f"{row} mi {design}")[0].value("mse", table41(f"{row} mi {design}")[1])
    return value("greedy") - value("joint")


# Table 4.2: noise variances 1 and 1/2

PRINTED42 = {4: ([1.380], [1.135]), 8: ([0.69, 1.45, 2.43], [0.58, 1.22, 2.05])}


@lru_cache(None)
def table42(row):
    levels, method = int(row[0]), row.split(" ")[2]
    sensors = Sensors((1, np.sqrt(0.5)), h=0.0625)
    scaled = lambda a, b: [lloyd(levels, a), lloyd(levels, b)]
    if method == "mi-printed":
        return sensors, [symmetric(p) for p in PRINTED42[levels]]
    if method.startswith("lloyd"):
        scales = {"noise": (1, np.sqrt(0.5)), "x": (1, 1), "y": (np.sqrt(2), np.sqrt(1.5))}
        return sensors, scaled(*scales[method[6:]])
    if method.startswith("mi-greedy"):
        return sensors, greedy(sensors, scaled(1, 1), (1, 0) if method.endswith("first") else (0, 1))
    return sensors, sensors.design(method[:-6], scaled(1.4, 1.2))


RECIPES.of("mi-table4-2/mse")(lambda row: table42(row)[0].value("mse", table42(row)[1]))
RECIPES.of("mi-table4-2/outer1")(lambda row: table42(row)[1][0][-1])
RECIPES.of("mi-table4-2/outer2")(lambda row: table42(row)[1][1][-1])


def ceo(rate, noises):
    """Least D of any codes at `rate` nats a sensor: every subset constraint of the quadratic Gaussian CEO problem."""
    noises = np.array(noises, float)
    n = len(noises)
    gain = lambda r, of: 1 + np.sum(((1 - np.exp(-2 * r)) / noises)[of])
    subsets = [np.array([(s >> i) & 1 for i in range(n)], bool) for s in range(1, 2**n)]
    spent = lambda r, a: np.sum(r[a]) + 0.5 * np.log(gain(r, np.ones(n, bool))) - 0.5 * np.log(gain(r, ~a))
    limits = [{"type": "ineq", "fun": lambda r, a=a: a.sum() * rate - spent(r, a)} for a in subsets]
    found = minimize(lambda r: -np.log(gain(r, np.ones(n, bool))), np.full(n, rate / 2), constraints=limits,
                     bounds=[(0, None)] * n, method="SLSQP", options={"ftol": 1e-15, "maxiter": 500})
    return np.exp(found.fun)


RECIPES.of("mi-table4-2/ceo_bound")(lambda row: ceo(np.log(int(row[0])), (1, 0.5)))


# Table 4.3: nine sensors, counts instead of words (mi-4)

def compositions(total, parts):
    if parts == 1:
        return [(total,)]
    return [(first,) + rest for first in range(total + 1) for rest in compositions(total - first, parts - 1)]


@lru_cache(None)
def counts(sensors, levels):
    c = np.array(compositions(sensors, levels))
    return c, np.exp(gammaln(sensors + 1) - gammaln(c + 1).sum(1))


def identical(p, sensors):
    """q of one sequence of each composition, and how many sequences it has."""
    c, number = counts(sensors, len(p))
    return np.exp(c @ np.log(np.where(p.real > 1e-300, p, 1e-300))), number


def stationary(f, start, width=0.25):
    """Zero of the derivative of f near `start`."""
    slope = lambda t: f(t + 1e-30j).imag
    return brentq(slope, start - width, start + width, xtol=1e-14, rtol=1e-14)


NINE = Unknown(h=0.25)


def nine(criterion, t):
    q, number = identical(NINE.cells([-t, 0 * t, t], 1.0), 9)
    return CRITERION[criterion](q, NINE, number)


@lru_cache(None)
def chain43():
    """The greedy chain of nine sensors: t_1 ... t_9 and the error at its end. Words are followed one by one."""
    others, found = np.ones((1, len(NINE.x))), []
    for _ in range(9):
        def information(t):
            p = NINE.cells([-t, 0 * t, t], 1.0)
            return np.sum(xlogx(p) @ NINE.w) - np.sum(xlogx((others * NINE.w) @ p.T))

        t = stationary(information, 1.37, 0.05)
        p = NINE.cells([-t, 0, t], 1.0)
        found.append(t)
        last, others = others, (others[:, None] * p).reshape(-1, len(NINE.x)) if len(found) < 9 else None
    total, first = (last * NINE.w) @ p.T, (last * NINE.w * NINE.x) @ p.T
    return found, NINE.w @ NINE.x**2 - np.sum(first**2 / total)


RECIPES.of("mi-table4-3/t", r"^mi \d$")(lambda row: chain43()[0][int(row[3:]) - 1])


@RECIPES.of("mi-table4-3/t")
def t43(row):
    given = {"mi-printed": 1.275, "lloyd-printed": 0.982, "lloyd-x": lloyd(4)[-1], "lloyd-y": np.sqrt(2) * lloyd(4)[-1]}
    return given[row] if row in given else stationary(partial(nine, row[:-6]), 1.4, 0.1)


RECIPES.of("mi-table4-3/mse", "mi-greedy")(lambda row: chain43()[1])
RECIPES.of("mi-table4-3/mse", "^ceo$")(lambda row: one_rate(9, np.log(4)))
RECIPES.of("mi-table4-3/mse")(lambda row: nine("mse", t43(row)))
RECIPES.of("mi-table4-3/mi_nats")(lambda row: nine("mi", t43(row)))


def one_rate(sensors, rate):
    """`ceo` for equal sensors in unit noise: the sum constraint alone."""
    gain = lambda r: 1 + sensors * (1 - np.exp(-2 * r))
    r = brentq(lambda r: r + np.log(gain(r)) / (2 * sensors) - rate, 0, rate)
    return 1 / gain(r)


# Table 4.4: five sensors detect theta, priors 1/2

class Detection:
    def __init__(self, theta):
        self.theta, self.u = theta, Unknown()
        self.u.x = self.u.centre = np.array([0.0, theta])
        self.u.w = np.array([0.5, 0.5])

    def p(self, t):
        return self.u.cells([self.theta / 2 - t, self.theta / 2 + 0 * t, self.theta / 2 + t], 1.0)

    def five(self, criterion, t):
        q, number = identical(self.p(t), 5)
        return mi(q, self.u, number) if criterion == "mi" else self.error(q, number)

    def error(self, q, number):
        """Bayes error: the smaller of the two joint probabilities, summed."""
        return number @ np.where(q[:, 0].real < q[:, 1].real, q[:, 0], q[:, 1]) / 2

    def distance(self, which, t):
        p = self.p(t)
        if which == "matusita":
            return -np.sum(np.sqrt(p[:, 0] * p[:, 1]))
        return np.sum((p[:, 1] - p[:, 0]) * np.log(p[:, 1] / p[:, 0]))

    @lru_cache(None)
    def greedy(self):
        others, found = np.ones((1, 2)), []
        for _ in range(5):
            information = lambda t: mi((others[:, None] * self.p(t)).reshape(-1, 2), self.u)
            grid = np.linspace(0.4, 1.6, 25)
            start = grid[np.argmax([information(t) for t in grid])]
            found.append(stationary(information, start, 0.05))
            others = (others[:, None] * self.p(found[-1])).reshape(-1, 2)
        return found, self.error(others, np.ones(len(others)))

    @lru_cache(None)
    def t(self, method):
        if method in ("mi-greedy", "mi-single"):
            return self.greedy()[0][0]
        if method in ("matusita", "j-divergence"):
            f, sign = partial(self.distance, method), 1
        else:
            f, sign = partial(self.five, "mi" if method == "mi-joint" else "pe"), 1 if method == "mi-joint" else -1
        grid = np.linspace(0.5, 2.2, 69)
        return stationary(f, grid[np.argmax([sign * f(t) for t in grid])], 0.03)


DETECTIONS = {2: Detection(2.0), 4: Detection(4.0)}


@RECIPES.of("mi-table4-4/t")
def t44(row):
    return DETECTIONS[int(row[0])].t(row[2:])


@RECIPES.of("mi-table4-4/pe")
def pe44(row):
    d = DETECTIONS[int(row[0])]
    return d.greedy()[1] if row.endswith("greedy") else d.five("pe", d.t(row[2:]))


RECIPES.of("mi-table4-4/unquantized_pe")(lambda row: ndtr(-int(row) * np.sqrt(5) / 2))
RECIPES.of("mi-table4-4/equivocation_nats")(lambda row: np.log(2) - DETECTIONS[4].five("mi", t44(row)))


# Table 4.5: words over a binary symmetric channel

@lru_cache(None)
def table45(eps, labels, method):
    sensors = Sensors(channel=words(eps, LABELS[labels]))
    starts = [symmetric([t]) for t in (1.36, 1.1, 0.95)]
    if method == "mi-greedy":
        return sensors, greedy(sensors, [starts[2]] * 2)
    return sensors, best(sensors, method[:-6], [[s, s] for s in starts])


def row45(row):
    eps, labels, method = row.split(" ")
    return table45(float(eps), labels, method)


RECIPES.of("mi-table4-5/mse")(lambda row: row45(row)[0].value("mse", row45(row)[1]))
RECIPES.of("mi-table4-5/outer2")(lambda row: row45(row)[1][1][-1])
RECIPES.of("mi-table4-5-mismatch/mse", "^[a-z]+$")(
    lambda row: Sensors(channel=words(0.05, LABELS[row])).value("mse", [symmetric([1.37])] * 2))


@RECIPES.of("mi-table4-5-mismatch/mse")
def mismatch(row):
    labels, designed, true = row.split(" ")
    return Sensors(channel=words(float(true), LABELS[labels])).value("mse", table45(float(designed), labels, "mi-joint")[1])
