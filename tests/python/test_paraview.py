"""The script that opens results in ParaView, with a stand-in for ParaView: it may use no other functions, files and
arrays than there are."""

import runpy
import sys
import types

import numpy as np
import pytest
import pyvista

from conftest import ROOT
from results import tensors

SCRIPT = ROOT / "docs" / "how-to" / "open_in_paraview.py"
# What `paraview.simple` and its objects have, of the functions and properties in the script.
OBJECTS = {
    "view": {"InteractionMode"},
    "scene": {"UpdateAnimationUsingDataTimeSteps", "GoToLast"},
    "colours": {"ApplyPreset"},
    "display": {
        *("SetRepresentationType", "AmbientColor", "DiffuseColor", "PointSize"),
        *("RescaleTransferFunctionToDataRange", "SetScalarBarVisibility"),
    },
}


class Stand:
    """An object of ParaView that takes known properties and calls only."""

    def __init__(self, kind):
        object.__setattr__(self, "kind", kind)

    def __getattr__(self, name):
        assert name in OBJECTS[self.kind], f"{self.kind}.{name}"
        return lambda *arguments: None

    def __setattr__(self, name, value):
        assert name in OBJECTS[self.kind], f"{self.kind}.{name}"


class Reader:
    def __init__(self, registrationName, FileName):
        assert registrationName in ("grid", "points", "domains")
        self.mesh = pyvista.PVDReader(FileName).read()[0]


@pytest.fixture
def paraview(monkeypatch):
    """Installs the stand-in; the fields that were chosen and the pictures that were written are noted."""
    noted, shown = types.SimpleNamespace(fields=[], pictures=[]), {}

    def show(reader, view):
        display = Stand("display")
        shown[id(display)] = (display, reader)
        return display

    def colour(display, choice):
        if choice is not None:
            place, name, *component = choice
            mesh = shown[id(display)][1].mesh
            attributes = mesh.GetCellData() if place == "CELLS" else mesh.GetPointData()
            array = attributes.GetArray(name)
            assert array is not None, f"no array {name} in {place}"
            names = [array.GetComponentName(i) for i in range(array.GetNumberOfComponents())]
            assert all(c in names for c in component), (component, names)
            noted.fields.append(choice)

    simple = types.ModuleType("paraview.simple")
    simple.GetActiveViewOrCreate = lambda kind: Stand("view")
    simple.GetAnimationScene = lambda: Stand("scene")
    simple.GetColorTransferFunction = lambda name: Stand("colours")
    simple.PVDReader, simple.Show, simple.ColorBy = Reader, show, colour
    simple.Render = simple.ResetCamera = lambda view: None
    simple.SaveScreenshot = lambda path, view, ImageResolution: noted.pictures.append(path)
    package = types.ModuleType("paraview")
    package.simple = simple
    monkeypatch.setitem(sys.modules, "paraview", package)
    monkeypatch.setitem(sys.modules, "paraview.simple", simple)
    return noted


def test_the_script_shows_domains_or_points(paraview, monkeypatch, beam, collapse):
    for results, arguments, field in [
        (beam, [], ("CELLS", "von_mises_stress")),
        (beam, ["a.png", "cauchy_stress:XX"], ("CELLS", "cauchy_stress", "XX")),
        (collapse, ["b.png"], ("POINTS", "von_mises_stress")),
    ]:
        monkeypatch.setattr(sys, "argv", [str(SCRIPT), str(results.directory), *arguments])
        runpy.run_path(str(SCRIPT), run_name="__main__")
        assert paraview.fields.pop() == field
    assert paraview.pictures == ["a.png", "b.png"]


def test_the_script_takes_the_directory_from_the_environment(paraview, monkeypatch, beam):
    monkeypatch.setattr(sys, "argv", ["paraview"])
    monkeypatch.setenv("MPM_RESULTS", str(beam.directory))
    monkeypatch.setenv("MPM_FIELD", "pressure")
    runpy.run_path(str(SCRIPT), run_name="paraview script")
    assert paraview.fields == [("CELLS", "pressure")] and paraview.pictures == []


def test_tensor_filters_take_the_components_as_they_are(beam, collapse):
    """Principal values by VTK are those of the tensors that the component names describe."""
    from vtkmodules.vtkFiltersTensor import vtkTensorPrincipalInvariants

    for results in (beam, collapse):
        mesh = results.mesh("points", -1)
        principal = vtkTensorPrincipalInvariants()
        principal.SetInputData(mesh)
        principal.Update()
        found = pyvista.wrap(principal.GetOutput()).point_data
        for name in ("cauchy_stress", "elastic_strain"):
            expected = np.linalg.eigvalsh(tensors(mesh.point_data[name]))[:, ::-1]
            values = np.stack([found[f"{name} - Sigma {k}"] for k in (1, 2, 3)], 1)
            scale = np.abs(expected).max()
            np.testing.assert_allclose(values, expected, rtol=1e-6, atol=1e-6 * scale)
