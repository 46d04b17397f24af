"""What a mesh file may hold beside the cells that a body uses."""

import pytest

DECK = """version: 1
grid: {type: gmsh, file: mesh.msh}
materials: {rubber: {model: neo-hookean, young: 1e6, poisson: 0.3, density: 1000}}
bodies: [{name: b, material: rubber, shape: {type: box, min: [0, 0], max: [4, 4]}, method: mpm, points_per_cell: 2}]
boundary_conditions: [{name: base, nodes: {y: 0}, fix: [x, y]}]
loads: [{name: w, type: gravity, acceleration: [1, -1]}]
steps: {count: 2}
output: {every: 0, probes: [{name: p, body: b, nearest: [3.7, 3.7]}]}
"""


def write(folder, nodes, cells, deck=DECK):
    """Writes a mesh of quadrilaterals in format 2.2, and a deck that uses it."""
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", len(nodes)]
    lines += [f"{number} {x!r} {y!r} 0" for number, (x, y) in nodes.items()]
    lines += ["$EndNodes", "$Elements", len(cells)]
    lines += [f"{number} 3 2 0 1 {' '.join(map(str, cell))}" for number, cell in enumerate(cells, 1)]
    (folder / "mesh.msh").write_text("\n".join(map(str, [*lines, "$EndElements", ""])))
    (folder / "deck.yaml").write_text(deck)
    return folder / "deck.yaml"


def block():
    nodes = {1 + i + 9 * j: (float(i), float(j)) for j in range(9) for i in range(9)}
    return nodes, [(a, a + 1, a + 10, a + 9) for j in range(8) for i in range(8) for a in [1 + i + 9 * j]]


@pytest.mark.parametrize("idealisation", ["plane-strain", "axisymmetric"])
def test_other_cells_have_no_effect_whatever_their_size_and_place_in_the_file(mpm, tmp_path, idealisation):
    """A coordinate selects by the size of the cells around a node, not by that of the first cell of the file."""
    deck = DECK.replace("materials:", f"analysis: {{idealisation: {idealisation}}}\nmaterials:")
    if idealisation == "axisymmetric":
        deck = deck.replace("[1, -1]", "[0, -1]").replace("loads:", "  - {name: axis, nodes: {x: 0}, fix: [x]}\nloads:")
        deck = deck.replace("[{name: base, nodes: {y: 0}, fix: [x, y]}]", "\n  - {name: base, nodes: {y: 0}, fix: [y]}")

    def crest(name, side=None, first=True):
        nodes, cells = block()
        if side:
            corners = [(100.0, 0.0), (100 + side, 0.0), (100 + side, side), (100.0, side)]
            nodes |= dict(zip(range(1001, 1005), corners))
            cells = [(1001, 1002, 1003, 1004), *cells] if first else [*cells, (1001, 1002, 1003, 1004)]
        folder = tmp_path / name
        folder.mkdir()
        process = mpm("run", write(folder, nodes, cells, deck), "--out", folder / "out")
        assert process.returncode == 0, process.stderr
        rows = (folder / "out" / "history.csv").read_text().splitlines()
        columns = rows[0].split(",")
        return [float(rows[-1].split(",")[columns.index(f"p_u{axis}")]) for axis in "xy"]

    alone = crest("alone")
    for side in (1e-4, 1.0, 1e6):
        for first in (True, False):
            assert crest(f"{side}-{first}", side, first) == pytest.approx(alone, rel=1e-6), (side, first)


def test_a_hanging_node_is_named_with_the_side_it_lies_on(mpm, tmp_path):
    nodes = {1: (0.0, 0.0), 2: (2.0, 0.0), 3: (2.0, 2.0), 4: (0.0, 2.0)}
    nodes |= {5: (3.0, 0.0), 6: (3.0, 1.0), 7: (3.0, 2.0), 8: (2.0, 1.0)}
    deck = write(tmp_path, nodes, [(1, 2, 3, 4), (2, 5, 6, 8), (8, 6, 7, 3)])
    process = mpm("check", deck)
    assert process.returncode == 2 and "error[D032]" in process.stderr, process.stderr
    assert "node 8 at (2, 1) on the side between the nodes 2 and 3 of element 1" in process.stderr
    assert "cut that cell at the node, or give the cells on both sides the same nodes" in process.stderr


def test_cells_that_overlap_are_named(mpm, tmp_path):
    nodes = {1: (0.0, 0.0), 2: (1.0, 0.0), 3: (1.0, 1.0), 4: (0.0, 1.0)}
    nodes |= {5: (0.5, 0.0), 6: (1.5, 0.0), 7: (1.5, 1.0), 8: (0.5, 1.0)}
    process = mpm("check", write(tmp_path, nodes, [(1, 2, 3, 4), (5, 6, 7, 8)]))
    assert process.returncode == 2 and "error[D032]" in process.stderr, process.stderr
    assert "1 pair of cells overlaps: element 1 at (0.5, 0.5) and element 2 at (1, 0.5)" in process.stderr
