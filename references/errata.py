#!/usr/bin/env python3
"""Compares docs/errata.md with the claims that cite it: prints what does not fit, exits 1 if anything does not.

An id is cited as `erratum binary-6` or `errata mi-8`; the sign-bit filter's ids are E1 to E13. A row's figures are the figure ids in
backticks anywhere in the row.
"""

import glob
import os
import re
import sys

import common

ROOT = os.path.join(common.HERE, "..")
SYSTEMS = "|".join(common.SYSTEMS)
ID = re.compile(rf"\b(E\d{{1,2}}|(?:{SYSTEMS})-\d{{1,2}})\b")
CITED = re.compile(rf"errat(?:um|a)[ (`]+((?:(?:E|(?:{SYSTEMS})-)\d{{1,2}}[`,; and]*)+)")


def read(pattern):
    return {os.path.relpath(p, ROOT): open(p, encoding="utf-8").read() for p in glob.glob(os.path.join(ROOT, pattern), recursive=True)}


def rows():
    """id -> text of the row."""
    found = {}
    for line in read("docs/errata.md")["docs/errata.md"].splitlines():
        start = re.match(rf"\| `?((?:E|(?:{SYSTEMS})-)\d+)`? \|", line)
        if start:
            found[start[1]] = line
    return found


def main():
    errata, problems = rows(), []
    sources = read("crates/experiments/src/**/*.rs")
    figures = set(re.findall(rf'"((?:{SYSTEMS}|network|real)-(?:fig|table)?[A-Za-z0-9-]+)"', "\n".join(sources.values())))
    cited = {}
    for path, text in sources.items():
        for one in ID.findall(text):
            if one[0] != "E" or "/dymbo/" in path:
                cited.setdefault(one, set()).add(path)
    for path, text in {**read("crates/**/*.rs"), **read("docs/*.md"), **read("README.md")}.items():
        for match in CITED.finditer(re.sub(r"\\\n\s*(?:///?!?)?", "", text)):
            for one in ID.findall(match[1]):
                if one not in errata:
                    problems.append(f"{path} cites {one}, which docs/errata.md does not have")
    for one, row in errata.items():
        named = [n for n in re.findall(r"`([a-z]+-[A-Za-z0-9-]+)`", row) if re.match(rf"({SYSTEMS})-", n) and not ID.fullmatch(n)]
        for figure in sorted({n for n in named if n not in figures}):
            problems.append(f"{one} names `{figure}`, which is no figure")
        if named and one not in cited:
            problems.append(f"{one} names {', '.join(sorted(set(named)))}, but no claim cites {one}")
        if not named and one in cited:
            problems.append(f"{one} names no figure, but {', '.join(sorted(cited[one]))} cites it")
    without = [one for one, row in errata.items() if one not in cited and not re.search(r"`[^`]+`", row.split("|", 2)[2])]
    print("\n".join(problems))
    print(f"{len(errata)} errata, {len(cited)} cited by claims, {len(problems)} inconsistencies; no figure, test or item named: {', '.join(without)}")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
