"""Makes the meshes of the cantilever under its own weight with the Python package of gmsh.

The rectangle [0, 4.5] x [-1, 1] in squares of side h, and in triangles whose sides on its border are h long. Groups:
`root` (the side x = 0), `bar` (the cells of [0, 4] x [0, 1]) and `around` (the rest).
"""

import pathlib

import gmsh

HERE = pathlib.Path(__file__).parent


def cantilever(cells, h):
    gmsh.initialize(argv=["", "-v", "0"])
    geo = gmsh.model.geo
    x, y = [0, 4, 4.5], [-1, 0, 1]
    point = [[geo.addPoint(x[i], y[j], 0, h) for i in range(3)] for j in range(3)]
    across = [[geo.addLine(point[j][i], point[j][i + 1]) for i in range(2)] for j in range(3)]
    up = [[geo.addLine(point[j][i], point[j + 1][i]) for i in range(3)] for j in range(2)]
    parts = {}
    for j in range(2):
        for i in range(2):
            loop = geo.addCurveLoop([across[j][i], up[j][i + 1], -across[j + 1][i], -up[j][i]])
            parts[i, j] = geo.addPlaneSurface([loop])
    geo.synchronize()
    for line, length in [(a, (4, 0.5)[i]) for row in across for i, a in enumerate(row)] + [(u, 1) for row in up for u in row]:
        gmsh.model.mesh.setTransfiniteCurve(line, round(length / h) + 1)
    if cells == "quadrilaterals":
        for part in parts.values():
            gmsh.model.mesh.setTransfiniteSurface(part)
            gmsh.model.mesh.setRecombine(2, part)
    bar = parts.pop((0, 1))
    gmsh.model.addPhysicalGroup(1, [up[0][0], up[1][0]], name="root")
    gmsh.model.addPhysicalGroup(2, [bar], name="bar")
    gmsh.model.addPhysicalGroup(2, list(parts.values()), name="around")
    gmsh.option.setNumber("Mesh.Algorithm", 6)
    gmsh.model.mesh.generate(2)
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    for k, tag in enumerate(tags):  # without the error of about 1e-12 that gmsh makes along lines
        gmsh.model.mesh.setNode(tag, [round(v, 10) for v in coordinates[3 * k : 3 * k + 3]], [])
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.write(str(HERE / f"{cells}_{h}.msh"))
    gmsh.finalize()


for cells in ("quadrilaterals", "triangles"):
    for h in (0.5, 0.25, 0.125, 0.0625):
        cantilever(cells, h)
