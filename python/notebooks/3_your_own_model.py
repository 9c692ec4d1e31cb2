# %% [markdown]
# # A model of your own, on particles and on a grid
#
# A level that jumps between two wells, seen through an alarm that says "above 1" and is wrong once in twenty times. No Gaussian describes what
# is known. The grid is exact; particles take any number of coordinates.

# %%
import matplotlib.pyplot as plt
import numpy as np
import polars as pl

import fewbits as fb


def drift(x, dt):
    """Two wells at -1 and 1."""
    return x + dt * (x - x**3)


def move(x, dt, rng):
    x[0] = drift(x[0], dt) + 0.6 * np.sqrt(dt) * rng.standard_normal(x.shape[1])


def alarm(x, z):
    x = x[0] if x.ndim == 2 else x
    return np.log(np.where((x > 0.5) == (z > 0), 0.95, 0.05))


# %%
rng = fb.Generator(1)
path = np.zeros((1, 300))
state = np.array([[-1.0]])
for k in range(300):
    move(state, 0.1, rng)
    path[0, k] = state[0, 0]
wrong = rng.random(300) < 0.05
alarms = ((path[0] > 0.5) != wrong).astype(float)
table = pl.DataFrame({"t": 0.1 * np.arange(300), "alarm": alarms})

# %%
grid = fb.GridFilter(drift, lambda x, dt: 0.6 * np.sqrt(dt), {"alarm": alarm}, lower=-4, upper=4, spacing=0.02, start=(-1.0, 0.5))
exact = grid.run(table, time="t")
start = -1.0 + 0.5 * fb.Generator(2).standard_normal(20_000)
particles = fb.ParticleFilter(start[None], move, {"alarm": alarm}, seed=3).run(table, time="t")
worst = np.abs(particles["x0"] - exact["x0"]).max()
print(f"largest difference of the means: {worst:.3f}")
assert worst < 0.1
assert abs(particles["log_likelihood"].sum() - exact["log_likelihood"].sum()) < 1.0

# %%
axes = exact.plot()
axes.plot(table["t"], path[0], linewidth=0.7)
figure, density = plt.subplots()
density.plot(grid.nodes, grid.density)
