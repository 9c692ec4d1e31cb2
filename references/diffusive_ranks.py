"""A leak in the building of `diffusive-ranks`, found by ranks alone: a finite-volume solution of our own and SciPy's ranks.

Still air. An opening holds the concentration at zero half a cell beyond the last centre. Readings have noise of a twentieth of the typical
response; the cell whose concentrations have the nearest ranks is the estimate. The value is the share of placements whose estimate is within two
cells of the source.
"""

import os

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import factorized
from scipy.stats import rankdata

from common import HERE, numbers
from diffusive import RECIPES

PLAN = os.path.join(HERE, "..", "crates", "experiments", "src", "diffusive", "rooms.plan")
CELL, PLACEMENTS, NOISE, RATES = 0.25, 600, 0.05, (0.5, 1.5)


def building():
    """Centres of the free cells, and a function that solves for the concentrations of a unit source (per diffusivity)."""
    with open(PLAN) as file:
        plan = [line for line in file.read().split("\n") if line]
    number = {}
    for y, line in enumerate(plan):
        for x, square in enumerate(line):
            if square == ".":
                number[x, y] = len(number)
    rows, columns, values = [], [], []
    for (x, y), cell in number.items():
        total = 0.0
        for place in ((x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)):
            square = plan[place[1]][place[0]]
            if square == ".":
                total += 1.0
                rows.append(cell)
                columns.append(number[place])
                values.append(-1.0)
            elif square in "IO":
                total += 2.0
        rows.append(cell)
        columns.append(cell)
        values.append(total)
    matrix = coo_matrix((values, (rows, columns))).tocsc()
    return CELL * np.array(list(number)), factorized(matrix)


@RECIPES.of("diffusive-ranks/ranks")
def ranks(row):
    count = int(numbers(row)[0])
    rng = np.random.default_rng([2026, count])
    centres, solve = building()
    near = 0
    for _ in range(PLACEMENTS):
        source = rng.integers(len(centres))
        sensors = rng.choice(len(centres), count, replace=False)
        # The equations are symmetric: what a sensor sees of each cell is the solution with the source at the sensor.
        responses = np.array([solve(np.eye(1, len(centres), sensor)[0]) for sensor in sensors])
        noise = NOISE * np.median(responses)
        seen = rng.uniform(*RATES) * responses[:, source] + noise * rng.standard_normal(count)
        squares = ((rankdata(seen)[:, None] - rankdata(responses, axis=0)) ** 2).sum(axis=0)
        found = centres[np.argmin(squares)]
        near += np.hypot(*(found - centres[source])) <= 2 * CELL + 1e-9
    share = near / PLACEMENTS
    return share, np.sqrt(share * (1 - share) / PLACEMENTS)
