"""Meshes of other programs as mesh files of gmsh."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from mpm._errors import UsageError

if TYPE_CHECKING:
    from mpm._deck import StrPath

#: Dimension, number of corners and number in gmsh of the cells that are written, by the begin of their names in meshio.
_KINDS = {
    "vertex": (0, 1, 15),
    "line": (1, 2, 1),
    "triangle": (2, 3, 2),
    "quad": (2, 4, 3),
    "tetra": (3, 4, 4),
    "hexahedron": (3, 8, 5),
    "wedge": (3, 6, 6),
    "pyramid": (3, 5, 7),
}
#: Names of data of cells that number materials, parts or boundaries in the formats of meshio.
_NUMBERS = ("gmsh:physical", "medit:ref", "nastran:ref", "CellEntityIds", "cell_tags", "avsucd:material", "flac3d:group")
#: The corners of a prism in an order with a given corner first.
_PRISM = [[0, 1, 2, 3, 4, 5], [1, 2, 0, 4, 5, 3], [2, 0, 1, 5, 3, 4], [3, 5, 4, 0, 2, 1], [4, 3, 5, 1, 0, 2], [5, 4, 3, 2, 1, 0]]

Cells = npt.NDArray[np.int64]


def convert(source: StrPath, target: StrPath | None = None, *, axes: str = "xyz", scale: float = 1.0) -> Path:
    """Converts a mesh of another program into a mesh file of gmsh, format 2.2.

    Sets of cells and numbers of materials become physical groups, cells of a higher order are written by their
    corners. A mesh without hexahedra may have prisms and pyramids: they are divided into tetrahedra. Needs ``meshio``.

    Args:
        source: A file that meshio can read: Abaqus (``.inp``), Nastran (``.bdf``), VTU, XDMF, Medit, gmsh, …
        target: The file to write; by default the source with the ending ``.msh`` (``_converted.msh`` if it has this
            ending already).
        axes: The coordinates that become x, y (and z), for example ``"xz"`` for a plane of constant y.
        scale: Factor of the coordinates, for example 0.001 from mm to m.

    Returns:
        The file that was written.

    Raises:
        UsageError: meshio is not installed, or the mesh has hexahedra beside prisms or pyramids, or no cells.

    Example:
        >>> mesh = mpm.convert("prisms.msh", "tetrahedra.msh")  # doctest: +SKIP
        >>> mesh.read_text().count(" 4 2 1 1 ")  # doctest: +SKIP
        3
    """
    meshio = _meshio()
    source = Path(source)
    if target is None:
        target = source.with_suffix(".msh") if source.suffix != ".msh" else source.with_name(f"{source.stem}_converted.msh")
    target = Path(target)
    if not axes or any(axis not in "xyz" for axis in axes) or len(axes) > 3:
        raise UsageError(f"`axes` is {axes!r}; give two or three of the letters x, y and z, such as \"xz\"")
    mesh = meshio.read(source)
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = mesh.points
    placed = np.zeros_like(points)
    for k, axis in enumerate(axes):
        placed[:, k] = scale * points[:, "xyz".index(axis)]
    blocks = _blocks(mesh)
    if not any(kind in ("triangle", "quad", "tetra", "hexahedron") for kind, _, _ in blocks):
        raise UsageError(f"the mesh `{source}` has no cells of a plane or a volume")
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(_text(placed, blocks))
    return target


def _meshio() -> Any:
    try:
        import meshio
    except ImportError:
        raise UsageError("converting meshes needs meshio: pip install meshio") from None
    return meshio


def _blocks(mesh: Any) -> list[tuple[str, Cells, list[list[str]]]]:
    """Kind, corners and names of groups of the cells, without prisms and pyramids."""
    names: list[list[list[str]]] = []
    numbers = next((mesh.cell_data[key] for key in _NUMBERS if key in mesh.cell_data), None)
    fields = {(int(data[1]), int(data[0])): name for name, data in mesh.field_data.items() if len(data) == 2}
    kinds = [next((kind for kind in _KINDS if block.type.startswith(kind)), None) for block in mesh.cells]
    for index, block in enumerate(mesh.cells):
        of_cell: list[list[str]] = [[] for _ in block.data]
        kind = kinds[index]
        if kind is not None and numbers is not None:
            for cell, number in enumerate(np.asarray(numbers[index]).reshape(len(block.data), -1)[:, 0]):
                if number != 0:
                    of_cell[cell].append(fields.get((_KINDS[kind][0], int(number)), str(int(number))))
        names.append(of_cell)
    for name, sets in mesh.cell_sets.items():
        if name.startswith("gmsh:"):
            continue
        for index, members in enumerate(sets):
            for cell in np.asarray(members if members is not None else [], dtype=int).ravel():
                if name not in names[index][cell]:
                    names[index][cell].append(name)
    whole = {"wedge", "pyramid"} & set(kinds)
    if whole and "hexahedron" in kinds:
        raise UsageError("the mesh has hexahedra beside prisms or pyramids, which cannot be divided so that cells fit")
    blocks: list[tuple[str, Cells, list[list[str]]]] = []
    for block, kind, of_cell in zip(mesh.cells, kinds, names, strict=True):
        if kind is None:
            continue
        corners = np.asarray(block.data, dtype=np.int64)[:, : _KINDS[kind][1]]
        if kind in whole:
            parts = [(_prism if kind == "wedge" else _pyramid)(cell) for cell in corners]
            of_cell = [groups for groups, part in zip(of_cell, parts, strict=True) for _ in part]
            corners = np.array([cell for part in parts for cell in part], dtype=np.int64).reshape(-1, 4)
            kind = "tetra"
        elif whole and kind == "quad":
            # The sides of prisms and pyramids are divided along the same diagonals.
            of_cell = [groups for groups in of_cell for _ in range(2)]
            corners = np.array([side for cell in corners for side in _sides(cell)], dtype=np.int64).reshape(-1, 3)
            kind = "triangle"
        blocks.append((kind, corners, of_cell))
    return blocks


def _sides(quad: Cells) -> list[list[int]]:
    a, b, c, d = (int(node) for node in quad)
    return [[a, b, c], [a, c, d]] if min(a, c) < min(b, d) else [[b, c, d], [b, d, a]]


def _prism(cell: Cells) -> list[list[int]]:
    """Divides a prism into tetrahedra; the diagonal of each side starts at its corner with the lowest number.

    After Dompierre, Labbé, Vallet and Camarero, *How to subdivide pyramids, prisms and hexahedra into tetrahedra*
    (1999).
    """
    v = [int(cell[k]) for k in _PRISM[int(np.argmin(cell))]]
    if min(v[1], v[5]) < min(v[2], v[4]):
        parts = [[0, 1, 2, 5], [0, 1, 5, 4], [0, 4, 5, 3]]
    else:
        parts = [[0, 1, 2, 4], [0, 4, 2, 5], [0, 4, 5, 3]]
    return [[v[k] for k in part] for part in parts]


def _pyramid(cell: Cells) -> list[list[int]]:
    top = int(cell[4])
    return [[*side, top] for side in _sides(cell[:4])]


def _text(points: npt.NDArray[np.float64], blocks: list[tuple[str, Cells, list[list[str]]]]) -> str:
    """The text of the mesh file; a cell of several groups is repeated for each, as gmsh does."""
    tags: dict[tuple[int, str], int] = {}
    lines: list[str] = []
    for kind, corners, names in blocks:
        dimension, _, code = _KINDS[kind]
        for cell, groups in zip(corners, names, strict=True):
            nodes = " ".join(str(node + 1) for node in cell)
            for name in groups or [""]:
                tag = tags.setdefault((dimension, name), len(tags) + 1) if name else 0
                lines.append(f"{len(lines) + 1} {code} 2 {tag} {max(tag, 1)} {nodes}")
    named = [f'{dimension} {tag} "{name}"' for (dimension, name), tag in tags.items()]
    head = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat"]
    named_groups = ["$PhysicalNames", str(len(named)), *named, "$EndPhysicalNames"] if named else []
    places = [f"{k + 1} {x!r} {y!r} {z!r}" for k, (x, y, z) in enumerate(points.tolist())]
    return "\n".join([*head, *named_groups, "$Nodes", str(len(places)), *places, "$EndNodes", "$Elements", str(len(lines)), *lines, "$EndElements", ""])
