"""Makes the mesh files of this folder with the Python package of gmsh."""

import pathlib

import gmsh

HERE = pathlib.Path(__file__).parent


def start():
    gmsh.initialize(argv=["", "-v", "0"])


def write(name, version, binary=False):
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.option.setNumber("Mesh.Binary", int(binary))
    gmsh.write(str(HERE / f"{name}.msh"))


def write_all(name):
    for version in (2.2, 4.1):
        for binary in (False, True):
            write(f"{name}_{version}_{'binary' if binary else 'text'}", version, binary)


def quads(surface):
    gmsh.model.mesh.setTransfiniteSurface(surface)
    gmsh.model.mesh.setRecombine(2, surface)


def round_nodes():
    """Removes the error of about 1e-12 that gmsh makes along curves."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    for k, tag in enumerate(tags):
        gmsh.model.mesh.setNode(tag, [round(v, 10) for v in coordinates[3 * k : 3 * k + 3]], [])


def mixed():
    """A square of quadrilaterals beside one of triangles."""
    start()
    geo = gmsh.model.geo
    p = [geo.addPoint(x, y, 0, 0.5) for x, y in [(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (0, 1)]]
    bottom, bottom2, right, top2, top, left, middle = (
        geo.addLine(p[a], p[b]) for a, b in [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0), (1, 4)]
    )
    a = geo.addPlaneSurface([geo.addCurveLoop([bottom, middle, top, left])])
    b = geo.addPlaneSurface([geo.addCurveLoop([bottom2, right, top2, -middle])])
    geo.synchronize()
    for curve in (bottom, middle, top, left):
        gmsh.model.mesh.setTransfiniteCurve(curve, 3)
    quads(a)
    add = gmsh.model.addPhysicalGroup
    add(0, [p[0]], name="origin")
    add(1, [left], 7, name="left edge")
    add(1, [bottom, bottom2], 8)
    add(2, [a], name="soil body")
    add(2, [b], name="rock")
    add(2, [a, b], name="all of it")
    gmsh.model.mesh.generate(2)
    round_nodes()
    write_all("mixed")
    gmsh.model.mesh.partition(2)
    write("partitioned", 4.1)
    gmsh.finalize()


def disk(name, parametric=False, order=1, reverse=False):
    start()
    gmsh.option.setNumber("Mesh.SaveParametric", int(parametric))
    occ = gmsh.model.occ
    surface = occ.addDisk(0, 0, 0, 1, 1)
    occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.8)
    gmsh.model.addPhysicalGroup(2, [surface], name="disk")
    gmsh.model.addPhysicalGroup(1, [1], name="rim")
    gmsh.model.mesh.generate(2)
    gmsh.model.mesh.setOrder(order)
    if reverse:
        gmsh.model.mesh.reverse([(2, surface)])
    if parametric:
        write_all(name)
    else:
        write(name, 4.1)
    gmsh.finalize()


def rectangle():
    """The cantilever's grid: [0, 11] x [0, 10] in squares of side 0.5."""
    start()
    geo = gmsh.model.geo
    p = [geo.addPoint(x, y, 0) for x, y in [(0, 0), (11, 0), (11, 10), (0, 10)]]
    lines = [geo.addLine(p[k], p[(k + 1) % 4]) for k in range(4)]
    surface = geo.addPlaneSurface([geo.addCurveLoop(lines)])
    geo.synchronize()
    for k, line in enumerate(lines):
        gmsh.model.mesh.setTransfiniteCurve(line, 23 if k % 2 == 0 else 21)
    quads(surface)
    gmsh.model.addPhysicalGroup(1, [lines[3]], name="left")
    gmsh.model.addPhysicalGroup(2, [surface], name="grid")
    gmsh.model.mesh.generate(2)
    round_nodes()
    write("rectangle_quad_h0.5", 4.1)
    gmsh.finalize()


mixed()
disk("disk", parametric=True)
disk("second_order", order=2)
disk("clockwise", reverse=True)
rectangle()
