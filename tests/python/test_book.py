"""The pages of `docs` and the README: what they show is run, and where they point to exists.

A block of a page is run as it stands, in a folder of the page's own. A comment on the line before it may say:

    <!-- file: NAME -->             the block is the content of this file
    <!-- file: NAME, with OTHER --> the same, and OTHER lies beside the page
    <!-- part of: NAME -->          the block replaces these keys of the deck NAME, and the deck must still be valid
    <!-- quoted from: NAME -->     the block is a part of this file of the sources
    <!-- exits with N -->           the commands end with this code, not with 0
    <!-- output -->                 these texts are part of the lines of the last output, in this order
    <!-- picture: NAME -->          the block writes this picture, which the page shows
    <!-- not run: REASON -->        what cannot be run in a test
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted([*DOCS.rglob("*.md"), ROOT / "README.md"])
# Pages of messages have tests of their own; long studies of the verification are run by hand.
NOT_RUN = ("errors", "verification", "decisions")
# The blocks of these pages build on each other; test_python_page.py runs them.
PYTHON_PAGES = (DOCS / "python.md", DOCS / "how-to" / "python.md")
BLOCK = re.compile(r"(?:<!-- (?P<note>[^>]*?) -->\n)?```(?P<language>\w*)\n(?P<text>.*?)```", re.S)
RUNNABLE = [
    page
    for page in PAGES
    if page.parent.name not in NOT_RUN and page not in PYTHON_PAGES and BLOCK.search(page.read_text())
]


def name(page):
    return str(page.relative_to(ROOT))


# Their analyses take minutes; tests/python/test_construction.py runs the decks of the page of the footing, and the other
# pages show the same commands.
LONG = {DOCS / "how-to" / page for page in ("footing.md", "cone.md", "slope.md")}


class Reader:
    """Does what a page says; the folder holds the decks of the sources."""

    def __init__(self, page, program, folder):
        self.page, self.folder, self.decks, self.output = page, folder, {}, ""
        programs = folder / ".bin"
        programs.mkdir()
        (programs / "mpm").symlink_to(program)
        (folder / "inputs").symlink_to(ROOT / "inputs")
        self.environment = dict(os.environ, PATH=f"{programs}:{os.environ['PATH']}", PYVISTA_OFF_SCREEN="true")

    def run(self, command, expected=0):
        process = subprocess.run(
            command, cwd=self.folder, env=self.environment, capture_output=True, text=True, timeout=300
        )
        self.output = process.stdout + process.stderr
        assert process.returncode == expected, f"{command}\n{self.output}"

    def block(self, language, text, note):
        kind, _, value = note.partition(": ")
        if kind == "not run":
            assert value
        elif kind == "file":
            file, _, other = value.partition(", with ")
            if other:
                shutil.copy(self.page.parent / other, self.folder)
            (self.folder / file).write_text(text)
            beside = self.page.parent / file
            assert not beside.exists() or beside.read_text() == text, f"{beside} differs from the page"
            if language == "yaml":
                self.decks[file] = yaml.safe_load(text)
                self.run(["mpm", "check", file])
        elif kind == "part of":
            changed = self.folder / f"part_of_{value}"
            changed.write_text(yaml.safe_dump(self.decks[value] | yaml.safe_load(text)))
            self.run(["mpm", "check", changed.name])
        elif kind == "quoted from":
            assert text in (ROOT / value).read_text(), f"{value} has other text"
        elif kind == "output":
            rest = self.output
            for line in filter(None, map(str.strip, text.splitlines())):
                assert line in rest, f"{line!r} is not in\n{rest}"
                rest = rest.split(line, 1)[1]
        elif language == "sh":
            code = int(note.removeprefix("exits with ")) if note.startswith("exits with ") else 0
            text = text.replace("cargo run --release --", "mpm")
            self.run(["bash", "-euo", "pipefail", "-c", text], code)
        elif language == "python":
            self.run([sys.executable, "-c", text])
            if kind == "picture":
                assert (self.folder / value).stat().st_size > 1000 and f"images/{value})" in self.page.read_text()
        elif language == "rust":
            assert "fn main()" in text, "the doc tests of the library run what is a program"
        elif language == "json":
            json.loads(text)
        else:
            assert language == "text" and not note, f"a block of {self.page.name} is not run: {note!r}\n{text}"


@pytest.mark.parametrize(
    "page", [pytest.param(page, marks=[pytest.mark.long] * (page in LONG)) for page in RUNNABLE], ids=name
)
def test_what_a_page_shows_works(page, program, tmp_path):
    reader = Reader(page, program, tmp_path)
    for match in BLOCK.finditer(page.read_text()):
        reader.block(match["language"], match["text"], match["note"] or "")


def anchor(heading):
    """Name of a heading in links, as GitHub and mdBook make it."""
    text = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
    return re.sub(r"[^\w\- ]", "", text).replace(" ", "-")


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_of_a_page_lead_somewhere(page):
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.S)
    text = re.sub(r"`[^`\n]*`", "", text)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, place = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), target
        if place and file.suffix == ".md":
            headings = re.findall(r"^#+ (.*)$", file.read_text(), re.M)
            assert place in map(anchor, headings), target


def test_the_book_has_every_page():
    summary = DOCS / "SUMMARY.md"
    listed = set(re.findall(r"\]\(([^)]+\.md)\)", summary.read_text()))
    pages = {str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md")} - {"SUMMARY.md"}
    assert listed == pages


def test_every_decision_has_a_status():
    """It stands under the title, and what is superseded names a later decision."""
    for page in sorted((DOCS / "decisions").glob("0*.md")):
        title, blank, status, *_ = page.read_text().split("\n")
        assert title.startswith("# ") and not blank, page.name
        assert re.match(r"\*\*Status\.\*\* (Accepted\.|Withdrawn: |(Accepted; s|S)uperseded by \[\d+\])", status), page.name
        for number, file in re.findall(r"\[(\d+)\]\((\d+)-", status):
            assert int(number) == int(file) > int(page.name[:4]), page.name
