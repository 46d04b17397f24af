"""Makes the mesh files of this folder with the Python package of gmsh."""

import math
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


def displaced(x, by):
    """A smooth displacement that is zero on the border of [0, 8]^3."""
    bubble = 1.0
    for c in x:
        bubble *= c * (8 - c) / 16
    phases = (1.9 * x[0] + 2.3 * x[1] - 1.1 * x[2], 2.7 * x[0] - 1.3 * x[1] + 0.7 * x[2], x[0] + x[1] + 2.9 * x[2])
    return [c + by * min(1, 2 * bubble) * math.sin(phase) for c, phase in zip(x, phases)]


def block(name, hexahedra):
    """A block [2, 6]^3 in the middle of [0, 8]^3: distorted hexahedra, or tetrahedra."""
    start()
    occ = gmsh.model.occ
    lines = (0, 2, 6, 8)
    if hexahedra:
        spans = list(zip(lines, lines[1:]))
        boxes = [(x, y, z) for x in spans for y in spans for z in spans]
        tags = [(3, occ.addBox(*(s[0] for s in b), *(s[1] - s[0] for s in b))) for b in boxes]
        occ.fragment(tags[:1], tags[1:])
    else:
        occ.fragment([(3, occ.addBox(0, 0, 0, 8, 8, 8))], [(3, occ.addBox(2, 2, 2, 4, 4, 4))])
    occ.synchronize()
    inner = gmsh.model.getEntitiesInBoundingBox(1.9, 1.9, 1.9, 6.1, 6.1, 6.1, 3)
    volumes = gmsh.model.getEntities(3)
    gmsh.model.addPhysicalGroup(3, [tag for _, tag in inner], name="block")
    gmsh.model.addPhysicalGroup(3, [v[1] for v in volumes if v not in inner], name="around")
    bottom = gmsh.model.getEntitiesInBoundingBox(-0.1, -0.1, -0.1, 8.1, 8.1, 0.1, 2)
    gmsh.model.addPhysicalGroup(2, [tag for _, tag in bottom], name="bottom")
    if hexahedra:
        for _, curve in gmsh.model.getEntities(1):
            low, high = gmsh.model.getBoundingBox(1, curve)[:3], gmsh.model.getBoundingBox(1, curve)[3:]
            length = max(b - a for a, b in zip(low, high))
            gmsh.model.mesh.setTransfiniteCurve(curve, 7 if length > 3 else 2)
        for _, surface in gmsh.model.getEntities(2):
            quads(surface)
        for _, volume in volumes:
            gmsh.model.mesh.setTransfiniteVolume(volume)
    else:
        corners = set(gmsh.model.getEntities(0))
        near = set(gmsh.model.getEntitiesInBoundingBox(1.9, 1.9, 1.9, 6.1, 6.1, 6.1, 0))
        gmsh.model.mesh.setSize(list(corners - near), 3.0)
        gmsh.model.mesh.setSize(list(near), 0.8)
    gmsh.model.mesh.generate(3)
    if hexahedra:
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        for k, tag in enumerate(tags):
            gmsh.model.mesh.setNode(tag, displaced(coordinates[3 * k : 3 * k + 3], 0.15), [])
    round_nodes()
    write(name, 4.1)
    gmsh.finalize()


def solid():
    """A brick of two hexahedra beside a wedge of tetrahedra that it does not touch, with groups of every dimension."""
    start()
    occ = gmsh.model.occ
    brick = occ.addBox(0, 0, 0, 2, 1, 1)
    wedge = occ.addWedge(3, 0, 0, 1, 1, 1, ltx=0.4)
    occ.synchronize()
    for _, curve in gmsh.model.getEntities(1):
        x = gmsh.model.getBoundingBox(1, curve)
        if x[3] < 2.5:
            gmsh.model.mesh.setTransfiniteCurve(curve, 3 if x[3] - x[0] > 1.5 else 2)
    for _, surface in gmsh.model.getBoundary([(3, brick)], oriented=False):
        quads(surface)
    gmsh.model.mesh.setTransfiniteVolume(brick)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.7)
    add = gmsh.model.addPhysicalGroup
    add(0, [gmsh.model.getEntitiesInBoundingBox(-0.1, -0.1, -0.1, 0.1, 0.1, 0.1, 0)[0][1]], name="origin")
    edges = [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(-0.1, -0.1, -0.1, 2.1, 0.1, 0.1, 1)]
    add(1, edges, 7, name="long edge")
    add(2, [t for _, t in gmsh.model.getEntitiesInBoundingBox(-0.1, -0.1, -0.1, 5, 1.1, 0.1, 2)], name="floor")
    add(3, [brick], name="soil body")
    add(3, [wedge], name="rock")
    add(3, [brick, wedge], name="all of it")
    gmsh.model.mesh.generate(3)
    round_nodes()
    write_all("solid")
    gmsh.model.mesh.setOrder(2)
    write("solid_second_order", 4.1)
    gmsh.finalize()


mixed()
disk("disk", parametric=True)
disk("second_order", order=2)
disk("clockwise", reverse=True)
rectangle()
block("block_hexahedra", True)
block("block_tetrahedra", False)
solid()
