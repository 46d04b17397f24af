"""The notebooks of `docs/notebooks`: they run without errors, and are stored without outputs."""

import os

import nbformat
import pytest
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

from conftest import ROOT

FOLDER = ROOT / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


def execute(notebook, folder):
    """Runs all cells in a kernel of this interpreter, with its path of packages, in a folder."""
    client = NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(folder)}}
    )
    client.execute(env=dict(os.environ, MPLBACKEND="module://matplotlib_inline.backend_inline"))
    return [output for cell in notebook.cells for output in cell.get("outputs", [])]


def test_all_notebooks_are_found():
    expected = {"first_analysis", "own_law", "calibration", "convergence"}
    assert {path.stem for path in NOTEBOOKS} == expected


# The others use the same package in the same way; the tests of the package cover what they call.
USUAL = [pytest.param(path, marks=[pytest.mark.long] * (path.stem != "first_analysis")) for path in NOTEBOOKS]


@pytest.mark.parametrize("path", USUAL, ids=lambda path: path.stem)
def test_a_notebook_runs(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    before = set(FOLDER.iterdir())
    outputs = execute(notebook, FOLDER)
    assert sum("image/png" in output.get("data", {}) for output in outputs) >= 1, "a notebook has a figure"
    assert not [output for output in outputs if output.get("name") == "stderr"], "nothing is warned of"
    assert set(FOLDER.iterdir()) == before, "a notebook leaves nothing behind"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_without_outputs(path):
    notebook = nbformat.read(path, as_version=4)
    for cell in notebook.cells:
        assert cell.cell_type == "markdown" or (not cell.outputs and cell.execution_count is None)
    assert notebook.metadata.kernelspec.name == "python3"
    assert set(notebook.metadata) == {"kernelspec", "language_info"}, "nothing of the machine that wrote it"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_lines_of_a_notebook_are_short(path):
    lines = [line for cell in nbformat.read(path, as_version=4).cells for line in cell.source.splitlines()]
    assert max(map(len, lines)) <= 120


def test_an_error_in_a_notebook_is_found(tmp_path):
    cells = [nbformat.v4.new_code_cell("import mpm"), nbformat.v4.new_code_cell("mpm.Deck({}).run()")]
    with pytest.raises(CellExecutionError, match="DeckError"):
        execute(nbformat.v4.new_notebook(cells=cells), tmp_path)
