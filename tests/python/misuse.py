"""Calls the package wrongly, at random; a program for test_package_misuse.py.

Arguments are a seed and a number of calls. Each call is printed as a line of JSON before it is made, and its outcome
after it, so that the last line tells what crashed.
"""

import copy
import faulthandler
import json
import math
import pickle
import random
import sys
import threading

import mpm
import numpy as np

from package import column, load

#: Longest time of one call, [s]; then the stacks are printed and the process ends.
LIMIT = 60


def itself():
    found = []
    found.append({"more": found})
    return found


def bad(chance):
    """Something that is seldom of use, and how it was made."""
    makers = [
        lambda: None, lambda: True, lambda: -1, lambda: 0, lambda: 1, lambda: 10**30, lambda: 10**400, lambda: 2**63,
        lambda: 1e300, lambda: -0.5, lambda: 5e-324, lambda: math.nan, lambda: math.inf, lambda: 1j,
        lambda: "", lambda: "word", lambda: "a\0b", lambda: "\udcff", lambda: "../" * 50, lambda: "${1/0}",
        lambda: "x" * 10**5,
        lambda: b"bytes", lambda: bytearray(3), lambda: [], lambda: {}, lambda: (), lambda: set(), lambda: [None],
        lambda: [[1, 2], [3]], lambda: {1: 2}, lambda: {"a": {"b": object()}}, itself, object, lambda: object,
        lambda: (lambda *of: None), lambda: (lambda: 1 / 0), lambda: (k for k in range(3)), lambda: ...,
        lambda: np.zeros(0), lambda: np.zeros((2, 6)), lambda: np.full((3, 6), np.nan), lambda: np.float64(3),
        lambda: np.array(["a", None], object), lambda: np.zeros((1, 6), complex), lambda: np.int64(-4),
        lambda: np.zeros((2, 3, 4, 5)),
        lambda: np.datetime64("2020-01-01"), lambda: np.bool_(True), lambda: np.zeros((6, 4)).T, lambda: column(),
        lambda: mpm.Deck({}), lambda: ended(), lambda: closed(), lambda: column().run(), lambda: ended().points,
        lambda: ended().history, lambda: mpm.BuiltInLaw("hencky", young=1, poisson=0), lambda: mpm.Deck, lambda: mpm,
    ]  # fmt: skip
    return chance.choice(makers)()


def ended():
    run = column(steps={"count": 1}).start(threads=1)
    list(run)
    return run


def closed():
    run = column().start(threads=1)
    next(run)
    run.close()
    return run


def places(value, path=()):
    """The places of all values in a deck."""
    yield path
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, entry in entries:
        yield from places(entry, (*path, key))


def spoilt(chance):
    """A deck with something bad in it."""
    deck = column()
    *path, key = chance.choice([place for place in places(deck.data) if place])
    holder = deck.data
    for name in path:
        holder = holder[name]
    holder[key] = bad(chance)
    return deck


def steps_of(run):
    with run:
        for _ in range(3):
            next(run, None)
    return run.points.position, run.history


class Law(mpm.BuiltInLaw):
    """A law whose parts are replaced by something bad."""

    def __init__(self, chance):
        super().__init__("von-mises", young=1e6, poisson=0.3, deviatoric_yield_stress=1e4)
        self.chance, self.at = chance, chance.randrange(12)
        parts = ["state", "measure", "symmetric", "energy", "plastic_work", "update"]
        name = chance.choice([*parts, "none", "none", "none"])
        if name != "none":
            setattr(self, name, bad(chance))

    def update(self, strain, history):
        response = list(super().update(strain, history))
        self.at -= 1
        if self.at < 0:
            kind = self.chance.randrange(4)
            if kind == 0:
                response[self.chance.randrange(4)] = bad(self.chance)
            elif kind == 1:
                response[self.chance.randrange(4)] = response[self.chance.randrange(4)][:-1]
            elif kind == 2:
                return bad(self.chance)
            else:
                errors = [ValueError, KeyError, SystemExit, KeyboardInterrupt, MemoryError]
                raise self.chance.choice(errors)("at the law")
        return tuple(response)


def callback(chance):
    def tell(*of):
        if chance.random() < 0.2:
            raise chance.choice([ValueError, StopIteration, GeneratorExit, SystemExit])("at the callback")
        return bad(chance)

    return tell


def changed(chance):
    run = column().start(threads=1)
    next(run)
    run.deck.update(spoilt(chance))
    try:
        run.change()
    finally:
        assert len(steps_of(run)[0]) == 8  # it goes on
    return run


def in_threads(chance):
    """Several threads use one run; at most one at a time can."""
    run, errors = load("beam", steps=20).start(threads=2), []

    def use():
        for _ in range(20):
            try:
                chance.choice([lambda: next(run), lambda: run.points.position, run.stop, run.close, run.change])()
            except (mpm.UsageError, StopIteration) as error:
                errors.append(error)

    threads = [threading.Thread(target=use) for _ in range(4)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    return len(errors)


def interleaved(chance):
    runs = [column().start(threads=1) for _ in range(3)]
    for _ in range(20):
        chance.choice([next, lambda run: next(run, None), lambda run: run.points, mpm.Run.stop, mpm.Run.close])(
            chance.choice(runs)
        )


def twice(chance):
    """Two runs in one directory."""
    first = column().start(out="same", threads=1)
    try:
        return column().start(out="same", threads=1)
    finally:
        first.stop()


CALLS = {
    "Deck": lambda c: mpm.Deck(bad(c)).check(),
    "Deck in directory": lambda c: mpm.Deck(column().data, directory=bad(c)).check(),
    "Deck.load": lambda c: mpm.Deck.load(bad(c)),
    "Deck.load with parameter": lambda c: load("beam", **{c.choice(["h", "steps", "none"]): bad(c)}).check(),
    "with_parameters": lambda c: load("beam").with_parameters(**{c.choice(["h", "n", "method"]): bad(c)}).check(),
    "setitem": lambda c: column().__setitem__(bad(c), bad(c)),
    "check of a spoilt deck": lambda c: spoilt(c).check(),
    "text of a spoilt deck": lambda c: (repr(spoilt(c)), spoilt(c).text),
    "save": lambda c: column().save(bad(c)),
    "run of a spoilt deck": lambda c: steps_of(spoilt(c).start(threads=1)),
    "threads": lambda c: column().start(threads=bad(c)).close(),
    "out": lambda c: steps_of(column().start(threads=1, out=bad(c))),
    "laws": lambda c: steps_of(column().start(threads=1, laws=bad(c))),
    "law": lambda c: steps_of(column().start(threads=1, laws={c.choice(["clay", "clay", "iron"]): bad(c)})),
    "spoilt law": lambda c: steps_of(column().start(threads=1, laws={"clay": Law(c)})),
    "check of a spoilt law": lambda c: mpm.testing.check_material(Law(c)),
    "on_iteration": lambda c: steps_of(column().start(on_iteration=bad(c))),
    "spoilt callback": lambda c: steps_of(column().start(on_iteration=callback(c))),
    "progress": lambda c: column().run(threads=1, progress=bad(c) is None),
    "points": lambda c: ended().points[bad(c)],
    "points in": lambda c: bad(c) in ended().points,
    "tables": lambda c: c.choice([ended().history, ended().quality, ended().convergence])[bad(c)],
    "closed": lambda c: getattr(closed(), c.choice(["points", "history", "step", "notes", "ended", "deck", "quality"])),
    "points of a closed run": lambda c: closed().points.position,
    "call of a closed run": lambda c: getattr(closed(), c.choice(["stop", "close", "change", "result", "__next__"]))(),
    "call of an ended run": lambda c: getattr(ended(), c.choice(["stop", "close", "change", "result", "__next__"]))(),
    "result too early": lambda c: column().start(threads=1).result(),
    "change": changed,
    "read": lambda c: mpm.read(bad(c)),
    "sweep of": lambda c: mpm.sweep(bad(c), {"h": [1]}, processes=1),
    "sweep over": lambda c: mpm.sweep(load("beam", steps=1), bad(c), processes=1),
    "sweep over values": lambda c: mpm.sweep(load("beam", steps=1), {"h": bad(c)}, processes=1),
    "sweep over a value": lambda c: mpm.sweep(load("beam", steps=1), {"h": [bad(c)]}, processes=1, out="study"),
    "sweep with": lambda c: mpm.sweep(
        load("beam", steps=1), {"h": [0.5]}, **{c.choice(["processes", "threads", "out"]): bad(c)}
    ),
    "BuiltInLaw": lambda c: mpm.BuiltInLaw(c.choice(["hencky", bad(c)]), young=bad(c), poisson=0.3),
    "BuiltInLaw.update": lambda c: mpm.BuiltInLaw("hencky", young=1, poisson=0).update(bad(c), bad(c)),
    "BuiltInLaw.energy": lambda c: mpm.BuiltInLaw("hencky", young=1, poisson=0).energy(bad(c)),
    "BuiltInLaw.plastic_work": lambda c: mpm.BuiltInLaw("hencky", young=1, poisson=0).plastic_work(bad(c)),
    "check_material": lambda c: mpm.testing.check_material(bad(c)),
    "check_material up to": lambda c: mpm.testing.check_material(
        mpm.BuiltInLaw("hencky", young=1, poisson=0), largest=bad(c)
    ),
    "pickle": lambda c: c.choice([pickle.dumps, copy.copy, copy.deepcopy])(c.choice([ended, closed])()),
    "pickle of the session": lambda c: pickle.dumps(ended()._session),
    "constructors": lambda c: c.choice([mpm.Run, mpm.Step, mpm.Result, mpm.Frame, mpm.Points, mpm.Table])(bad(c)),
    "errors": lambda c: c.choice([mpm.DeckError, mpm.SolveError, mpm.ResultsError, mpm.UsageError])(bad(c)),
    "threads at once": in_threads,
    "interleaved": interleaved,
    "twice": twice,
}

#: What a wrong call may raise; those of Python for what its own types refuse.
SENSIBLE = (mpm.MpmError, TypeError, ValueError, KeyError, AttributeError, OSError, StopIteration)


def main(seed, count):
    chance = random.Random(seed)
    for number in range(count):
        # All kinds of calls come by turns, whatever the number of processes.
        name = list(CALLS)[(seed * count + number) % len(CALLS)]
        print(json.dumps({"call": name}), flush=True)
        faulthandler.dump_traceback_later(LIMIT, exit=True)
        found = {"call": name, "raised": None}
        try:
            CALLS[name](chance)
        except SENSIBLE as error:
            found.update(raised=type(error).__name__, message=str(error), is_sensible=True)
            found["is_own"] = isinstance(error, mpm.MpmError)
        except BaseException as error:  # noqa: BLE001
            # Those of the laws and callbacks above are handed on.
            planted = str(error) in ("at the law", "at the callback")
            found.update(raised=type(error).__name__, message=str(error), is_sensible=planted)
        faulthandler.cancel_dump_traceback_later()
        print(json.dumps(found), flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
