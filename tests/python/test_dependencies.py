"""What the program is made of: licences and sources of its dependencies, as `deny.toml` allows them.

`cargo deny check` does the same and more; this needs nothing but cargo, and no network.
"""

import json
import re
import subprocess
import tomllib

import pytest

from conftest import ROOT


@pytest.fixture(scope="module")
def packages():
    command = ["cargo", "metadata", "--format-version=1", "--offline", "--locked"]
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if process.returncode != 0:
        pytest.skip(f"cargo cannot tell without network: {process.stderr.strip()}")
    return json.loads(process.stdout)["packages"]


@pytest.fixture(scope="module")
def rules():
    return tomllib.loads((ROOT / "deny.toml").read_text())


def allows(allowed, expression):
    """Whether a licence expression is met by licences that are allowed."""
    words = re.findall(r"[()]|[^\s()]+", expression.replace("/", " OR "))

    def alternatives(at):
        met, at = conjunction(at)
        while at < len(words) and words[at] == "OR":
            other, at = conjunction(at + 1)
            met = met or other
        return met, at

    def conjunction(at):
        met, at = licence(at)
        while at < len(words) and words[at] == "AND":
            other, at = licence(at + 1)
            met = met and other
        return met, at

    def licence(at):
        if words[at] == "(":
            met, at = alternatives(at + 1)
            return met, at + 1
        name, at = words[at], at + 1
        if at < len(words) and words[at] == "WITH":
            name, at = f"{name} WITH {words[at + 1]}", at + 2
        return name in allowed, at

    return alternatives(0)[0]


def test_licence_expressions():
    for expression, met in [
        ("MIT", True),
        ("GPL-3.0", False),
        ("GPL-3.0 OR MIT", True),
        ("MIT/Apache-2.0", True),
        ("MIT AND GPL-3.0", False),
        ("(MIT OR GPL-3.0) AND Zlib", True),
        ("Apache-2.0 WITH LLVM-exception", False),
    ]:
        assert allows({"MIT", "Zlib"}, expression) == met, expression


def test_licences_are_allowed(packages, rules):
    allowed = set(rules["licenses"]["allow"])
    wrong = [(p["name"], p["license"]) for p in packages if not p["license"] or not allows(allowed, p["license"])]
    assert not wrong
    named = " ".join(p["license"] for p in packages)
    assert all(licence in named for licence in allowed), "what nothing needs is not allowed"


def test_sources_are_known(packages, rules):
    known = {f"registry+{url}" for url in rules["sources"]["allow-registry"]}
    assert {p["source"] for p in packages} - known == {None}, "only the program itself is here"
    own = {p["name"] for p in packages if p["source"] is None}
    assert own == {"mpm", "mpm-core", "mpm-deck", "mpm-files", "mpm-foreign", "mpm-petsc", "mpm-python", "mpm-report", "own-law"}


def test_unsafe_code_is_where_other_languages_are_called():
    """Laws of shared libraries are called in one file, MPI and PETSc in one crate; the other unsafe code are
    the allocator of the program, which notes what was refused, and that of a test, which counts."""
    found = {str(path.relative_to(ROOT)) for folder in ("src", "crates", "benches", "examples", "tests")
             for path in (ROOT / folder).rglob("*.rs") if re.search(r"\bunsafe\s*(\{|fn|impl)", path.read_text())}
    elsewhere = {path for path in found if not path.startswith("crates/petsc/src/")}
    assert elsewhere == {"crates/foreign/src/interface.rs", "src/program/heap.rs", "tests/allocations.rs"}
