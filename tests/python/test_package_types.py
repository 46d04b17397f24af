"""Types of the package, the stub of its native module, and the examples in its docstrings."""

import ast
import doctest
import importlib
import inspect
import os
import pkgutil
import subprocess
import sys

import pytest

from conftest import ROOT
from package import mpm


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("mypy")


def run_mypy(cache, module, *arguments):
    pytest.importorskip("mypy")
    command = [sys.executable, "-m", module, *arguments]
    environment = {**os.environ, "MYPY_CACHE_DIR": str(cache)}
    return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=600)


def test_the_package_and_its_use_are_well_typed(cache, tmp_path):
    files = ["python/mpm", "tests/python/typed_example.py", "tests/python/laws_in_python.py"]
    process = run_mypy(cache, "mypy", "--strict", *files)
    assert process.returncode == 0, process.stdout + process.stderr
    # It can fail.
    (tmp_path / "wrong.py").write_text("import mpm\nx: int = mpm.Deck.load(3).run().history['a']\n")
    process = run_mypy(cache, "mypy", "--strict", "python/mpm", tmp_path / "wrong.py")
    assert process.returncode == 1 and process.stdout.count("wrong.py:2: error") == 2, process.stdout


def signatures(nodes):
    """Names of the parameters of functions by their names, apart from `self` and `cls`."""
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    found = {}
    for node in functions:
        of = node.args
        names = [argument.arg for argument in (*of.posonlyargs, *of.args, *of.kwonlyargs)]
        found[node.name] = [name for name in names if name not in ("self", "cls")]
    return found


def runtime_signatures(members):
    found = {}
    for name, member in members.items():
        if callable(member) and not isinstance(member, type) and not name.startswith("__"):
            found[name] = [of for of in inspect.signature(member).parameters if of != "self"]
    return found


def test_the_stub_has_what_the_native_module_has():
    from mpm import _mpm

    tree = ast.parse((ROOT / "python/mpm/_mpm.pyi").read_text())
    public = {name: getattr(_mpm, name) for name in _mpm.__all__}
    assert signatures(tree.body) == runtime_signatures(public)
    classes = {node.name: node.body for node in tree.body if isinstance(node, ast.ClassDef)}
    native = {name: thing for name, thing in public.items() if isinstance(thing, type)}
    assert {name for name in classes if not name.startswith("_")} == set(native)
    for name, thing in native.items():
        stated = signatures(classes[name])
        assert stated.pop("__new__") == list(inspect.signature(thing).parameters)
        properties = {part for part, of in vars(thing).items() if inspect.isgetsetdescriptor(of)}
        assert {part: stated[part] for part in stated if part not in properties} == runtime_signatures(vars(thing))
        assert properties <= set(stated)


def test_the_typed_example_runs(tmp_path):
    typed_example = importlib.import_module("typed_example")
    iterations, stress = typed_example.stepped(ROOT / "inputs/beam.yaml")
    assert len(iterations) == 4 and stress.shape[1] == 6
    deflection = typed_example.written(ROOT / "inputs/beam.yaml", tmp_path / "out")
    assert deflection < -5 and len(typed_example.studied(ROOT / "inputs/beam.yaml")) == 2
    assert typed_example.checked()


@pytest.mark.parametrize("name", sorted(module.name for module in pkgutil.iter_modules(mpm.__path__)))
def test_examples_in_docstrings(monkeypatch, name):
    if name in ("__main__", "_mpm"):
        pytest.skip("no examples")
    monkeypatch.chdir(ROOT)
    module = importlib.import_module(f"mpm.{name}")
    failed, tried = doctest.testmod(module, extraglobs={"mpm": mpm}, optionflags=doctest.ELLIPSIS)
    assert failed == 0
    if name in ("_deck", "_run", "_laws", "_study", "testing"):
        assert tried > 0


def test_the_example_of_the_package(monkeypatch):
    monkeypatch.chdir(ROOT)
    assert doctest.testmod(mpm).failed == 0 < doctest.testmod(mpm).attempted


def test_everything_public_has_a_docstring():
    for name in mpm.__all__:
        thing = getattr(mpm, name)
        if name.startswith("__"):
            continue
        assert thing.__doc__, name
        for part in vars(thing) if isinstance(thing, type) else ():
            member = vars(thing)[part]
            if not part.startswith("_") and (callable(member) or isinstance(member, (property, classmethod))):
                assert member.__doc__, f"{name}.{part}"
