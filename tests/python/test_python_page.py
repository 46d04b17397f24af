"""The pages on the Python package: the reference is up to date, and its examples and those of the how-to page are true."""

import contextlib
import doctest
import importlib
import inspect
import io
import pkgutil
import sys

import mpm
import mpm.testing
import numpy as np
import pytest

from conftest import ROOT
from test_book import BLOCK, DOCS, Reader

sys.path.insert(0, str(DOCS))
import make_python_page  # noqa: E402

# The native module has neither Python sources nor docstrings with examples.
MODULES = ["mpm", *(f"mpm.{found.name}" for found in pkgutil.iter_modules(mpm.__path__) if found.name != "_mpm")]


@pytest.fixture
def beside_inputs(tmp_path, monkeypatch):
    """A working directory that holds the decks of the sources."""
    (tmp_path / "inputs").symlink_to(ROOT / "inputs")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_reference_is_what_the_docstrings_say():
    message = "docs/python.md is stale: run `python docs/make_python_page.py`"
    assert (DOCS / "python.md").read_text() == make_python_page.page(), message


def test_the_reference_has_everything_public():
    shown = {thing for things in make_python_page.PARTS.values() for thing in things}
    names = set(mpm.__all__) - {"__version__", "testing"}
    public = {getattr(mpm, name) for name in names} | {getattr(mpm.testing, name) for name in mpm.testing.__all__}
    assert shown == public


def test_the_reference_has_every_member_and_argument():
    page = (DOCS / "python.md").read_text()
    for thing in (thing for things in make_python_page.PARTS.values() for thing in things):
        text = page.split(f"\n### {thing.__name__}\n", 1)[1].split("\n### ", 1)[0]
        members = dict(make_python_page.own_members(thing)) if inspect.isclass(thing) else {}
        for name, member in members.items():
            is_property = isinstance(member, property)
            assert (f"- `{name}` (" if is_property else f"#### {thing.__name__}.{name}\n") in text
        functions = [thing] if not members else [m for m in members.values() if not isinstance(m, property)]
        for function in functions:
            function = getattr(function, "__func__", function)
            if inspect.isclass(function):
                continue
            for argument in inspect.signature(function).parameters.keys() - {"self", "cls"}:
                # The arguments of energies of a built-in law are in the sentence about them.
                if function.__qualname__.startswith("BuiltInLaw."):
                    continue
                assert f"- `{argument}`: " in text, f"{function.__qualname__}: {argument}"


def test_a_docstring_without_text_is_found():
    class Silent:
        pass

    with pytest.raises(SystemExit, match="no docstring"):
        make_python_page.class_text(Silent)


@pytest.mark.parametrize("name", MODULES)
def test_examples_in_docstrings(name, beside_inputs):
    module = importlib.import_module(name)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    report = io.StringIO()
    finder = doctest.DocTestFinder(exclude_empty=True)
    # The options are those with which NumPy begins, whatever a test before has set.
    with np.printoptions(precision=8, threshold=1000, linewidth=75, suppress=False, sign="-", floatmode="maxprec"):
        for test in finder.find(module, extraglobs={"mpm": mpm, "np": np}):
            runner.run(test, out=report.write)
    assert not runner.failures, report.getvalue()


def test_most_of_the_package_has_examples():
    finder = doctest.DocTestFinder(exclude_empty=True)
    found = [test for name in MODULES for test in finder.find(importlib.import_module(name)) if test.examples]
    assert len(found) >= 20


class Session(Reader):
    """A page whose blocks of Python are those of one session of the interpreter."""

    def __init__(self, page, program, folder):
        super().__init__(page, program, folder)
        self.names = {"__name__": "__main__"}

    def block(self, language, text, note):
        if language != "python" or note.startswith("not run"):
            super().block(language, text, note)
            return
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(text, f"{self.page.name}: {text.splitlines()[0]}", "exec"), self.names)
        self.output = printed.getvalue()


def test_the_how_to_page_works_from_top_to_bottom(program, tmp_path, monkeypatch):
    page = DOCS / "how-to" / "python.md"
    monkeypatch.chdir(tmp_path)
    session = Session(page, program, tmp_path)
    blocks = list(BLOCK.finditer(page.read_text()))
    assert sum(match["language"] == "python" for match in blocks) >= 8
    for match in blocks:
        session.block(match["language"], match["text"], match["note"] or "")
