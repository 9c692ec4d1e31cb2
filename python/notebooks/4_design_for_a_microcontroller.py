# %% [markdown]
# # Quantizers for a microcontroller
#
# Two thermometers of different noise send two bits each. Where should the cells be, and which cells share a word? The search decides both, and the
# result is a table in C.

# %%
import numpy as np
import polars as pl

import fewbits as fb

design = fb.design(prior=(20.0, 4.0), noise=[1.0, 1.5], bits=[2, 2], flips=0.01)
print(pl.DataFrame(design.cells))
print(f"mean squared error {design.value:.4f}, no design is below {design.bound:.4f}")

# %% [markdown]
# The error that was promised, by simulation.

# %%
rng = np.random.default_rng(1)
truth = 20 + 4 * rng.standard_normal(200_000)
samples = truth[:, None] + np.array([1.0, 1.5]) * rng.standard_normal((200_000, 2))
words = design.encode(samples)
flips = rng.random((200_000, 2, 2)) < 0.01
received = words ^ (flips[..., 0] + 2 * flips[..., 1])
errors = (design.decode(received) - truth) ** 2
standard_error = errors.std() / np.sqrt(len(errors))
print(f"simulated {errors.mean():.4f} +- {standard_error:.4f}")
assert abs(errors.mean() - design.value) < 4 * standard_error

# %%
header = design.c_header("thermometer")
print(header[:500])
