#!/usr/bin/env python3
"""Recomputes the reference values of a system and compares each with the committed one.

    python3 references/run.py cfwmd          one system (or several, or `all`); exits 1 if a value is off
    python3 references/run.py cfwmd fig1     only keys that contain `fig1`
    python3 references/run.py --list         how many values are recomputed, printed in a publication, frozen
    python3 references/run.py --frozen       writes references/frozen.csv, the values that no program here recomputes
"""

import csv
import glob
import importlib
import os
import sys
import time

import common

FROZEN = os.path.join(common.HERE, "frozen.csv")


def program(system):
    """The module of a system; files `<system>_<part>.py` add to its list."""
    module = importlib.import_module(system)
    for part in sorted(glob.glob(os.path.join(common.HERE, system + "_*.py"))):
        importlib.import_module(os.path.basename(part)[:-3])
    return module


def kind(row, module):
    """`recomputed`, `printed` (a publication's own number: nothing to recompute), or `frozen`."""
    if row["source"] != "independent":
        return "printed"
    return "recomputed" if module.RECIPES.find(row["key"]) else "frozen"


def is_within(row, value, error):
    """Within the committed tolerance and three combined standard errors."""
    known, known_error = float(row["value"]), float(row["standard_error"] or 0)
    allowed = float(row["tolerance"]) + 3 * (known_error**2 + error**2) ** 0.5
    return abs(value - known) <= allowed * (1 + 1e-6) + 1e-14 * abs(known)


def check(system, wanted):
    """Prints the table; returns the number of values that are off."""
    module, off, count, start = program(system), [], 0, time.time()
    print(f"{'key':<62}{'value':>17}{'recomputed':>17}{'st. error':>11}{'difference':>12}  within")
    for row in common.committed(system):
        if kind(row, module) != "recomputed" or wanted not in row["key"]:
            continue
        answer = module.RECIPES.find(row["key"])()
        value, error = answer if isinstance(answer, tuple) else (answer, 0.0)
        value, error, known = float(value), float(error), float(row["value"])
        good = is_within(row, value, error)
        count += 1
        off += [] if good else [row["key"]]
        shown = f"{error:.2e}" if error else ""
        verdict = "yes" if good else "NO"
        print(f"{row['key']:<62}{known:>17.10g}{value:>17.10g}{shown:>11}{value - known:>12.1e}  {verdict}", flush=True)
    print(f"{system}: {count - len(off)} of {count} recomputed values agree, {time.time() - start:.0f} s")
    for key in off:
        print(f"off: {key}")
    return len(off)


def kinds():
    """(system, key, kind) of every committed value."""
    for system in common.SYSTEMS:
        module = program(system)
        for row in common.committed(system):
            yield system, row["key"], kind(row, module)


def summary():
    """Prints the counts; returns 1 if frozen.csv does not name exactly the values without a program."""
    rows = list(kinds())
    print(f"{'system':<12}{'recomputed':>12}{'printed':>10}{'frozen':>10}")
    for system in common.SYSTEMS + ("all",):
        counts = [sum(k == which and system in (s, "all") for s, _, k in rows) for which in ("recomputed", "printed", "frozen")]
        print(f"{system:<12}{counts[0]:>12}{counts[1]:>10}{counts[2]:>10}")
    with open(FROZEN, newline="") as file:
        listed = {(r["key"], r["kind"]) for r in csv.DictReader(file)}
    differs = listed ^ {(key, which) for _, key, which in rows if which != "recomputed"}
    for key, which in sorted(differs):
        print(f"frozen.csv is out of date: {key} ({which})")
    return 1 if differs else 0


def write_frozen():
    with open(FROZEN, "w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["key", "kind"])
        out.writerows((key, which) for _, key, which in kinds() if which != "recomputed")
    return 0


def main(arguments):
    if arguments == ["--list"]:
        return summary()
    if arguments == ["--frozen"]:
        return write_frozen()
    systems = [a for a in arguments if a in common.SYSTEMS] or (common.SYSTEMS if "all" in arguments else ())
    others = [a for a in arguments if a not in common.SYSTEMS and a != "all"]
    if not systems or len(others) > 1 or any(a.startswith("-") for a in others):
        print(__doc__)
        return 2
    wanted = others[0] if others else ""
    return 1 if sum(check(system, wanted) for system in systems) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
