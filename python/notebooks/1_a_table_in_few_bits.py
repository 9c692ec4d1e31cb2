# %% [markdown]
# # A table of sensors in few bits
#
# What does a bound cost, what is in the file, and what comes back?

# %%
import matplotlib.pyplot as plt
import numpy as np
import polars as pl

import fewbits as fb

rng = np.random.default_rng(1)
n = 20_000
seconds = np.arange(n) * 10.0
frame = pl.DataFrame(
    {
        "time": np.datetime64("2026-01-01", "ms") + (seconds * 1000).astype("int64"),
        "temperature": np.round(20 + 3 * np.sin(seconds / 13_700) + np.cumsum(0.01 * rng.standard_normal(n)), 2),
        "humidity": np.where(rng.random(n) < 0.01, np.nan, np.round(45 + 5 * np.cos(seconds / 9_000), 1)),
        "door": (rng.random(n) < 0.001).cumsum() % 2,
    }
)

# %% [markdown]
# Bits per sample of each column, at several bounds.

# %%
plan = pl.DataFrame(fb.plan(frame, time="time"))
print(plan.pivot(on="column", index="share", values="bits"))

# %%
size = fb.write(frame, "room.fewb", time="time", bounds={"temperature": "±0.05", "humidity": "1%"})
print(f"{size} bytes instead of {8 * n * frame.width}")
assert fb.verify(frame, "room.fewb", time="time")["holds"]

# %% [markdown]
# A query reads the columns and the time that it needs.

# %%
recording = fb.open("room.fewb")
print(recording.rows, recording.bounds)
day = pl.DataFrame(recording.select(["temperature"], start="2026-01-02", end="2026-01-03"))
original = frame.filter(pl.col("time").is_between(day["time"][0], day["time"][-1]))
error = np.abs(day["temperature"].to_numpy() - original["temperature"].to_numpy())
assert error.max() <= 0.05

# %%
figure, axes = plt.subplots()
axes.plot(original["time"], original["temperature"], label="original")
axes.plot(original["time"], day["temperature"], label="from the recording", linewidth=0.7)
axes.legend()
