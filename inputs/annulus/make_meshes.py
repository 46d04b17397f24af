"""Makes the meshes of the annulus, inner radius 0.75 and outer radius 1.25, with the Python package of gmsh.

Linear triangles whose sides are all about as long as the segments of the outer circle. Groups: `inner` and `outer`
(the circles) and `annulus`.
"""

import math
import pathlib

import gmsh

HERE = pathlib.Path(__file__).parent
INNER, OUTER = 0.75, 1.25


def annulus(segments):
    gmsh.initialize(argv=["", "-v", "0"])
    geo, size = gmsh.model.geo, 2 * math.pi * OUTER / segments
    centre = geo.addPoint(0, 0, 0, size)

    # Three arcs per circle: gmsh wants them shorter than a half, and all counts of segments divide by three.
    def circle(radius, segments):
        angles = [2 * math.pi * k / 3 for k in range(3)]
        points = [geo.addPoint(radius * math.cos(a), radius * math.sin(a), 0, size) for a in angles]
        arcs = [geo.addCircleArc(points[k], centre, points[(k + 1) % 3]) for k in range(3)]
        for arc in arcs:
            geo.mesh.setTransfiniteCurve(arc, segments // 3 + 1)
        return arcs

    outer = circle(OUTER, segments)
    inner = circle(INNER, 3 * round(segments * INNER / OUTER / 3))
    surface = geo.addPlaneSurface([geo.addCurveLoop(outer), geo.addCurveLoop(inner)])
    geo.synchronize()
    gmsh.model.addPhysicalGroup(1, inner, name="inner")
    gmsh.model.addPhysicalGroup(1, outer, name="outer")
    gmsh.model.addPhysicalGroup(2, [surface], name="annulus")
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.Algorithm", 6)
    gmsh.model.mesh.generate(2)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.write(str(HERE / f"annulus_{segments}.msh"))
    gmsh.finalize()


for segments in (18, 36, 72, 144, 288):
    annulus(segments)
