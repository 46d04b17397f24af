"""The implicit material point method: decks, runs, laws and results.

>>> import mpm
>>> deck = mpm.Deck.load("inputs/footing.yaml", h=0.5)
>>> result = deck.run(progress=False)
>>> result.summary["outcome"]
'completed'
"""

from mpm import testing
from mpm._converge import Convergence, GridRun, converge
from mpm._convert import convert
from mpm._deck import Deck
from mpm._errors import DeckError, Diagnostic, MpmError, ResultsError, SolveError, UsageError
from mpm._laws import BuiltInLaw, Law
from mpm._mpm import VERSION as __version__
from mpm._run import Frame, Points, Result, Run, Step, Table, read
from mpm._study import Member, Study, sweep
from mpm._tools import BodyPair, Contacts, Tool, ToolPart

__all__ = [
    "BodyPair",
    "BuiltInLaw",
    "Contacts",
    "Convergence",
    "Deck",
    "DeckError",
    "Diagnostic",
    "Frame",
    "GridRun",
    "Law",
    "Member",
    "MpmError",
    "Points",
    "Result",
    "ResultsError",
    "Run",
    "SolveError",
    "Step",
    "Study",
    "Table",
    "Tool",
    "ToolPart",
    "UsageError",
    "__version__",
    "converge",
    "convert",
    "read",
    "sweep",
    "testing",
]
