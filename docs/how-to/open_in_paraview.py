"""Opens the results of a run in ParaView: the domains of the points (or the points) over the active grid cells.

    pvpython open_in_paraview.py results/beam picture.png          writes a picture of the last step
    MPM_RESULTS=results/beam paraview --script=open_in_paraview.py  opens the window, at the last step

A third argument, or MPM_FIELD, names the field: `von_mises_stress` (default), `pressure`, `cauchy_stress:XX`, ...
Runs in ParaView 5.9 and newer; needs nothing else.
"""

import os
import sys
from pathlib import Path

from paraview.simple import (
    ColorBy,
    GetActiveViewOrCreate,
    GetAnimationScene,
    GetColorTransferFunction,
    PVDReader,
    Render,
    ResetCamera,
    SaveScreenshot,
    Show,
)


def open_results(directory, field="von_mises_stress"):
    """Shows the last step of a run and returns the view."""
    directory = Path(directory).resolve()
    view = GetActiveViewOrCreate("RenderView")
    view.InteractionMode = "2D"

    if (directory / "grid.pvd").exists():
        grid = PVDReader(registrationName="grid", FileName=str(directory / "grid.pvd"))
        cells = Show(grid, view)
        cells.SetRepresentationType("Wireframe")
        ColorBy(cells, None)
        cells.AmbientColor = cells.DiffuseColor = [0.6, 0.6, 0.6]

    # Standard material points have no domain; they are drawn as they are.
    series = next(name for name in ("domains", "points") if (directory / f"{name}.pvd").exists())
    bodies = PVDReader(registrationName=series, FileName=str(directory / f"{series}.pvd"))
    scene = GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    scene.GoToLast()
    display = Show(bodies, view)
    display.SetRepresentationType("Surface" if series == "domains" else "Points")
    display.PointSize = 4.0
    name, _, component = field.partition(":")
    ColorBy(display, ("CELLS" if series == "domains" else "POINTS", *filter(None, (name, component))))
    GetColorTransferFunction(name).ApplyPreset("Viridis (matplotlib)", True)
    display.RescaleTransferFunctionToDataRange(False, True)
    display.SetScalarBarVisibility(view, True)
    ResetCamera(view)
    Render(view)
    return view


def main():
    arguments = sys.argv[1:]
    directory = arguments[0] if arguments else os.environ.get("MPM_RESULTS", ".")
    field = arguments[2] if len(arguments) > 2 else os.environ.get("MPM_FIELD", "von_mises_stress")
    view = open_results(directory, field)
    if len(arguments) > 1:
        SaveScreenshot(arguments[1], view, ImageResolution=[1600, 1200])


# `paraview --script` does not call it `__main__`.
if __name__ in ("__main__", "__vtkconsole__") or "MPM_RESULTS" in os.environ:
    main()
