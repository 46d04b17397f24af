"""Rigid tools of every shape turn in soft bodies, and move at the same time, in random analyses. In every written step no
point lies inside a tool, no place in contact and no corner of a domain lies deep inside one, and no point has come through
one. Poses follow from the deck and depths from formulas of this file, not from the program.

An analysis ends at the end of its motion, or with exit code 1 and a diagnosis; what it has written must satisfy the
conditions all the same. The normal run has one analysis of each shape.

`TURNING=200 ... pytest tests/python/test_turning_tools.py -s` runs so many, beginning with the seed `TURNING_SEED` (0), and
prints the largest depths; this takes about seven minutes. `TURNING_DECKS=DIRECTORY` keeps the decks of analyses that violate
a condition.
"""

import json
import math
import os
import random
import shutil
import subprocess

import numpy as np
import pytest
import pyvista

from conftest import ROOT
from results import Results

# No analysis may take longer, [s]; all are small.
MAX_TIME = 300
# Largest depths below the surface of a tool, relative to a cell. A place in contact: what docs/how-to/tools.md states, beyond the
# overlap that the update of boxes has left and history.csv states.
MAX_PLACE = 1e-3
# A point. Its domain reaches about a quarter of a cell around it, so that it is well outside unless a tool enters the domain
# between its corners.
MAX_POINT = 1e-2
# A corner of a CPDI2 domain. Contact holds the corners themselves, and MAX_PLACE judges how well; a deeper one has not
# been seen by contact.
MAX_CORNER = 1e-2
# A corner of a GIMP box. Contact holds the corners of the box at the start of a step, as the grid moves them; the box at its
# end has the size of what they have become, but is aligned with the axes, and a place keeps this overlap at first. Boxes of half a
# cell, whose half diagonal is 0.35 before they stretch, have reached 0.40; their points stay outside.
MAX_BOX = 0.45
# The overlap that the update of a box has left in a place in contact. CPDI2 domains have none, since their corners are places.
MAX_ALLOWED = {"gimp": MAX_BOX, "mpm": MAX_BOX, "cpdi2": 0.0}
# The straight way of a point from outside to outside, other than around a tip of a tool; in space, where tools are thick,
# around their edges as well.
MAX_WAY = 0.05
MAX_WAY_IN_SPACE = 0.25
# Distance from a tip within which points go around it, relative to a cell.
AROUND_TIPS = 0.75
# Distance of the surface in the files from that of this file.
MAX_SURFACE = 1e-9


def unit(angle):
    return np.array([math.cos(angle), math.sin(angle)])


def rotation(vector):
    """The rotation about a vector by its length, [rad] (Rodrigues)."""
    angle = np.linalg.norm(vector)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.asarray(vector) / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * (k @ k)


# Signed distances, [length]: negative inside.


def to_segments(x, starts, ends):
    """Distance of each position in the plane from the nearest of some segments."""
    edges, away = ends - starts, x[:, None] - starts
    t = np.clip(np.einsum("nki,ki->nk", away, edges) / np.einsum("ki,ki->k", edges, edges), 0, 1)
    return np.linalg.norm(away - t[..., None] * edges, axis=2).min(axis=1)


def to_polygon(x, corners, is_surface=None):
    """Signed distance from a polygon; edges that are no surface only close it."""
    starts, ends = corners, np.roll(corners, -1, axis=0)
    is_above = starts[:, 1] > x[:, None, 1]
    crosses = is_above != (ends[:, 1] > x[:, None, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (ends[:, 0] - starts[:, 0]) / (ends[:, 1] - starts[:, 1])
        at = starts[:, 0] + slope * (x[:, None, 1] - starts[:, 1])
    inside = (crosses & (x[:, None, 0] < at)).sum(axis=1) % 2 == 1
    some = slice(None) if is_surface is None else is_surface
    return np.where(inside, -1, 1) * to_segments(x, starts[some], ends[some])


def prism_distance(a, b):
    """Signed distance from a prism over a section at the distance a, with ends at the distance b."""
    return np.hypot(np.maximum(a, 0), np.maximum(b, 0)) + np.minimum(np.maximum(a, b), 0)


class Shape:
    """A shape about the origin: what the deck says of it at a place, its signed distance, positions whose hull contains it,
    regions that contain all that is near it, and tips around which points may go."""

    def __init__(self, deck, distance, hull, grown, tips=()):
        self.deck, self.distance, self.hull, self.grown = deck, distance, np.asarray(hull, dtype=float), grown
        self.tips = np.array(tips, dtype=float).reshape(-1, self.hull.shape[1])


def lists(values):
    return np.asarray(values, dtype=float).tolist()


def around_edges(edges, c, region, disc):
    """Regions around the edges of a polygon or polyline up to a distance c."""
    found = []
    for a, b in edges:
        right = c * np.array([b[1] - a[1], a[0] - b[0]]) / np.linalg.norm(b - a)
        found += [region(np.array([a + right, b + right, b - right, a - right])), disc(a)]
    return [*found, disc(edges[-1][1])]


def half_space():
    """What lies above the origin."""
    deck = lambda at: {"type": "half-space", "point": lists(at), "normal": [0, -1]}
    return Shape(deck, lambda x: -x[:, 1], [[0, 0]], None)


def circle(radius):
    return Shape(
        lambda at: {"type": "circle", "center": lists(at), "radius": radius},
        lambda x: np.linalg.norm(x, axis=1) - radius,
        [radius * unit(math.pi * k / 90) for k in range(180)],
        lambda at, c: [{"type": "circle", "center": lists(at), "radius": radius + c}],
    )


def edges_of(corners):
    return list(zip(corners, np.roll(corners, -1, axis=0)))


def grown_in_plane(at, pairs, c):
    polygon = lambda corners: {"type": "polygon", "vertices": lists(corners + at)}
    disc = lambda x: {"type": "circle", "center": lists(x + at), "radius": c}
    return around_edges(pairs, c, polygon, disc)


def polygon(corners):
    corners = np.array(corners)

    def grown(at, c):
        return [{"type": "polygon", "vertices": lists(corners + at)}, *grown_in_plane(at, edges_of(corners), c)]

    deck = lambda at: {"type": "polygon", "vertices": lists(corners + at)}
    return Shape(deck, lambda x: to_polygon(x, corners), corners, grown, corners)


def rectangle(half):
    half = np.array(half)
    of_polygon = polygon([[-half[0], -half[1]], [half[0], -half[1]], half, [-half[0], half[1]]])
    of_polygon.deck = lambda at: {"type": "box", "min": lists(at - half), "max": lists(at + half)}
    return of_polygon


def star_corners(points, outer, inner):
    return [(inner if k % 2 else outer) * unit(math.pi * k / points + 0.3) for k in range(2 * points)]


def polyline(corners, thickness):
    corners, radius = np.array(corners), 0.5 * thickness
    pairs = list(zip(corners[:-1], corners[1:]))
    return Shape(
        lambda at: {"type": "polyline", "vertices": lists(corners + at), "thickness": thickness},
        lambda x: to_segments(x, corners[:-1], corners[1:]) - radius,
        [corner + radius * unit(math.pi * k / 90) for corner in corners for k in range(180)],
        lambda at, c: grown_in_plane(at, pairs, radius + c),
        corners,
    )


def sphere(radius):
    turned = [rotation([0, a, 0]) @ rotation([0, 0, b]) for a in np.arange(0, 6.3, 0.1) for b in np.arange(0, 6.3, 0.1)]
    return Shape(
        lambda at: {"type": "sphere", "center": lists(at), "radius": radius},
        lambda x: np.linalg.norm(x, axis=1) - radius,
        [1.01 * radius * t[:, 0] for t in turned],
        lambda at, c: [{"type": "sphere", "center": lists(at), "radius": radius + c}],
    )


def brick(half):
    half = np.array(half)

    def distance(x):
        beyond = np.abs(x) - half
        return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)

    def box(at, half):
        return {"type": "box", "min": lists(at - half), "max": lists(at + half)}

    hull = [half * sign for sign in np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T]
    return Shape(lambda at: box(at, half), distance, hull, lambda at, c: [box(at, half + c)])


def revolution(deck, section, axis):
    """A body of revolution about an axis through the origin, with its section (r, h)."""
    section, axis = np.array(section), np.array(axis) / np.linalg.norm(axis)
    is_surface = (section[:, 0] > 0) | (np.roll(section[:, 0], -1) > 0)

    def distance(x):
        h = x @ axis
        r = np.linalg.norm(x - h[:, None] * axis, axis=1)
        return to_polygon(np.column_stack([r, h]), section, is_surface)

    across = np.linalg.svd(axis[None])[2][1:]
    hull = [h * axis + 1.01 * r * (unit(math.pi * k / 30) @ across) for r, h in section for k in range(60)]

    def grown(at, c):
        return [
            {
                "type": "cylinder",
                "start": lists(at + (min(a[1], b[1]) - c) * axis),
                "end": lists(at + (max(a[1], b[1]) + c) * axis),
                "radius": max(a[0], b[0]) + c,
            }
            for a, b in edges_of(section)
            if max(a[0], b[0]) > 0
        ]

    return Shape(deck, distance, hull, grown)


def cylinder(radius, half, axis):
    axis = np.array(axis) / np.linalg.norm(axis)
    ends = lambda at: {"start": lists(at - half * axis), "end": lists(at + half * axis)}
    deck = lambda at: {"type": "cylinder", **ends(at), "radius": radius}
    return revolution(deck, [[0, -half], [radius, -half], [radius, half], [0, half]], axis)


def cone(radii, half, axis):
    axis = np.array(axis) / np.linalg.norm(axis)
    ends = lambda at: {"start": lists(at - half * axis), "end": lists(at + half * axis)}
    deck = lambda at: {"type": "cone", **ends(at), "radii": radii}
    return revolution(deck, [[0, -half], [radii[0], -half], [radii[1], half], [0, half]], axis)


def spun(section, axis):
    deck = lambda at: {"type": "revolution", "start": lists(at), "direction": lists(axis), "section": lists(section)}
    return revolution(deck, section, axis)


def extrusion(corners, axis, half):
    corners, others = np.array(corners), [d for d in range(3) if d != axis]

    def distance(x):
        return prism_distance(to_polygon(x[:, others], corners), np.abs(x[:, axis]) - half)

    def extruded(corners, at, half):
        ends = {"from": float(at[axis] - half), "to": float(at[axis] + half)}
        return {"type": "extrusion", "polygon": lists(corners + at[others]), "axis": "xyz"[axis], **ends}

    def disc(x, at, c):
        start = np.zeros(3)
        start[others] = x
        shift = (half + c) * np.eye(3)[axis]
        return {"type": "cylinder", "start": lists(at + start - shift), "end": lists(at + start + shift), "radius": c}

    def grown(at, c):
        region = lambda corners: extruded(corners, at, half + c)
        return [region(corners), *around_edges(edges_of(corners), c, region, lambda x: disc(x, at, c))]

    hull = np.zeros((2 * len(corners), 3))
    hull[:, others], hull[:, axis] = np.tile(corners, (2, 1)), np.repeat([-half, half], len(corners))
    return Shape(lambda at: extruded(corners, at, half), distance, hull, grown)


def pyramid(scale):
    """tests/data/pyramid.stl about the middle of its height. It is convex; outside, the distance is a lower bound."""
    middle = np.array([2, 2, 1.5])
    corners = scale * (np.array([[1, 1, 0], [3, 1, 0], [3, 3, 0], [1, 3, 0], [2, 2, 3]]) - middle)
    normals = np.array([[0, 0, -1], [0, -3, 1], [3, 0, 1], [0, 3, 1], [-3, 0, 1]])
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    offsets = np.array([normals[0] @ corners[0], *(normals[1:] @ corners[4])])

    def deck(at):
        file = str(ROOT / "tests/data/pyramid.stl")
        return {"type": "stl", "file": file, "scale": scale, "at": lists(at - scale * middle)}

    def grown(at, c):
        low, high = corners.min(axis=0) - c, corners.max(axis=0) + c
        return [{"type": "box", "min": lists(at + low), "max": lists(at + high)}]

    return Shape(deck, lambda x: (x @ normals.T - offsets).max(axis=1), corners, grown)


def shape_of(kind, rng, s):
    """A shape of a kind about the origin, with random proportions; s is about its half size."""
    part = lambda low, high: round(rng.uniform(low, high), 3)
    axis = [part(-1, 1), part(-1, 1), part(0.2, 1)]
    star = lambda points, inner: star_corners(rng.choice(points), s, s * inner)
    return {
        "half-space": half_space,
        "circle": lambda: circle(s * part(0.6, 0.9)),
        "rectangle": lambda: rectangle([s * part(0.2, 0.9), s * part(0.3, 1)]),
        "star": lambda: polygon(star([3, 4, 5], part(0.25, 0.6))),
        "wedge": lambda: polygon([[0, -s], [s * part(0.1, 0.3), s], [-s * part(0.1, 0.3), s]]),
        "blade": lambda: polyline([[0, -s], [0, s]], s * part(0.08, 0.2)),
        "hook": lambda: polyline([[-0.2 * s, -s], [0, 0], [s * part(-0.7, 0.9), s * part(0.4, 0.8)]], s * part(0.08, 0.2)),
        "sphere": lambda: sphere(s * part(0.6, 0.9)),
        "brick": lambda: brick([s * part(0.2, 0.8), s * part(0.3, 0.8), s * part(0.3, 0.8)]),
        "cylinder": lambda: cylinder(s * part(0.3, 0.6), s * part(0.4, 0.8), axis),
        "cone": lambda: cone([rng.choice([0, s * 0.2]), s * part(0.4, 0.8)], s * part(0.4, 0.8), axis),
        "spun": lambda: spun([[0, -s], [s * part(0.3, 0.7), -0.5 * s], [s * 0.3, 0.1 * s], [s * 0.6, s], [0, s]], axis),
        "extrusion": lambda: extrusion(star([3, 4], part(0.4, 0.6)), rng.choice([0, 1, 2]), 0.7 * s),
        "pyramid": lambda: pyramid(0.5 * s),
    }[kind]()


IN_PLANE = ["half-space", "circle", "rectangle", "star", "wedge", "blade", "hook"]
IN_SPACE = ["sphere", "brick", "cylinder", "cone", "spun", "extrusion", "pyramid"]
KINDS = IN_PLANE + IN_SPACE
# Seeds, one for each kind of shape; usual runs try every second one.
SEEDS = [range(0, 14, 2), pytest.param(range(1, 14, 2), marks=pytest.mark.long)]
METHODS = ["gimp", "cpdi2", "mpm"]
INTERFACES = [{}, {"friction": 0.3}, {"friction": "rough"}, {"adhesion": 3e3}]
ELASTIC = {"model": "hencky", "young": 1e6, "poisson": 0.3}


def turned_regions(regions, vector, center):
    """Regions turned about a centre by the length of a vector, [degree]; in the plane by its third component."""
    angle = np.linalg.norm(vector)
    if angle == 0.0:
        return regions
    about = {"angle": vector[2]} if len(center) == 2 else {"angle": angle, "axis": lists(vector / angle)}
    return [{"type": "rotate", **about, "center": lists(center), "shape": region} for region in regions]


class Analysis:
    """A random analysis: its deck, and the pose of its tool at a time."""

    def __init__(self, seed):
        rng = random.Random(f"turning tools {seed}")
        # Shapes follow each other, so that few analyses have many of them.
        self.kind = KINDS[seed % len(KINDS)]
        self.n = n = 2 if self.kind in IN_PLANE else 3
        self.h = h = rng.choice([0.5, 0.4]) if n == 2 else 0.75
        size, height = ([12 * h, 10 * h], 10 * h) if n == 2 else ([5 * h, 5 * h, 4 * h], 4 * h)
        s = round(h * (rng.uniform(2, 3.5) if n == 2 else rng.uniform(1, 1.4)), 3)
        self.shape = shape_of(self.kind, rng, s)
        self.method = rng.choice(METHODS)
        is_bounded = self.kind != "half-space"
        self.place = rng.choice(["hole", "surface"]) if is_bounded else "surface"
        is_plastic = rng.random() < 0.5
        material = ELASTIC
        if is_plastic:
            material = ELASTIC | {"model": "von-mises", "deviatoric_yield_stress": rng.choice([10e3, 30e3, 100e3])}
        draw = lambda low, high: round(rng.uniform(low, high), 3)
        axes = [[0, 0, 1]] if n == 2 else [[0, 0, 1], [1, 0, 0], [0, 1, 0], [1, 1, 1], [1, -2, 0.5]]
        axis = np.array(rng.choice(axes), dtype=float)
        angles = [30, 60, 90] if is_bounded else [5, 10, 15]
        self.turn = rng.choice(angles) * rng.choice([-1, 1]) * axis / np.linalg.norm(axis)
        self.turned = rng.choice([0, draw(-180, 180) if is_bounded else 0]) * np.array(rng.choice(axes), dtype=float)
        # The tool moves by up to a cell while it turns. One that starts at the surface is pressed in before.
        self.shift = np.array([draw(-h, h) for _ in range(n)])
        self.press = 0.0
        at = np.array(size) / 2
        start = rotation(np.radians(self.turned))[:n, :n]
        body = {"type": "box", "min": [0.0] * n, "max": lists(size)}
        points = 2
        if self.place == "hole":
            # Domains of points that lie outside the hole reach into it by up to half their diagonal.
            c = h * (math.sqrt(n) / (2 * points) + rng.choice([0.01, 0.1]))
            body = {"type": "difference", "from": body, "minus": turned_regions(self.shape.grown(at, c), self.turned, at)}
        else:
            at[-1] = height - (self.shape.hull @ start.T)[:, -1].min() + 0.01 * h
            self.press = round(s * rng.uniform(0.3, 1), 3)
            self.shift[-1] = 0.0
        self.at = at
        letters = "xyz"[:n]
        # Pressing takes the first 0.4 of the time, turning the rest.
        late = "max(time - 0.4, 0) / 0.6" if self.press else "time"
        motion = {f"u{letters[d]}": f"{self.shift[d]} * {late}" for d in range(n)}
        if self.press:
            motion[f"u{letters[-1]}"] = f"-{self.press} * min(time / 0.4, 1)"
        turns = [f"{angle} * {late}" for angle in self.turn]
        low, around = np.full(n, -2.0 * s), np.array(size) + 4.0 * s
        low[-1], around[-1] = 0.0, size[-1] + 5 * s + 2 * h
        low, around = np.floor(low / h) * h, np.ceil(around / h) * h + h
        self.deck = {
            "version": 1,
            "title": f"Turning tool {seed}: {self.kind} at a {self.place}, {self.method}",
            "analysis": {"idealisation": "plane-strain" if n == 2 else "solid"},
            "grid": {"type": "structured", "origin": lists(low), "size": lists(around), "spacing": h},
            "materials": {"soft": material},
            "bodies": [
                {
                    "name": "block",
                    "material": "soft",
                    "method": self.method,
                    "points_per_cell": points,
                    "shape": body,
                    **({"strain": "mean-dilatation"} if is_plastic else {}),
                }
            ],
            "boundary_conditions": [{"name": "base", "nodes": {letters[-1]: 0}, "fix": list(letters)}],
            "tools": [
                {
                    "name": "tool",
                    "shape": self.shape.deck(at),
                    "reference": lists(at),
                    "turned": self.turned[2] if n == 2 else lists(self.turned),
                    "rotation": turns[2] if n == 2 else turns,
                    "penalty": 10 if is_plastic else rng.choice([10, 100]),
                    **motion,
                    **rng.choice(INTERFACES),
                }
            ],
            "steps": {"count": rng.choice([5, 10, 20]), "smallest": 0.03},
            "output": {"fields": ["displacement"]},
        }

    def to_tool(self, x, time):
        """Positions in the frame of the tool."""
        late = max(time - 0.4, 0) / 0.6 if self.press else time
        moved = self.at + late * self.shift
        if self.press:
            moved[-1] = self.at[-1] - self.press * min(time / 0.4, 1)
        turned = rotation(np.radians(late * self.turn)) @ rotation(np.radians(self.turned))
        return (x[:, : self.n] - moved) @ turned[: self.n, : self.n]

    def depth(self, x, time):
        """Depth below the surface of the tool, relative to a cell; negative outside."""
        return -self.shape.distance(self.to_tool(x, time)) / self.h


class Fault(Exception):
    """An analysis that ends as none may."""


def run(program, folder, analysis):
    """Runs an analysis; returns how it ended, and its results."""
    deck, out = folder / "deck.yaml", folder / "out"
    shutil.rmtree(out, ignore_errors=True)
    deck.write_text(json.dumps(analysis.deck, indent=1))
    command = [program, "run", deck, "--out", out, "--threads", "1"]
    process = subprocess.run(command, capture_output=True, text=True, timeout=MAX_TIME)
    code, messages = process.returncode, process.stderr
    if "panicked" in messages or code not in (0, 1) or not (out / "summary.json").exists():
        raise Fault(f"exit code {code}: {messages}")
    results = Results(out)
    outcome, diagnosis = results.summary["outcome"], results.summary["diagnosis"]
    if (code, outcome) == (0, "completed"):
        return "completed", results
    if (code, outcome) != (1, "failed") or not diagnosis["advice"] or "diagnosis: " not in messages:
        raise Fault(f"exit code {code}, {outcome}, without a diagnosis: {messages}")
    return diagnosis["kind"], results


def steps_of(results):
    """Time, positions of points in the order of their numbers, and corners of their domains, of each written step."""
    # Standard points have no domains in files.
    domains = dict(results.series("domains")) if (results.directory / "domains.pvd").exists() else {}
    for time, path in results.series("points"):
        points = pyvista.read(path)
        corners = pyvista.read(domains[time]).points if domains else np.empty((0, 3))
        yield time, np.asarray(points.points)[np.argsort(points["point_id"])], np.asarray(corners)


class Ways:
    """The ways of points past a tool: where they were last outside, in the frame of the tool."""

    def __init__(self, analysis):
        self.shape, self.h, self.n, self.outside = analysis.shape, analysis.h, analysis.n, None

    def deepest(self, x):
        """The points are at x: the largest depth, relative to a cell, to which straight ways from outside to outside have
        cut the tool, other than around its tips."""
        if self.outside is None:
            self.outside = x.copy()
        is_out = self.shape.distance(x) >= 0
        before, now, most = self.outside[is_out], x[is_out], -1.0
        for part in np.linspace(0, 1, 21)[1:-1]:
            way = before + part * (now - before)
            depth = -self.shape.distance(way) / self.h
            if len(self.shape.tips):
                away = np.linalg.norm(way[:, None] - self.shape.tips, axis=2).min(axis=1)
                depth = depth[away > AROUND_TIPS * self.h]
            most = max(most, depth.max(initial=-1.0))
        self.outside[is_out] = now
        return most


def depths(analysis, results):
    """The largest depths in all written steps, relative to a cell: of places in contact, beyond the overlap that they may
    keep; of this overlap; of points, of corners of domains, and of ways of points through the tool; and how far the surface in
    the files is from that of this file."""
    found = dict.fromkeys(["touch", "point", "corner", "way"], -1.0) | {"surface": 0.0}
    history = results.history
    allowed = dict(zip(history["time"], history["tool_allowed_overlap"] / analysis.h))
    found["allowed"] = max(allowed.values(), default=0.0)
    ways = Ways(analysis)
    for time, x, corners in steps_of(results):
        found["point"] = max(found["point"], analysis.depth(x, time).max())
        found["corner"] = max(found["corner"], analysis.depth(corners, time).max(initial=-1.0))
        found["way"] = max(found["way"], ways.deepest(analysis.to_tool(x, time)))
    for time, path in results.series("contacts"):
        touching = np.asarray(pyvista.read(path).points)
        deepest = analysis.depth(touching, time).max(initial=-1.0)
        found["touch"] = max(found["touch"], deepest - allowed.get(time, 0.0))
    for time, path in results.series("tools"):
        surface = np.asarray(pyvista.read(path).points)
        found["surface"] = max(found["surface"], np.abs(analysis.depth(surface, time)).max())
    return found


def bounds_of(analysis):
    """The largest depths that may be, relative to a cell."""
    is_box = analysis.method == "gimp"
    way = MAX_WAY if analysis.n == 2 else MAX_WAY_IN_SPACE
    most = {"touch": MAX_PLACE, "point": MAX_POINT, "corner": MAX_BOX if is_box else MAX_CORNER}
    return most | {"allowed": MAX_ALLOWED[analysis.method], "way": way, "surface": MAX_SURFACE}


def study(program, folder, seeds):
    """Runs the analyses with these seeds; returns what is wrong with them, one line each, and how many have had contact."""
    outcomes, most, faults, touched = {}, {}, [], 0
    for seed in seeds:
        analysis = Analysis(seed)
        title = analysis.deck["title"]
        try:
            outcome, results = run(program, folder, analysis)
        except (Fault, subprocess.TimeoutExpired) as fault:
            faults.append(f"{title}: {fault}")
            continue
        outcomes[outcome] = outcomes.get(outcome, 0) + 1
        found, bounds = depths(analysis, results), bounds_of(analysis)
        touched += found["touch"] > -1
        of_method = most.setdefault(analysis.method, dict.fromkeys(found, -1.0))
        of_method.update({name: max(of_method[name], depth) for name, depth in found.items()})
        wrong = [f"{name} {depth:.2e}" for name, depth in found.items() if depth > bounds[name]]
        if wrong:
            faults.append(f"{title}, {outcome}: {', '.join(wrong)}")
            if "TURNING_DECKS" in os.environ:
                shutil.copy(folder / "deck.yaml", os.path.join(os.environ["TURNING_DECKS"], f"{seed}.yaml"))
    print(f"{len(seeds)} analyses, {touched} with contact: {outcomes}; {len(faults)} with faults")
    for method, of_method in most.items():
        print(f"{method}: largest depths", ", ".join(f"{name} {depth:.2e}" for name, depth in of_method.items()))
    return faults, touched


@pytest.mark.parametrize("seeds", SEEDS, ids=["even", "odd"])
def test_turning_tools_stay_outside_of_bodies(program, tmp_path, seeds):
    first, count = int(os.environ.get("TURNING_SEED", "0")), int(os.environ.get("TURNING", "0"))
    seeds = range(first, first + count) if count else seeds
    faults, touched = study(program, tmp_path, seeds)
    assert not faults, f"{len(faults)} faults:\n" + "\n".join(faults)
    assert touched >= 0.8 * len(seeds)
