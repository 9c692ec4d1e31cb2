"""The blocks of the pages about Python, and the notebooks, run from top to bottom."""

import importlib.util
import pathlib
import re

import pytest

HERE = pathlib.Path(__file__).resolve().parent
DOCS = HERE.parents[1] / "docs"
PAGES = [DOCS / "python.md", *sorted((DOCS / "python").glob("*.md"))]
NOTEBOOKS = sorted((HERE.parent / "notebooks").glob("*.py"))
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def needed(block: str) -> list[str]:
    found = re.match(r"# needs (.+)\n", block)
    return found[1].split(", ") if found else []


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text, names = page.read_text(), {"__name__": page.stem}
    missing = []
    for block in BLOCK.finditer(text):
        absent = [name for name in needed(block[1]) if importlib.util.find_spec(name) is None]
        if absent:
            missing += absent
            continue
        # Errors point at the lines of the page.
        lines = "\n" * (text[: block.start()].count("\n") + 1)
        exec(compile(lines + block[1], page, "exec"), names)
    assert BLOCK.search(text)
    if missing:
        pytest.skip(f"without {', '.join(sorted(set(missing)))}")


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook(notebook, tmp_path, monkeypatch):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    exec(compile(notebook.read_text(), notebook, "exec"), {"__name__": "__main__"})


def test_there_are_pages_and_notebooks():
    assert len(PAGES) >= 6 and len(NOTEBOOKS) >= 4
