"""Laws written in Python: the answers of those of the library, and what happens to bad ones."""

import pickle
import traceback

import numpy as np
import pytest

from laws_in_python import Hencky, VonMises
from package import assert_same_points, column, load, mpm, worst
from test_package_runs import slope

ELASTIC = {"young": 1e6, "poisson": 0.3}
PLASTIC = ELASTIC | {"deviatoric_yield_stress": 2e4, "hardening_modulus": 2e5}
PARAMETERS = {"hencky": ELASTIC, "von-mises": PLASTIC}


def law(kind, model, parameters=None):
    """A law in NumPy, one compiled by Numba, or that of the library as a law in Python."""
    parameters = parameters or PARAMETERS[model]
    if kind == "library":
        return mpm.BuiltInLaw(model, **parameters)
    if kind == "numba":
        pytest.importorskip("numba")
        import laws_in_numba

        classes = {"hencky": laws_in_numba.CompiledHencky, "von-mises": laws_in_numba.CompiledVonMises}
    else:
        classes = {"hencky": Hencky, "von-mises": VonMises}
    return classes[model](**parameters)


@pytest.mark.parametrize("kind", ["numpy", "numba"])
@pytest.mark.parametrize("model", ["hencky", "von-mises"])
def test_laws_respond_alike(kind, model):
    some, other = law(kind, model), law("library", model)
    random = np.random.default_rng(7)
    history = random.random((5000, len(other.state))) * 0.1
    for size in (1e-6, 1e-4, 1e-2, 0.1):
        strain = random.normal(size=(5000, 6)) * size
        expected = other.update(strain, history)
        for values, reference in zip(some.update(strain, history), expected):
            scale = np.abs(reference).reshape(5000, -1).max(axis=1, initial=0.0)
            difference = np.abs(values - reference).reshape(5000, -1).max(axis=1, initial=0.0)
            assert (difference <= 1e-14 * scale).all(), (size, (difference / scale.clip(1e-300)).max())
        if model == "von-mises":
            _, _, elastic, new = expected
            np.testing.assert_allclose(some.energy(elastic), other.energy(elastic), rtol=1e-13)
            np.testing.assert_allclose(some.plastic_work(new), other.plastic_work(new), rtol=1e-13)
            assert (new > history).any() == (size > 1e-3)


def block(idealisation, volumetric, model, **body):
    """A block on a rough base that is pressed flat. Hardening and stabilisation keep its equations well conditioned, so
    that they do not amplify the round-off in which two laws differ; a perfectly plastic block would, at its limit load.
    """
    axes = "xyz" if idealisation == "solid" else "xy"
    up, count = axes[-1], len(axes)
    conditions = [
        {"name": "axis", "nodes": {"x": 0}, "fix": ["x"]},
        {"name": "base", "nodes": {up: 0}, "fix": list(axes)},
        {"name": "press", "nodes": {up: 1}, f"u{up}": -0.05},
    ]
    if idealisation == "solid":
        conditions.append({"name": "back", "nodes": {"y": 0}, "fix": ["y"]})
    shape = {"type": "box", "min": [0] * count, "max": [1] * count}
    method = {"method": "gimp", "points_per_cell": 2, **body}
    return mpm.Deck(
        {
            "version": 1,
            "analysis": {"stabilisation": {"mode": "auto"}, "idealisation": idealisation},
            "grid": {
                "type": "structured",
                "origin": [0] * count,
                "size": [2] * (count - 1) + [1.5],
                "spacing": 0.5 if idealisation == "solid" else 0.25,
            },
            "materials": {"metal": {"model": model, "density": 1000, **PARAMETERS[model]}},
            "bodies": [{"name": "block", "material": "metal", "strain": volumetric, "shape": shape, **method}],
            "boundary_conditions": conditions,
            "loads": [{"name": "weight", "type": "gravity", "acceleration": [0] * (count - 1) + [-10]}],
            "steps": {"count": 5},
            "solver": {"tolerance": 1e-11},
        }
    )


BLOCKS = [
    (idealisation, volumetric, model, method)
    for idealisation in ("plane-strain", "axisymmetric", "solid")
    for volumetric in ("standard", "mean-dilatation", "f-bar")
    for model in ("hencky", "von-mises")
    for method in ("gimp", "mpm")
    if (idealisation, volumetric) != ("solid", "f-bar")
]


@pytest.mark.parametrize(("idealisation", "volumetric", "model", "method"), BLOCKS)
def test_runs_with_laws_in_python_are_alike(idealisation, volumetric, model, method):
    deck = block(idealisation, volumetric, model, method=method)
    expected = deck.run(threads=1)
    for kind, threads in (("numpy", 1), ("library", 2)):
        found = deck.run(laws={"metal": law(kind, model)}, threads=threads)
        assert found.summary["iterations"] == expected.summary["iterations"]
        assert worst(found.points, expected.points, "position") < 1e-12
        assert worst(found.points, expected.points, "cauchy_stress") < 1e-12
        for name in ("external_work", "strain_energy"):
            np.testing.assert_allclose(found.history[name], expected.history[name], rtol=1e-11)
        for name in ("plastic_work", "strain_energy"):
            assert found.summary[name] == pytest.approx(expected.summary[name], rel=1e-11)
        if kind == "library":
            assert_same_points(found.points, expected.points)
            assert found.history == expected.history
    if model == "von-mises":
        assert expected.points["equivalent_plastic_strain"].max() > 0.02


DECKS = [
    ("beam", {"steps": 10}, {"steel": ("hencky", {"young": 12e6, "poisson": 0.2})}),
    ("annulus", {}, {"rubber": ("hencky", {"young": 1, "poisson": 0})}),
    ("compaction", {}, {"soil": ("hencky", {"young": 1e6, "poisson": 0})}),
    (
        "cylinder",
        {},
        {"metal": ("von-mises", dict(young=1, poisson=0.3, deviatoric_yield_stress=0.2, hardening_modulus=0.1))},
    ),
    ("shear", {"yield": 1e3}, {"sample": ("von-mises", dict(young=1e4, poisson=0.3, deviatoric_yield_stress=1e3))}),
    (
        "collapse",
        {"h": 1, "n": 3, "steps": 20},
        {"clay": ("von-mises", dict(young=1e6, poisson=0.3, deviatoric_yield_stress=20e3))},
    ),
]


@pytest.mark.parametrize("kind", ["numpy", "numba"])
@pytest.mark.parametrize(("name", "parameters", "laws"), DECKS, ids=[name for name, *_ in DECKS])
def test_decks_run_with_laws_in_python(kind, name, parameters, laws):
    """Decks whose equations do not amplify round-off: none is at a limit load or of nearly incompressible material."""
    deck = load(name, **parameters)
    expected = deck.run(threads=2)
    found = deck.run(threads=2, laws={material: law(kind, *of) for material, of in laws.items()})
    assert found.summary["iterations"] == expected.summary["iterations"]
    assert worst(found.points, expected.points, "position") < 1e-12
    assert worst(found.points, expected.points, "cauchy_stress") < 1e-12


def test_threads_do_not_change_the_bits_of_a_law():
    deck = block("plane-strain", "mean-dilatation", "von-mises")
    some, others = (deck.run(threads=n, laws={"metal": law("numpy", "von-mises")}) for n in (1, 2))
    assert_same_points(some.points, others.points)
    assert some.history == others.history


def test_a_law_is_called_once_per_evaluation_with_all_its_points():
    sizes = []

    class Counting(Hencky):
        def update(self, strain, history):
            sizes.append((strain.shape, history.shape, strain.flags.writeable, history.flags.writeable))
            return super().update(strain, history)

    deck = load("footing", steps=1, depth=1e-4)
    run = deck.start(laws={"concrete": Counting(young=1e9, poisson=0.2)})
    bodies = run.points.body
    steps = list(run)
    concrete = int((bodies > 0).sum())
    # Single points are for the stiffness of the material, before the run.
    calls = [of for of in sizes if of != ((1, 6), (1, 0), False, False)]
    assert set(calls) == {((concrete, 6), (concrete, 0), False, False)}
    assert len(calls) == sum(len(step.residuals) for step in steps)


def test_tensors_are_rows_in_the_stated_order():
    """Stress and strain of a law have the components of the points, apart from the factors √2."""
    seen = []

    class Watched(Hencky):
        def update(self, strain, history):
            response = super().update(strain, history)
            seen.append((strain.copy(), response[0]))
            return response

    deck = block("solid", "standard", "hencky")
    run = deck.start(laws={"metal": Watched(**ELASTIC)}, threads=1)
    for _ in run:
        pass
    factors = np.sqrt([1, 1, 1, 2, 2, 2])
    for rows, name in zip(zip(*seen[-3:]), ("elastic_strain", "kirchhoff_stress")):
        points = run.points[name] * factors
        gaps = [np.abs(np.sort(row, axis=0) - np.sort(points, axis=0)).max() for row in rows]
        assert min(gaps) < 1e-9 * np.abs(points).max(), (name, gaps)


class Faulty(VonMises):
    """A law with a fault that a subclass plants."""

    def __init__(self):
        super().__init__(**PLASTIC)
        self.calls = 0

    def update(self, strain, history):
        self.calls += 1
        return self.spoil(strain, *map(np.array, super().update(strain, history)))


class WrongTangent(Faulty):
    def spoil(self, strain, stress, tangent, elastic, history):
        return stress, tangent * (1 + 1e-5), elastic, history


class Asymmetric(Faulty):
    def spoil(self, strain, stress, tangent, elastic, history):
        tangent[:, 0, 1] *= 1 + 1e-8
        return stress, tangent, elastic, history


class KeepsState(Faulty):
    def spoil(self, strain, stress, tangent, elastic, history):
        return stress * (1 + 1e-12 * self.calls), tangent, elastic, history


class DependsOnBatch(Faulty):
    def spoil(self, strain, stress, tangent, elastic, history):
        return stress * (1 + 1e-9 * (len(strain) - 1)), tangent, elastic, history


class DependsOnNeighbours(Faulty):
    def spoil(self, strain, stress, tangent, elastic, history):
        return stress, tangent, elastic, history + 1e-9 * (len(strain) > 1)


class WrongEnergy(Faulty):
    def spoil(self, *response):
        return response[1:]

    def energy(self, strain):
        return super().energy(strain) * 1.001


class Anisotropic(Faulty):
    def spoil(self, strain, stress, tangent, elastic, history):
        stress[:, 0] *= 1.01
        tangent[:, 0, :] *= 1.01
        return stress, tangent, elastic, history


class WrongElasticStrain(Faulty):
    def spoil(self, strain, stress, tangent, elastic, history):
        return stress, tangent, elastic * 1.0001, history


class Silent(Faulty):
    def spoil(self, strain, stress, tangent, elastic, history):
        return stress * np.nan, tangent, elastic, history


FAULTS = [
    (WrongTangent, "Tangent"),
    (Asymmetric, "Symmetry"),
    (KeepsState, "Purity"),
    (DependsOnBatch, "Batch"),
    (DependsOnNeighbours, "Batch"),
    (WrongEnergy, "Potential"),
    (Anisotropic, "Isotropy"),
    (WrongElasticStrain, "Admissibility"),
    (Silent, "Response"),
]


@pytest.mark.parametrize(("faulty", "lacks"), FAULTS, ids=[faulty.__name__ for faulty, _ in FAULTS])
def test_the_check_finds_planted_faults(faulty, lacks):
    findings = mpm.testing.check_material(faulty())
    assert lacks in [found.property for found in findings], [str(found) for found in findings]
    found = next(found for found in findings if found.property == lacks)
    assert found.error > found.tolerance and found.strain.shape == (6,) and lacks in str(found)


@pytest.mark.parametrize("kind", ["numpy", "numba", "library"])
@pytest.mark.parametrize("model", ["hencky", "von-mises"])
def test_the_check_passes_good_laws(kind, model):
    assert mpm.testing.check_material(law(kind, model)) == []


@pytest.mark.parametrize("largest", [0.05, 0.01, 0.001])
def test_the_check_passes_a_law_with_a_stress_at_zero_strain(largest):
    parameters = dict(compression_index=0.09, swelling_index=0.018, critical_state_ratio=1.05, shear_modulus=2e6)
    clay = mpm.BuiltInLaw("modified-cam-clay", **parameters, reference_pressure=1e5)
    assert mpm.testing.check_material(clay, largest=largest) == []


def test_the_check_passes_the_other_strain_measure():
    rubber = mpm.BuiltInLaw("neo-hookean", young=1e6, poisson=0.3)
    assert rubber.measure == "left-cauchy-green" and mpm.testing.check_material(rubber) == []
    deck = column()
    deck["materials"]["clay"]["model"] = "neo-hookean"
    expected = deck.run()
    found = deck.run(laws={"clay": rubber})
    assert worst(found.points, expected.points, "position") < 1e-12
    assert worst(found.points, expected.points, "cauchy_stress") < 1e-12


def test_an_asymmetric_law_may_say_so():
    class Open(Asymmetric):
        symmetric = False

    assert "Symmetry" not in [found.property for found in mpm.testing.check_material(Open())]
    assert block("plane-strain", "standard", "von-mises").run(laws={"metal": Open()}).summary["outcome"] == "completed"


class Failing(Hencky):
    """A law that fails at one call, and not at those before and after it."""

    def __init__(self, at, fail):
        super().__init__(**ELASTIC)
        self.left, self.fail = at, fail

    def update(self, strain, history):
        self.left -= 1
        return self.fail(*super().update(strain, history)) if self.left == 0 else super().update(strain, history)


def raising(stress, tangent):
    raise LookupError("the table ends here")


WRONG = {
    "exception": (raising, LookupError, "the table ends here"),
    "shape of the stress": (lambda s, t: (s[:-1], t), mpm.UsageError, "stress .* has shape"),
    "flat tangent": (lambda s, t: (s, t.reshape(-1, 36)), mpm.UsageError, "tangent .* has shape"),
    "three results": (lambda s, t: (s, t, s), mpm.UsageError, "must return"),
    "a list": (lambda s, t: [s, t], mpm.UsageError, "must return"),
    "nothing": (lambda s, t: None, mpm.UsageError, "must return"),
    "no stress": (lambda s, t: (None, t), mpm.UsageError, "stress .* not an array"),
    "words": (lambda s, t: ("word", t), ValueError, "word"),
    "complex": (lambda s, t: (s * 1j, t), mpm.UsageError, "real"),
    "history without variables": (lambda s, t: (s, t, s, np.zeros((len(s), 1))), mpm.UsageError, "history .* shape"),
}


@pytest.mark.parametrize("call", [7, 10])  # of one point for diagnostics, of all points amid a step
@pytest.mark.parametrize("name", WRONG)
def test_a_law_that_fails_ends_the_run_with_its_cause(name, call):
    fail, kind, text = WRONG[name]
    run = column().start(laws={"clay": Failing(call, fail)})
    with pytest.raises(mpm.SolveError) as raised:
        list(run)
    cause = raised.value.__cause__
    assert isinstance(cause, kind)
    pytest.raises(kind, lambda: (_ for _ in ()).throw(cause)).match(text)
    if kind is LookupError:
        assert "raising" in "".join(traceback.format_exception(raised.value))
    # It is over; the last state in equilibrium stays.
    assert run.ended and list(run) == [] and run.result().summary["outcome"] == "failed"
    assert len(run.points.position) == 8 and len(run.history) > 0


@pytest.mark.parametrize("name", WRONG)
def test_a_law_that_fails_at_once_is_heard_before_the_run(tmp_path, name):
    fail, kind, text = WRONG[name]
    with pytest.raises(kind, match=text):
        column().start(laws={"clay": Failing(1, fail)}, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_row_that_is_no_number_cuts_the_step():
    class Refusing(Hencky):
        """Refuses strains that grow by more than 1 % in a step: a point remembers its strain."""

        state = {"size": 0.0}

        def update(self, strain, history):
            stress, tangent = super().update(strain, history)
            size = np.linalg.norm(strain, axis=1)
            stress[size > history[:, 0] + 0.01] = np.nan
            return stress, tangent, strain, size[:, None]

    deck = column(steps={"count": 1})
    run = deck.start(laws={"clay": Refusing(**ELASTIC)})
    sizes = [0.0] + [run.points["size"].max() for _ in run]
    result = run.result()
    assert len(sizes) > 2 and result.summary["failed_attempts"] > 0 and result.summary["outcome"] == "completed"
    assert np.diff(sizes).max() <= 0.01 < sizes[-1]
    # Two halves of the step, as if the deck had asked for them.
    assert run.history["time"][-2:].tolist() == [0.5, 1]
    expected = column(steps={"count": 2}).run().points
    np.testing.assert_allclose(run.points.position, expected.position, rtol=1e-12)
    assert "size" in dict(run.points)


def test_laws_are_refused_before_the_run():
    deck = column()
    with pytest.raises(mpm.UsageError, match="no material \"iron\"; the only material is \"clay\""):
        deck.start(laws={"iron": law("numpy", "hencky")})
    for bad, text in [
        (None, "no method `update`"),
        (type("Law", (), {"update": 3})(), "no method `update`"),
        (type("Law", (Hencky,), {"state": ["a"]})(**ELASTIC), "state"),
        (type("Law", (Hencky,), {"state": {"a": "b"}})(**ELASTIC), "initial value of 'a'"),
        (type("Law", (Hencky,), {"state": {"a": np.nan}})(**ELASTIC), "initial value of 'a'"),
        (type("Law", (Hencky,), {"measure": "green"})(**ELASTIC), "measure"),
    ]:
        with pytest.raises(mpm.UsageError, match=text):
            deck.start(laws={"clay": bad})


SOIL = {"cohesion": 10e3, "friction_angle": 20, "dilation_angle": 0}
STIFF = {"young": 1e8, "poisson": 0.3}


@pytest.mark.parametrize("of_deck", ["mohr-coulomb", "hencky"])
def test_the_strength_of_a_law_of_the_library_is_reduced(of_deck):
    deck = slope()
    expected = deck.run(threads=1)
    if of_deck == "hencky":
        deck["materials"]["soil"] = {"model": "hencky", "density": 2000, **STIFF}
    found = deck.run(laws={"soil": mpm.BuiltInLaw("mohr-coulomb", **STIFF, **SOIL)}, threads=1)
    of = [result.summary["strength_reduction"] for result in (found, expected)]
    assert all(bracket.pop("cpu_seconds") > 0 for bracket in of)
    assert of[0] == of[1] and of[0]["fails"] is not None
    assert_same_points(found.points, expected.points)


@pytest.mark.parametrize("others", [False, True])
def test_a_law_whose_strength_cannot_be_reduced_is_refused(others):
    deck, name = slope(), "soil"
    if others:  # a material of the deck has a strength
        name = "rock"
        deck["materials"]["rock"] = {"model": "hencky", "density": 2000, **STIFF}
        shape = {"type": "box", "min": [0, 10], "max": [4, 12]}
        deck["bodies"].append({"name": "block", "material": "rock", "shape": shape, "points_per_cell": 2})
    with pytest.raises(mpm.DeckError, match=f"strength of the material `?{name}`? cannot be reduced") as raised:
        deck.start(laws={name: Hencky(**STIFF)})
    assert raised.value.code == "D049" and "mpm.BuiltInLaw" in raised.value.help
    if not others:
        with pytest.raises(mpm.DeckError, match="no material has a strength") as raised:
            deck.start(laws={name: mpm.BuiltInLaw("hencky", **STIFF)})
        assert raised.value.code == "D049"


def test_the_plastic_work_of_removed_bodies_is_exchanged():
    box = {"type": "box", "min": [0, 0], "max": [2, 1]}
    deck = mpm.Deck(
        {
            "version": 1,
            "analysis": {"stabilisation": {"mode": "off"}},
            "grid": {"type": "structured", "origin": [0, 0], "size": [4, 4], "spacing": 0.5},
            "materials": {
                "metal": {"model": "von-mises", "density": 1000, **PLASTIC, "deviatoric_yield_stress": 5e3},
                "base": {"model": "hencky", "density": 1000, **ELASTIC},
            },
            "bodies": [
                {"name": "low", "material": "base", "shape": box, "points_per_cell": 2},
                {"name": "up", "material": "metal", "shape": box | {"min": [0, 1], "max": [2, 2]}, "points_per_cell": 2},
            ],
            "boundary_conditions": [
                {"name": "floor", "nodes": {"y": 0}, "fix": ["x", "y"]},
                {"name": "left", "nodes": {"x": 0}, "fix": ["x"]},
            ],
            "loads": [{"name": "weight", "type": "gravity", "acceleration": [0, -20]}],
            "stages": [
                {"name": "load", "steps": {"count": 5}, "factors": {"weight": 1}},
                {"name": "cut", "steps": {"count": 5}, "remove": ["up"]},
            ],
        }
    )
    expected = deck.run(threads=1)
    found = deck.run(laws={"metal": VonMises(**PLASTIC | {"deviatoric_yield_stress": 5e3})}, threads=1)
    exchanged = [result.summary["stages"]["exchanged_energy"] for result in (found, expected)]
    assert exchanged[0] == pytest.approx(exchanged[1], rel=1e-9)
    work = expected.quality["plastic_work"]
    assert work[4] > 0.01 * abs(exchanged[1]), "the removed body has yielded"
    np.testing.assert_allclose(found.quality["energy_error"], expected.quality["energy_error"], atol=1e-9)
    assert [of["code"] for of in found.summary["warnings"]] == [of["code"] for of in expected.summary["warnings"]]


class FailingEnergy(Hencky):
    """A law whose energy fails at the end of the third step, then always or only once."""

    def __init__(self, fail, times):
        super().__init__(**ELASTIC)
        # The first call is made before the run.
        self.calls, self.fail, self.failing = 0, fail, range(4, 4 + times)

    def energy(self, strain):
        self.calls += 1
        return self.fail(len(strain)) if self.calls in self.failing else super().energy(strain)


def raising_energy(n):
    raise LookupError("no energy")


@pytest.mark.parametrize("times", [1, 1000])
@pytest.mark.parametrize("writes", [False, True])
@pytest.mark.parametrize("fail", [raising_energy, lambda n: np.full(n, np.nan), lambda n: np.full(n, np.inf)])
def test_an_energy_that_fails_ends_the_run_at_its_step(tmp_path, fail, writes, times):
    out = tmp_path / "out" if writes else None
    run = column().start(laws={"clay": FailingEnergy(fail, times)}, out=out, threads=1)
    with pytest.raises(mpm.SolveError, match="law of material `clay` has failed") as raised:
        list(run)
    assert raised.value.code == "S019" and run.step.index == 2
    assert isinstance(raised.value.__cause__, LookupError if fail is raising_energy else type(None))
    for result in [run.result()] + ([mpm.read(out)] if writes else []):
        assert (result.summary["outcome"], result.summary["code"], result.summary["steps"]) == ("failed", "S019", 2)
        assert result.history["converged"].tolist() == [1, 1, 0]
        assert np.isfinite(result.history["strain_energy"][:2]).all() and len(result.quality["step"]) == 2


@pytest.mark.parametrize(
    ("fail", "kind"), [(raising_energy, LookupError), (lambda n: np.zeros(n), mpm.UsageError)], ids=["raises", "shape"]
)
def test_an_elastic_strain_that_fails_is_the_cause_of_the_error(fail, kind):
    class Inverse(Hencky):
        fails = True

        def elastic_strain(self, stress):
            return fail(6) if self.fails else mpm.BuiltInLaw("hencky", **ELASTIC).elastic_strain(stress)

    deck, law = column(), Inverse(**ELASTIC)
    deck["bodies"][0]["initial_stress"] = {"type": "geostatic", "surface": 2, "k0": 3 / 7}
    with pytest.raises(mpm.DeckError) as raised:
        deck.start(laws={"clay": law})
    assert raised.value.code == "D051" and isinstance(raised.value.__cause__, kind)
    law.fails = False
    with deck.start(laws={"clay": law}) as run:
        next(run)
        law.fails = True
        with pytest.raises(mpm.DeckError) as raised:
            run.change()
        assert isinstance(raised.value.__cause__, kind)
        law.fails = False
        assert len(list(run)) == 3


SAND = {**ELASTIC, "cohesion": 1e3, "friction_angle": 30, "dilation_angle": 5}
WORDS = {
    "match": ("drucker-prager", {**SAND, "match": "plane-strain"}),
    "strength": ("mohr-coulomb", {**SAND, "strength": "kirchhoff"}),
    "softening": ("tresca", {**ELASTIC, "cohesion": 2e3, "softening": {"strain": 0.5, "residual_cohesion": 1e3}}),
}


@pytest.mark.parametrize("word", WORDS)
def test_properties_of_laws_may_be_words_and_mappings(word):
    model, parameters = WORDS[word]
    deck = column()
    deck["materials"]["clay"] = {"model": model, "density": 1000, **parameters}
    expected = deck.run(threads=1)
    law = pickle.loads(pickle.dumps(mpm.BuiltInLaw(model, **parameters)))
    assert f"{word}={parameters[word]!r}" in repr(law)
    assert_same_points(column().run(laws={"clay": law}, threads=1).points, expected.points)
    assert mpm.testing.check_material(law, largest=0.01) == []
    for bad in (3, None, "cone", ["plane-strain"], {"strain": "0.5"}, {"band": 1.0}):
        with pytest.raises(mpm.UsageError):
            mpm.BuiltInLaw(model, **parameters | {word: bad})
