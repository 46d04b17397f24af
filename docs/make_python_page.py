"""Writes `python.md`, the reference of the Python package, from its signatures and docstrings.

    python docs/make_python_page.py

Needs the package `mpm`. `tests/python/test_python_page.py` compares the page with what this script writes.
"""

import inspect
import re
import textwrap
from pathlib import Path

import mpm
import mpm.testing

PAGE = Path(__file__).resolve().parent / "python.md"
#: The things of the package by headings, in the order of the page.
PARTS = {
    "Decks": [mpm.Deck, mpm.Diagnostic],
    "Runs": [mpm.Run, mpm.Step, mpm.Tool, mpm.ToolPart, mpm.BodyPair, mpm.Contacts, mpm.Points, mpm.Table],
    "Results": [mpm.Result, mpm.Frame, mpm.read],
    "Meshes": [mpm.convert],
    "Laws": [mpm.Law, mpm.BuiltInLaw, mpm.testing.check_material, mpm.testing.Finding],
    "Studies": [mpm.sweep, mpm.Study, mpm.Member, mpm.converge, mpm.Convergence, mpm.GridRun],
    "Errors": [mpm.MpmError, mpm.DeckError, mpm.SolveError, mpm.ResultsError, mpm.UsageError],
}
#: Longest line of text.
WIDTH = 120
SECTION = re.compile(r"^(Args|Attributes|Returns|Raises|Example):$", re.M)
TITLES = {"Args": "Arguments", "Attributes": "Attributes", "Raises": "Errors"}

INTRODUCTION = """\
# The Python package

Generated from the signatures and docstrings of the package; do not edit. [Analyse with Python](how-to/python.md) shows
how its parts work together.

Examples begin with `import mpm` and `import numpy as np`, and run beside the directory `inputs` of the sources. In
signatures `Array` is a NumPy array of floats, `StrPath` a path as text or `os.PathLike`, and `Value` a number, a truth
value or text. Shapes are in parentheses, units in brackets, [-] for none; units are those of the deck.
"""


def text_of(docstring):
    """Markdown of a docstring without sections: roles become links to headings."""

    def role(match):
        kind, name = match[1], match[2]
        owner, _, member = name.removeprefix("mpm.").removeprefix("testing.").rpartition(".")
        label = f"{name}()" if kind in ("meth", "func") else name
        target = owner if kind == "attr" else f"{owner}.{member}" if owner else member
        return f"[`{label}`](#{anchor(target)})"

    found = re.sub(r":(class|meth|func|attr):`([\w.]+)`", role, docstring)
    found = re.sub(r"``docs/([\w/-]+\.md)``", r"[`docs/\1`](\1)", found)
    found = re.sub(r"``(.+?)``", r"`\1`", found)
    return "\n\n".join(map(filled, found.strip().split("\n\n"))) if found.strip() else ""


def filled(paragraph):
    """A paragraph, or the items of a list, in lines of the greatest width."""
    if not paragraph.startswith("- "):
        return textwrap.fill(paragraph, WIDTH, break_long_words=False, break_on_hyphens=False)
    items = re.split(r"\n(?=- )", paragraph)
    wrap = {"width": WIDTH, "subsequent_indent": "  ", "break_long_words": False, "break_on_hyphens": False}
    return "\n".join(textwrap.fill(re.sub(r"\n\s+", " ", item), **wrap) for item in items)


def anchor(heading):
    """Name of a heading in links, as GitHub and mdBook make it."""
    return re.sub(r"[^\w\- ]", "", heading).lower().replace(" ", "-")


def entries(section):
    """Names and texts of a section whose entries are `name: text`, continued by indented lines."""
    found = re.split(r"\n(?=\S)", textwrap.dedent(section).strip())
    return [(name, " ".join(rest.split())) for name, _, rest in (entry.partition(": ") for entry in found)]


def examples(section):
    """Markdown of an example: paragraphs, and blocks with prompts."""
    blocks = textwrap.dedent(section).strip().split("\n\n")
    return "\n\n".join(f"```python\n{block}\n```" if block.startswith(">>>") else text_of(block) for block in blocks)


def resolved(text, owner):
    """Roles that name a member without its class get the class."""
    members = {name for name, _ in inspect.getmembers(owner)} if owner else set()

    def full(match):
        return f":{match[1]}:`{owner.__name__}.{match[2]}`" if match[2] in members else match[0]

    return re.sub(r":(meth|attr):`(\w+)`", full, text)


def description(thing, owner=None, types=None):
    """Markdown of a docstring with its sections."""
    text = inspect.cleandoc(thing.__doc__ or "")
    if not text:
        raise SystemExit(f"{thing} has no docstring")
    text = resolved(text, owner)
    parts = SECTION.split(text)
    found = [text_of(parts[0])]
    for title, section in zip(parts[1::2], parts[2::2]):
        if title == "Example":
            found.append(examples(section))
            continue
        if title == "Returns":
            returned = " ".join(section.split())
            found.append(text_of(f"**Returns** {returned[0].lower()}{returned[1:]}"))
            continue
        lines = [f"**{TITLES[title]}**", ""]
        for name, meaning in entries(section):
            kind = (types or {}).get(name) if title == "Attributes" else None
            label = f"[`{name}`](#{anchor(name)})" if title == "Raises" else f"`{name}`"
            lines.append(text_of(f"- {label}{f' (``{kind}``)' if kind else ''}: {meaning}"))
        found.append("\n".join(lines))
    return "\n\n".join(found)


def annotation(value):
    """A type as text."""
    text = value if isinstance(value, str) else getattr(value, "__name__", str(value))
    return text.replace("npt.NDArray[np.float64]", "Array")


def signature(name, function, *, prefix="", is_method=False):
    """A block with the signature of a function, on one line or with one argument per line."""
    arguments, star = [], False
    described = inspect.signature(function)
    for parameter in list(described.parameters.values())[is_method:]:
        stars = {parameter.VAR_KEYWORD: "**", parameter.VAR_POSITIONAL: "*"}.get(parameter.kind, "")
        if parameter.kind == parameter.KEYWORD_ONLY and not star:
            arguments.append("*")
            star = True
        kind = "" if parameter.annotation is parameter.empty else f": {annotation(parameter.annotation)}"
        default = "" if parameter.default is parameter.empty else f" = {parameter.default!r}"
        arguments.append(f"{stars}{parameter.name}{kind}{default}")
    returned = described.return_annotation
    arrow = "" if returned is described.empty or returned in ("None", None) else f" -> {annotation(returned)}"
    line = f"{prefix}{name}({', '.join(arguments)}){arrow}"
    if len(line) > WIDTH - 20:
        line = f"{prefix}{name}(\n" + "".join(f"    {argument},\n" for argument in arguments) + f"){arrow}"
    return f"```python\n{line}\n```"


def own_members(owner):
    """Public properties and methods that a class defines itself, in the order of its source."""
    for name, member in vars(owner).items():
        if not name.startswith("_") and (callable(member) or isinstance(member, (property, classmethod))):
            yield name, member


def bases(owner):
    """The base classes that say something to users."""
    named = [base.__name__ for base in owner.__bases__ if base is not object]
    shown = [name for name in named if name not in ("Protocol", "Generic")]
    return f"({', '.join(shown)})" if shown else ""


def module(thing):
    return "mpm.testing" if thing.__module__ == "mpm.testing" else "mpm"


def class_text(owner):
    """Markdown of a class and its members."""
    fields = {name: annotation(kind) for name, kind in inspect.get_annotations(owner).items() if name[0] != "_"}
    is_record = hasattr(owner, "__dataclass_fields__")
    is_made = owner in (mpm.Deck, mpm.BuiltInLaw)
    heading = f"class {module(owner)}.{owner.__name__}"
    if is_made:
        head = signature(f"{module(owner)}.{owner.__name__}", owner.__init__, prefix="class ", is_method=True)
    else:
        head = f"```python\n{heading}{bases(owner)}\n```"
    found = [f"### {owner.__name__}", head, description(owner, owner, fields if is_record else None)]
    properties, methods = [], []
    for name, member in own_members(owner):
        if isinstance(member, property):
            kind = inspect.signature(member.fget).return_annotation
            text = resolved(inspect.cleandoc(member.__doc__), owner)
            text = re.sub(r"\n\n+", " ", text)
            properties.append(text_of(f"- `{name}` (``{annotation(kind)}``): {' '.join(text.split())}"))
        else:
            is_static = isinstance(member, classmethod)
            function = member.__func__ if is_static else member
            head = signature(f"{owner.__name__}.{name}", function, prefix="", is_method=True)
            methods += [f"#### {owner.__name__}.{name}", head, description(function, owner)]
    if properties:
        found.append("\n".join(["**Properties**", "", *properties]))
    return "\n\n".join(found + methods)


def function_text(function):
    head = signature(f"{module(function)}.{function.__name__}", function)
    return "\n\n".join([f"### {function.__name__}", head, description(function)])


def page():
    """The page."""
    found = [INTRODUCTION.strip()]
    for heading, things in PARTS.items():
        found.append(f"## {heading}")
        found += [class_text(thing) if inspect.isclass(thing) else function_text(thing) for thing in things]
    return "\n\n".join(found) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page())
    print(PAGE)
