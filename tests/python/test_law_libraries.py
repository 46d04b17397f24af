"""Laws from shared libraries: the answers of those of the program, and what happens to bad ones."""

import json
import os
import platform
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import yaml

from conftest import ROOT
from results import Results

LAWS = ROOT / "examples" / "laws"
FAULTY = ROOT / "tests" / "python" / "faulty_law.c"
ELASTIC = {"young": 1e6, "poisson": 0.3}
PLASTIC = ELASTIC | {"deviatoric_yield_stress": 20e3, "hardening_modulus": 2e5}


def compiler(variable, usual):
    command = os.environ.get(variable, usual)
    if shutil.which(command) is None:
        pytest.skip(f"there is no {command}")
    return command


def compiled(source, target, *options):
    """A shared library from C."""
    command = [compiler("CC", "cc"), "-O2", "-shared", "-fPIC", f"-I{LAWS}", *options, str(source), "-o", str(target), "-lm"]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return target


def compiled_fortran(target):
    command = [compiler("FC", "gfortran"), "-O2", "-frecursive", "-shared", "-fPIC", f"-J{target.parent}"]
    subprocess.run([*command, str(LAWS / "umat.f90"), "-o", str(target)], check=True, capture_output=True, text=True)
    return target


def block(idealisation="plane-strain", **material):
    """A block on a rough base that is pressed flat and turned: well conditioned, so that round-off does not grow."""
    axes = "xyz" if idealisation == "solid" else "xy"
    up, count = axes[-1], len(axes)
    return {
        "version": 1,
        "analysis": {"idealisation": idealisation},
        "grid": {"type": "structured", "origin": [0] * count, "size": [2] * count, "spacing": 0.5},
        "materials": {"clay": {"density": 1000} | material},
        "bodies": [
            {
                "name": "block",
                "material": "clay",
                "method": "mpm",
                "points_per_cell": 2,
                "shape": {"type": "box", "min": [0] * count, "max": [1] * count},
            }
        ],
        "boundary_conditions": [
            {"name": "base", "nodes": {up: 0}, "fix": list(axes)},
            {"name": "press", "nodes": {up: 1}, f"u{up}": -0.05, "ux": 0.1},
        ],
        "loads": [{"name": "weight", "type": "gravity", "acceleration": [0] * (count - 1) + [-10]}],
        "steps": {"count": 8},
        "checkpoint": {"every": 4},
        "solver": {"tolerance": 1e-11},
    }


def library_law(file, **parameters):
    return {"model": "library", "file": str(file), "parameters": parameters}


@pytest.fixture(autouse=True)
def consent(monkeypatch):
    """The tests trust the libraries that they build."""
    monkeypatch.setenv("MPM_ALLOW_LIBRARIES", "1")


@pytest.fixture
def deck(tmp_path):
    """Writes a deck beside its libraries."""

    def write(content, name="deck.yaml"):
        path = tmp_path / name
        path.write_text(yaml.safe_dump(content, sort_keys=False))
        return path

    return write


def ran(mpm, deck, *options):
    out = deck.with_suffix(".out")
    process = mpm("run", deck, "--out", out, *options)
    assert process.returncode == 0, process.stderr
    return Results(out), process.stderr


def assert_alike(some, other, fields, tolerance):
    """The same points and tables up to round-off."""
    some_points, other_points = some.mesh("points", -1), other.mesh("points", -1)
    np.testing.assert_allclose(some_points.points, other_points.points, rtol=0, atol=tolerance)
    for name in fields:
        expected = other_points[name]
        scale = np.abs(expected).max()
        assert scale > 0, name
        np.testing.assert_allclose(some_points[name], expected, rtol=0, atol=tolerance * scale, err_msg=name)
    history = other.history
    forces = [name for name in history if name.endswith(("_rx", "_ry", "_rz"))]
    largest = max(np.abs(history[name]).max() for name in forces)
    for name in forces:
        np.testing.assert_allclose(some.history[name], history[name], rtol=0, atol=tolerance * largest, err_msg=name)
    some_summary, other_summary = (json.loads((one.directory / "summary.json").read_text()) for one in (some, other))
    for name in ("strain_energy", "plastic_work"):
        scale = tolerance * other_summary["strain_energy"]
        np.testing.assert_allclose(some_summary[name], other_summary[name], rtol=0, atol=scale, err_msg=name)


@pytest.mark.parametrize("idealisation", ["plane-strain", "axisymmetric", "solid"])
def test_the_template_in_c_is_von_mises_plasticity(mpm, deck, tmp_path, idealisation):
    compiled(LAWS / "law.c", tmp_path / "law.so", "-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror")
    content = block(idealisation, **library_law("./law.so", **PLASTIC))
    built_in = block(idealisation, model="von-mises", **PLASTIC)
    if idealisation == "axisymmetric":
        for one in (content, built_in):
            one["boundary_conditions"].append({"name": "axis", "nodes": {"x": 0}, "fix": ["x"]})
            del one["boundary_conditions"][1]["ux"]
    some, _ = ran(mpm, deck(content))
    other, _ = ran(mpm, deck(built_in, "built_in.yaml"))
    assert other.mesh("points", -1)["equivalent_plastic_strain"].max() > 0.01
    fields = ["cauchy_stress", "elastic_strain", "plastic_strain", "equivalent_plastic_strain", "J"]
    assert_alike(some, other, fields, 1e-11)
    iterations = [results.table("convergence")["iteration"] for results in (some, other)]
    np.testing.assert_array_equal(*iterations)


def test_the_umat_is_von_mises_plasticity(mpm, deck, tmp_path):
    compiled_fortran(tmp_path / "umat.so")
    perfect = PLASTIC | {"hardening_modulus": 0}
    yields_at = {"yield_stress": 1.5**0.5 * PLASTIC["deviatoric_yield_stress"]}
    some, said = ran(mpm, deck(block("solid", **library_law("umat.so", **ELASTIC, **yields_at))))
    other, _ = ran(mpm, deck(block("solid", model="von-mises", **perfect), "built_in.yaml"))
    assert "D063" not in said
    assert_alike(some, other, ["cauchy_stress", "elastic_strain", "plastic_strain"], 1e-11)
    names = ["equivalent_plastic_strain", "umat_plastic_work", "umat_stress_12"]
    points = some.mesh("points", -1)
    assert all(np.abs(points[name]).max() > 0 for name in names)


def test_a_umat_begins_with_an_initial_stress(mpm, deck, tmp_path):
    compiled_fortran(tmp_path / "umat.so")
    content = block(**library_law("umat.so", **ELASTIC, yield_stress=1e6))
    content["bodies"][0]["initial_stress"] = {"type": "geostatic", "surface": 1, "k0": 0.5}
    content["boundary_conditions"] = [
        {"name": "base", "nodes": {"y": 0}, "fix": ["y"]},
        {"name": "left", "nodes": {"x": 0}, "fix": ["x"]},
        {"name": "right", "nodes": {"x": 1}, "fix": ["x"]},
    ]
    del content["solver"]
    results, _ = ran(mpm, deck(content))
    points = results.mesh("points", -1)
    assert np.abs(points["displacement"]).max() < 1e-12
    np.testing.assert_allclose(points["umat_stress_22"], points["cauchy_stress"][:, 1], rtol=1e-12)
    assert points["umat_stress_22"].min() < -5e3


@pytest.mark.parametrize("measure", [0, 1])
def test_a_library_with_the_fewest_functions_is_linear_elasticity(mpm, deck, tmp_path, measure):
    compiled(FAULTY, tmp_path / "law.so", f"-DMEASURE={measure}")
    some, _ = ran(mpm, deck(block(**library_law("law.so", **ELASTIC))))
    other, _ = ran(mpm, deck(block(model="hencky", **ELASTIC), "built_in.yaml"))
    if measure == 0:
        assert_alike(some, other, ["cauchy_stress", "elastic_strain"], 1e-11)
    else:
        difference = some.mesh("points", -1)["cauchy_stress"] - other.mesh("points", -1)["cauchy_stress"]
        assert 0.01 < np.abs(difference).max() / np.abs(other.mesh("points", -1)["cauchy_stress"]).max() < 0.3
    assert some.mesh("points", -1)["largest_strain"].max() > 0.02


def test_the_library_is_stated(mpm, deck, tmp_path):
    compiled(LAWS / "law.c", tmp_path / "law.so")
    path = deck(block(**library_law("./law.so", **PLASTIC)))
    log = tmp_path / "run.log"
    results, said = ran(mpm, path, "--log", log)
    checked = mpm("check", path)
    assert checked.returncode == 0 and checked.stderr == "", "a correct law causes no warning"
    stated = json.loads((results.directory / "run.json").read_text())["law_libraries"]
    assert stated == json.loads((results.directory / "summary.json").read_text())["law_libraries"]
    assert [set(library) for library in stated] == [{"material", "file", "hash"}]
    assert stated[0]["material"] == "clay" and Path(stated[0]["file"]) == tmp_path / "law.so"
    sentence = f"the law of the material `clay` comes from the library `{stated[0]['file']}`, hash {stated[0]['hash']}"
    assert all(sentence in text for text in (said, log.read_text(), checked.stdout))
    built_in, said = ran(mpm, deck(block(model="von-mises", **PLASTIC), "built_in.yaml"))
    assert "comes from the library" not in said
    assert "law_libraries" not in json.loads((built_in.directory / "run.json").read_text())


def test_a_run_resumes_with_its_library_only(mpm, deck, tmp_path):
    library = compiled(LAWS / "law.c", tmp_path / "law.so")
    content = block(**library_law("law.so", **PLASTIC))
    path = deck(content)
    ran(mpm, path)
    compiled(LAWS / "law.c", library, "-O0")
    resumed = mpm("run", path, "--out", path.with_suffix(".out"), "--resume")
    assert resumed.returncode == 2 and "R002" in resumed.stderr, resumed.stderr
    assert "a mesh, surface or library that it names has changed" in resumed.stderr
    compiled(LAWS / "law.c", library)
    resumed = mpm("run", path, "--out", path.with_suffix(".out"), "--resume")
    assert resumed.returncode == 0 and "nothing is left to do" in resumed.stderr, resumed.stderr


FAULTS = {
    "WRONG_ABI": "it implements version 2 of the interface; this program needs version 1",
    "NO_UPDATE": "it has no function `mpm_law_update`",
    "NO_PARAMETERS": "it has no function `mpm_law_parameter`",
    "WRONG_SIZE": "its structure `mpm_sizes` has 16 bytes; this program needs 24",
    "WRONG_COUNT": "it states -1 history variables; the number must be from 0 to 1000",
    "NO_NAME": "parameter 1 has no name",
    "EMPTY_NAME": "parameter 1 has no name",
    "NOT_UTF8": "the name or the unit of parameter 1 is not UTF-8",
    "NOT_A_WORD": 'parameter 1 cannot be named "poisson\'s ratio"',
    "TWICE": 'two parameters are named "young"',
    "TAKEN_NAME": "its history variable `pressure` has the name of another field of the points",
    "NAN_INITIAL": 'the initial value of the history variable "largest_strain" is NaN',
    "MEASURE=5": "`mpm_law_measure` returns 5; the strain measure must be 0 or 1",
    "UNDEFINED": "not_in_any_library",
    "NO_SMALL_NUMBERS": "it makes the whole program treat very small numbers as zero, which changes results",
}


def refused(mpm, path, code, *texts):
    process = mpm("check", path)
    assert process.returncode == 2, process.stdout + process.stderr
    for text in (f"error[{code}]: ", *texts):
        assert text in process.stderr, process.stderr
    assert "panicked" not in process.stderr and "= help: " in process.stderr
    return process.stderr


@pytest.mark.parametrize("fault", FAULTS)
def test_faulty_libraries_are_refused(mpm, deck, tmp_path, fault):
    if fault == "NO_SMALL_NUMBERS" and platform.machine() not in ("x86_64", "AMD64"):
        pytest.skip("the register is that of x86")
    compiled(FAULTY, tmp_path / "law.so", f"-D{fault}")
    path = deck(block(**library_law("./law.so", **ELASTIC)))
    said = refused(mpm, path, "D061", "the library `./law.so` cannot be used: ", FAULTS[fault])
    line = next(n for n, text in enumerate(path.read_text().splitlines(), 1) if "law.so" in text)
    assert f"deck.yaml:{line}:" in said


#: A library that leaves a trace when it is loaded.
TRACE = """
#include <stdio.h>
__attribute__((constructor)) static void loaded(void) { FILE *file = fopen("TRACE", "a"); if (file) fclose(file); }
"""


@pytest.mark.parametrize("words", [["check"], ["run", "--out", "out"], ["run", "--out", "out", "--resume"],
                                   ["element", "--path", "isotropic", "--to", "0.01", "--output", "-"],
                                   ["sweep", "--over", "n=2,3", "--out", "out"]], ids=lambda words: words[0])
@pytest.mark.parametrize("value", [None, "", "0", "yes"])
def test_no_code_of_a_library_runs_without_consent(mpm, deck, tmp_path, monkeypatch, words, value):
    trace = tmp_path / "trace"
    source = tmp_path / "trace.c"
    source.write_text(TRACE.replace("TRACE", str(trace)))
    compiled(source, tmp_path / "law.so")
    content = block(**library_law("./law.so")) | {"parameters": {"n": 2}}
    content["bodies"][0]["points_per_cell"] = "${n}"
    path = deck(content)
    if value is None:
        monkeypatch.delenv("MPM_ALLOW_LIBRARIES")
    else:
        monkeypatch.setenv("MPM_ALLOW_LIBRARIES", value)
    words = [str(tmp_path / word) if word == "out" else word for word in words]
    process = mpm(words[0], path, *words[1:])
    assert process.returncode != 0 and not trace.exists(), process.stdout + process.stderr
    for text in ("error[D061]: the library `./law.so` of the material `clay` has not been loaded",
                 "its code would run as part of this program", "--allow-libraries", "MPM_ALLOW_LIBRARIES=1"):
        assert text in process.stderr, process.stderr
    # With consent, the library is loaded and turns out to be none.
    process = mpm(words[0], path, *words[1:], "--allow-libraries")
    assert process.returncode != 0 and trace.exists(), process.stderr
    assert "it has no function `mpm_law_abi`" in process.stderr, process.stderr


def test_the_hash_is_that_of_what_was_loaded(mpm, deck, tmp_path):
    """A library that replaces its own file while it is loaded: the copy that was read is loaded and recorded."""
    target, hashes = tmp_path / "law.so", []
    for replaces in (False, True):
        flags = []
        if replaces:
            flags = [f'-DREPLACED="{target}"']
        source = tmp_path / "law.c"
        text = (LAWS / "law.c").read_text()
        source.write_text(text + """
#ifdef REPLACED
#include <stdio.h>
__attribute__((constructor)) static void replace(void)
{
    FILE *file = fopen(REPLACED, "w");
    if (file) { fputs("something else", file); fclose(file); }
}
#endif
""")
        compiled(source, target, *flags)
        before = target.read_bytes()
        results, _ = ran(mpm, deck(block(**library_law("./law.so", **PLASTIC))))
        (library,) = results.summary["law_libraries"]
        assert library["hash"] == fnv1a(before)
        assert (target.read_bytes() == before) != replaces


def fnv1a(data):
    """The 128-bit FNV-1a hash as text."""
    value = 0x6C62272E07BB014262B821756295C58D
    for byte in data:
        value = (value ^ byte) * 0x0000000001000000000000000000013B % 2**128
    return f"{value:032x}"


def test_an_abort_in_a_library_is_no_lack_of_memory(mpm, deck, tmp_path):
    source = tmp_path / "aborts.c"
    text = (LAWS / "law.c").read_text()
    head, tail = text.split("int32_t mpm_law_update(", 1)
    body, rest = tail.split("{", 1)
    # Aborts once a point has been compressed, long after the check.
    source.write_text(f"#include <stdlib.h>\n{head}int32_t mpm_law_update({body}{{\n    if (trial[1] < -0.02) abort();{rest}")
    compiled(source, tmp_path / "law.so")
    out = tmp_path / "out"
    process = mpm("run", deck(block(**library_law("./law.so", **PLASTIC))), "--out", out)
    assert process.returncode == 1, process.stderr
    assert "aborted (SIGABRT)" in process.stderr and "not enough memory" not in process.stderr, process.stderr
    assert "S008" not in process.stderr and len(Results(out).history["step"]) > 1


def test_files_that_are_no_libraries_are_refused(mpm, deck, tmp_path):
    path = deck(block(**library_law("./law.so", **ELASTIC)))
    refused(mpm, path, "D061", "the library `./law.so` cannot be read: No such file", "relative to the deck")
    (tmp_path / "law.so").write_text("not a library")
    refused(mpm, path, "D061", "cannot be used: it cannot be loaded: ", "law.so", "cc -O2 -shared -fPIC")
    (tmp_path / "law.so").unlink()
    (tmp_path / "law.so").mkdir()
    refused(mpm, path, "D061", "not a file")
    (tmp_path / "law.so").rmdir()
    os.mkfifo(tmp_path / "law.so")
    refused(mpm, path, "D061", "not a file")


PARAMETERS = [
    ({"young": 1e6}, ["needs the parameter `poisson`", "add `poisson`, [-], to `parameters`"]),
    (ELASTIC | {"density": 1}, ["has no parameter `density`", "are `young`, `poisson`, `deviatoric_yield_stress`"]),
    (ELASTIC | {"hardening_modulus": 0, "deviatoric_yeld_stress": 2e4}, ["did you mean `deviatoric_yield_stress`?"]),
    (PLASTIC | {"hardening_modulus": -1}, ["rejects its parameters: hardening_modulus must be at least 0"]),
    ({}, ["needs the parameter `young`", "needs the parameter `hardening_modulus`"]),
]


@pytest.mark.parametrize("parameters, texts", PARAMETERS)
def test_parameters_that_do_not_fit_are_refused(mpm, deck, tmp_path, parameters, texts):
    compiled(LAWS / "law.c", tmp_path / "law.so")
    said = refused(mpm, deck(block(**library_law("law.so", **parameters))), "D062", *texts)
    if "did you mean" in texts[0]:
        assert "needs the parameter" not in said, "a misspelt parameter is not missing, too"


WARNINGS = {
    "WRONG_TANGENT": "its tangent is not the derivative of the stress (relative error",
    "NOT_SYMMETRIC": "its tangent is not symmetric, although it is declared symmetric",
    "NOT_PURE": "equal arguments give different results",
    "NOT_FOR_THREADS": "its results change when several threads evaluate it at once",
}


@pytest.mark.parametrize("fault", WARNINGS)
def test_laws_that_lack_a_property_are_noticed(mpm, deck, tmp_path, fault):
    compiled(FAULTY, tmp_path / "law.so", f"-D{fault}")
    path = deck(block(**library_law("law.so", **ELASTIC)))
    process = mpm("check", path)
    assert process.returncode == 0, process.stderr
    assert "warning[D063]: the law of the material `clay`: " + WARNINGS[fault] in process.stderr, process.stderr
    denied = mpm("check", path, "--deny-warnings")
    assert denied.returncode == 2
    if fault == "NOT_SYMMETRIC":
        assert "a rotated strain does not give the rotated stress" in process.stderr


def test_a_law_without_response_cuts_the_step_and_ends_the_run(mpm, deck, tmp_path):
    reasons = {
        "NO_NUMBER": "the response of the law to the trial elastic strain is not finite",
        "REFUSES": "the law rejects the trial elastic strain (error number 7)",
    }
    for fault, reason in reasons.items():
        compiled(FAULTY, tmp_path / f"{fault}.so", f"-D{fault}=0.03")
        content = block(**library_law(f"{fault}.so", **ELASTIC))
        content["steps"]["smallest"] = 0.05
        path = deck(content, f"{fault}.yaml")
        out = path.with_suffix(".out")
        process = mpm("run", path, "--out", out)
        assert process.returncode == 1
        assert reason in process.stderr, process.stderr
        summary = json.loads((out / "summary.json").read_text())
        assert summary["outcome"] == "failed" and reason in summary["reason"]
        assert summary["failed_attempts"] > 1 and summary["steps"] >= 3, "steps were cut before"
        assert summary["diagnosis"]["kind"] == "refused-by-law", "it is not the grid that inverts"
        assert f"diagnosis: the law of a point rejects its strain: {reason}" in process.stderr


@pytest.mark.parametrize(
    "fault, reason",
    [("ALWAYS_REFUSES", "(error number 42)"), ("NEVER_A_NUMBER", "to the trial elastic strain is not finite")],
)
def test_a_law_that_never_responds_is_refused(mpm, deck, tmp_path, fault, reason):
    compiled(FAULTY, tmp_path / "law.so", f"-D{fault}")
    refused(mpm, deck(block(**library_law("law.so", **ELASTIC))), "D063", "it cannot be evaluated at zero strain: ", reason)


def test_results_do_not_depend_on_the_number_of_threads(mpm, deck, tmp_path):
    compiled(LAWS / "law.c", tmp_path / "law.so")
    path = deck(block("solid", **library_law("law.so", **PLASTIC)))
    values = []
    for threads in (1, 4):
        results, _ = ran(mpm, path, "--threads", threads)
        values.append(results.mesh("points", -1)["cauchy_stress"])
    np.testing.assert_array_equal(*values)


def test_members_of_a_study_share_a_library(mpm, deck, tmp_path):
    compiled(LAWS / "law.c", tmp_path / "law.so")
    content = block(**library_law("law.so", **PLASTIC | {"young": "${e}"}))
    content["parameters"] = {"e": 1e6}
    process = mpm("sweep", deck(content), "--over", "e=1e6,2e6", "--out", tmp_path / "study")
    assert process.returncode == 0, process.stderr
