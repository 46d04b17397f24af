"""Files import each other in one direction: no circles, and nothing from a higher layer, not even its words. The solver is
compiled in its layer."""

import collections
import json
import pathlib
import re
import shutil
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
CRATES = {
    "mpm_core": ROOT / "crates/core/src/lib.rs",
    "mpm_files": ROOT / "crates/files/src/lib.rs",
    "mpm_foreign": ROOT / "crates/foreign/src/lib.rs",
    "mpm_deck": ROOT / "crates/deck/src/lib.rs",
    "mpm_report": ROOT / "crates/report/src/lib.rs",
    "mpm_petsc": ROOT / "crates/petsc/src/lib.rs",
    "mpm": ROOT / "src/lib.rs",
    "program": ROOT / "src/main.rs",
    "mpm_python": ROOT / "python/src/lib.rs",
}
# Crates that are built on request, whose libraries may be missing or stale.
ON_REQUEST = {"mpm_petsc", "mpm_python"}
# From the lowest layer to the highest; a module of the core may use those before it, as a crate may.
LAYERS = """
    counted input_file tensor formula memory timing ranks grid region tool material element_test linear points basis kinematics domain stress surface model step dofs assembly terms
    equilibrium quality solver
""".split()
USE = re.compile(r"(?:^|\n)[ \t]*(pub(?:\([^)]*\))?[ \t]+)?use\s+([^;]+);")
MODULE = re.compile(r"(?:^|\n)[ \t]*(#\[cfg\(test\)\]\s*)?(?:pub(?:\([^)]*\))?\s+)?mod\s+(\w+);")
IN_LINE = re.compile(r"(?<![\w:$.])([a-z_]\w*(?:::\w+)+)")


def code(path):
    """The text of a file without comments and without the unit tests at its end."""
    text = re.sub(r"//[^\n]*", "", path.read_text())
    return re.split(r"#\[cfg\(test\)\]\s*(?:#\[[^\]]*\]\s*)*mod \w+ \{", text)[0]


def paths_of(tree):
    """The paths that the tree of a `use` declaration stands for."""
    tree = re.sub(r"\s+as\s+\w+$", "", tree.strip())
    group = re.fullmatch(r"([\w:]*?)(?:::)?\{(.*)\}", tree, re.S)
    if not group:
        return [tree]
    parts, depth = [""], 0
    for c in group[2]:
        depth += (c == "{") - (c == "}")
        if c == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += c
    inner = [path for part in parts if part.strip() for path in paths_of(part)]
    return [group[1] if path == "self" else f"{group[1]}::{path}".lstrip(":") for path in inner]


class Sources:
    """The files of all crates by their module paths, and what each of them imports."""

    def __init__(self, entries):
        self.files, self.imports, self.exports = {}, {}, {}
        for crate, entry in entries.items():
            self._add((crate,), entry, entry.parent)
        for module, path in self.files.items():
            text = code(path)
            self.imports[module] = IN_LINE.findall(USE.sub("\n", text))
            for public, tree in USE.findall(text):
                for used in paths_of(tree):
                    if public:
                        self.exports[*module, used.split("::")[-1]] = (module, used)
                    else:
                        self.imports[module].append(used)

    def _add(self, module, path, folder):
        self.files[module] = path
        for is_test, name in MODULE.findall(code(path)):
            for file in (folder / f"{name}.rs", folder / name / "mod.rs"):
                if file.exists() and not is_test:
                    self._add((*module, name), file, folder / name)

    def owner(self, module, used, depth=0):
        """The module in which the thing is defined that a path names where it stands in a module."""
        first, *rest = used.split("::")
        if first == "crate":
            here = module[:1]
        elif first == "self":
            here = module
        elif first == "super":
            here = module[:-1]
            while rest and rest[0] == "super":
                here, rest = here[:-1], rest[1:]
        elif (first,) in self.files:
            here = (first,)
        elif (*module, first) in self.files:
            here, rest = module, [first, *rest]
        else:
            return None
        while rest and (*here, rest[0]) in self.files:
            here, rest = (*here, rest[0]), rest[1:]
        export = self.exports.get((*here, rest[0])) if rest else None
        return (export and depth < 9 and self.owner(*export, depth + 1)) or here

    def arrows(self):
        """For each module those that it imports from."""
        found = collections.defaultdict(set)
        for module, used in self.imports.items():
            owners = {self.owner(module, path) for path in used}
            found[module] = {owner for owner in owners if owner and owner != module}
        return found


def circles(arrows):
    """Groups of more than one module that can be reached from each other."""
    def reachable(start):
        seen, stack = set(), [start]
        while stack:
            for next_ in arrows.get(stack.pop(), ()):
                if next_ not in seen:
                    seen.add(next_)
                    stack.append(next_)
        return seen

    reach = {module: reachable(module) for module in arrows}
    groups = {frozenset({b for b in reach[a] if a in reach.get(b, ())}) for a in arrows if a in reach[a]}
    return sorted(sorted("::".join(module) for module in group) for group in groups)


def between_rooms(arrows):
    """The arrows between modules that share a parent, each with all that it contains."""
    found = collections.defaultdict(set)
    for module, used in arrows.items():
        for other in used:
            pairs = zip(module, other)
            shared = next((k for k, (a, b) in enumerate(pairs) if a != b), None)
            if shared:
                found[module[:shared + 1]].add(other[:shared + 1])
    return found


@pytest.fixture(scope="module")
def sources():
    return Sources(CRATES)


def test_no_files_import_each_other_in_a_circle(sources):
    assert len(sources.files) > 250, "all files are looked at"
    assert circles(sources.arrows()) == []


def test_no_rooms_of_the_core_import_each_other_in_a_circle(sources):
    core = {module: used for module, used in sources.arrows().items() if module[0] == "mpm_core"}
    assert circles(between_rooms(core)) == []


def test_nothing_is_imported_from_a_higher_layer(sources):
    folders = {module[1] for module in sources.files if module[0] == "mpm_core" and len(module) > 1}
    assert folders == set(LAYERS), "every folder of the core has its layer"
    order = {("mpm_core", layer): rank for rank, layer in enumerate(LAYERS)}
    crates = {crate: rank for rank, crate in enumerate(CRATES)}
    upwards = []
    for module, used in sources.arrows().items():
        for other in used:
            if module[0] != other[0]:
                is_up = crates[module[0]] < crates[other[0]]
            else:
                a, b = order.get(module[:2]), order.get(other[:2])
                is_up = a is not None and b is not None and a < b
            if is_up:
                upwards.append(f"{'::'.join(module)} -> {'::'.join(other)}")
    assert upwards == []


def test_circles_and_arrows_upwards_are_found(tmp_path):
    (tmp_path / "lib.rs").write_text("mod a;\nmod b;\npub use a::Alpha;\n")
    (tmp_path / "a.rs").write_text("use crate::b::{self, Beta};\npub struct Alpha;\n")
    (tmp_path / "b.rs").write_text("// use crate::nothing;\npub struct Beta;\nfn f(_: super::Alpha) {}\n")
    (tmp_path / "c.rs").write_text("not part of it")
    found = Sources({"crate_of_test": tmp_path / "lib.rs"})
    assert circles(found.arrows()) == [["crate_of_test::a", "crate_of_test::b"]]
    # A file of one room that uses another room, whose root uses the first room.
    (tmp_path / "b").mkdir()
    (tmp_path / "a.rs").write_text("use crate::b::inner::Inner;\npub struct Alpha;\n")
    (tmp_path / "b.rs").write_text("pub mod inner;\npub struct Beta;\nfn f(_: super::Alpha) {}\n")
    (tmp_path / "b/inner.rs").write_text("pub struct Inner;\n")
    found = Sources({"crate_of_test": tmp_path / "lib.rs"})
    assert circles(found.arrows()) == []
    assert circles(between_rooms(found.arrows())) == [["crate_of_test::a", "crate_of_test::b"]]
    (tmp_path / "b.rs").write_text("pub struct Beta;\n#[cfg(test)]\nmod tests {\n    use super::Alpha;\n}\n")
    assert circles(Sources({"crate_of_test": tmp_path / "lib.rs"}).arrows()) == []


# Large functions of the core in mangled symbols; what they contain is not searched for, as it may be inlined into them.
FUNCTIONS = {"attempt", "newton_step", "balancing_forces", "renew", "numbered", "free_parts"}
FUNCTION = re.compile(r"8mpm_core\S*?\d(" + "|".join(FUNCTIONS) + r")(?:17h|E|B|$)", re.M)


@pytest.mark.skipif(shutil.which("nm") is None, reason="nm is not installed")
def test_large_functions_are_compiled_in_the_core_alone(program):
    found = {}
    for crate in CRATES.keys() - ON_REQUEST:
        builds = sorted((program.parent / "deps").glob(f"lib{crate}-*.rlib"), key=lambda path: path.stat().st_mtime)
        if builds:
            process = subprocess.run(["nm", builds[-1]], capture_output=True, text=True, timeout=300)
            assert process.returncode == 0, process.stderr
            defined = "\n".join(line for line in process.stdout.splitlines() if re.search(r" [tTwW] ", line))
            assert f"{len(crate)}{crate}" in defined, f"{builds[-1]} shows no function of its own"
            found[crate] = set(FUNCTION.findall(defined))
    if not {"mpm_core", "mpm"} <= found.keys():
        pytest.skip("the program under test has no libraries beside it")
    assert found.pop("mpm_core") == FUNCTIONS
    assert not any(found.values()), found


def keys_of_decks():
    """The keys that a deck can have."""
    def keys(part):
        if isinstance(part, dict):
            yield from part.get("properties", ())
        for inner in part.values() if isinstance(part, dict) else part if isinstance(part, list) else ():
            yield from keys(inner)

    return set(keys(json.loads((ROOT / "schema/deck.schema.json").read_text())))


def words_of_decks(text):
    """The strings in the code of a file that speak of decks: by their name, by a page of the program, by a key in backquotes."""
    keys, found = keys_of_decks(), []
    text = text.replace("'\"'", "")  # a character, not the end of a string
    for literal in re.findall(r'"((?:[^"\\]|\\.)*)"', text, re.S):
        quoted = re.findall(r"`([^`]*)`", literal)
        names_key = any(re.match(r"\w+", part) and re.match(r"\w+", part)[0] in keys for part in quoted)
        holds_keys = any(re.search(r"\b\w+: |\{\{|\{\w+, ", part) for part in quoted)
        if names_key or holds_keys or re.search(r"\bdecks?\b|mpm explain", literal):
            found.append(literal)
    return found


def test_the_core_does_not_speak_of_decks(sources):
    # Intermediate values of formulas stand under `where` in every input that the parser reads; two words of STL files are
    # also words of decks.
    allowed = {"use fewer parentheses, or define intermediate values under `where`", "`normal`", "`outer`"}
    files = [path for module, path in sources.files.items() if module[0] == "mpm_core"]
    found = {f"{path.relative_to(ROOT)}: {words}" for path in files for words in words_of_decks(code(path))
             if words not in allowed}
    assert found == set()


def test_words_of_decks_are_found():
    for words in ("use `method: gimp`", "a larger `steps: {count}`", "`solver: {{tolerance: {t}}}`", "see `mpm explain W004`",
                  "the `smallest` step", "this deck", "{name: axis} of `{name: axis, fix: [x]}`"):
        assert words_of_decks(f'f("{words}")') == [words]
    for words in ("body `{name}`: {} points", "a power is written `^`", "`{name}` takes {n}", "decked"):
        assert words_of_decks(f'f("{words}")') == []
