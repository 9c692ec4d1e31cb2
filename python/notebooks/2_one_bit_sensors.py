# %% [markdown]
# # Sensors that send one bit
#
# Four sensors measure a level. How much is lost if each sends one bit instead of a number, or nothing at all unless it is surprised?

# %%
import numpy as np
import polars as pl

import fewbits as fb

model = fb.Model.reverting(mean=20.0, time_constant=600.0, variance=4.0)
t = np.cumsum(np.random.default_rng(1).uniform(5, 15, 800))
truth = model.simulate(t, start=20.0, seed=2)[:, 0]
noise = np.random.default_rng(3).standard_normal((800, 4))
table = pl.DataFrame({"t": t, **{f"s{i}": truth + noise[:, i] for i in range(4)}})

# %%
def run(send):
    centre = fb.FusionCentre(model, mean=20.0, deviation=2.0)
    for i in range(4):
        centre.join(f"s{i}", noise=1.0, send=send)
    return centre.run(table, time="t")


rows = []
for send in ["bit", "word:2", "word:3", "silent:1.0", "silent:2.0", "value"]:
    found = run(send)
    error = found["x0"] - truth
    inside = np.mean(np.abs(error) <= 1.96 * found["x0_sd"])
    rows.append((send, float(np.sqrt(np.mean(error**2))), found["bits"].sum() / (4 * len(t)), float(inside)))
summary = pl.DataFrame(rows, schema=["send", "rmse", "bits", "inside"], orient="row")
print(summary)
by_name = dict(zip(summary["send"], summary["rmse"]))
assert by_name["value"] < by_name["word:3"] < by_name["bit"] < 1.5 * by_name["value"]

# %% [markdown]
# The band is honest: it holds the truth in about 95 % of the instants, whatever is sent.

# %%
assert summary["inside"].min() > 0.88

# %%
axes = run("bit").plot()
axes.plot(t, truth, label="truth", linewidth=0.7)
axes.legend()
