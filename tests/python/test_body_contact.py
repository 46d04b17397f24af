"""Bodies that touch, slide and part: closed forms, balances and what the results say about a pair of bodies.

Errors against closed forms are those of the program at its default tolerance; the text of each test says what limits them.
"""

import hashlib
import itertools
import math

import numpy as np
import pytest
import yaml

from results import Results

METHODS = ("gimp", "cpdi1", "cpdi2")


def elastic(young, poisson=0.0, **rest):
    return {"model": "hencky", "young": young, "poisson": poisson, **rest}


def body(name, shape, method, spacing, material):
    return {"name": name, "material": material, "method": method, "point_spacing": spacing, "shape": shape}


def box(low, high):
    return {"type": "box", "min": low, "max": high}


def edge(name, of, number):
    return {"name": name, "body": of, "part": {"edge": number}}


@pytest.fixture(scope="module")
def run(mpm, tmp_path_factory):
    """Runs a deck and returns its results; the outcome must be the expected one."""

    def results(deck, code=0, **options):
        folder = tmp_path_factory.mktemp("contact")
        (folder / "deck.yaml").write_text(yaml.safe_dump(deck))
        process = mpm("run", folder / "deck.yaml", "--out", folder / "out", **options)
        assert process.returncode == code, process.stderr
        return Results(folder / "out") if code == 0 else process.stderr

    return results


# Two blocks of unequal stiffness, one on the other, whose points do not match.
YOUNG, HEIGHTS, WAY = (1e6, 3e6), (1.0, 0.8), 0.3


def stretches():
    """Stretches of both blocks whose Cauchy stress E ln(λ)/λ is equal and which shorten them by the way together."""
    low, high = 0.3, 1.0
    for _ in range(200):
        first = 0.5 * (low + high)
        second = (sum(HEIGHTS) - WAY - first * HEIGHTS[0]) / HEIGHTS[1]
        too_soft = YOUNG[0] * math.log(first) / first > YOUNG[1] * math.log(second) / second
        low, high = (low, first) if too_soft else (first, high)
    return first, second


STRETCHES = stretches()
STRESS = YOUNG[0] * math.log(STRETCHES[0]) / STRETCHES[0]


def stacked(methods=("cpdi2", "cpdi2"), offset=0.1, friction=0.0, **rest):
    """The lower block is one metre high; the line of the interface lies `offset` above a line of the grid."""
    h = 0.2
    return {
        "version": 1,
        "grid": {"type": "structured", "origin": [0, -offset], "size": [1.6, 2.2], "spacing": h},
        "materials": {"soft": elastic(YOUNG[0]), "stiff": elastic(YOUNG[1])},
        "bodies": [
            body("lower", box([0, 0], [1, 1]), methods[0], h / 2, "soft"),
            body("upper", box([0, 1], [1, 1.8]), methods[1], h / 3, "stiff"),
        ],
        "surfaces": [edge("base", "lower", 0), edge("top", "upper", 2)],
        "boundary_conditions": [
            {"name": "base", "surface": "base", "uy": 0},
            {"name": "left", "nodes": {"x": 0}, "fix": ["x"]},
            {"name": "drag", "surface": "top", "uy": -WAY},
        ],
        "contacts": [{"between": ["lower", "upper"], "friction": friction}],
        "steps": {"count": 4},
        **rest,
    }


def test_the_reference_of_the_patch_test():
    assert STRESS == pytest.approx(-328005.37, abs=0.005)
    assert STRETCHES[0] == pytest.approx(0.775425, abs=5e-7)
    assert STRETCHES[1] * HEIGHTS[1] == pytest.approx(0.724575, abs=5e-7)


@pytest.mark.parametrize("offset", [0.0, 0.06, 0.1])
@pytest.mark.parametrize("methods", itertools.product(METHODS, METHODS), ids="-".join)
def test_a_uniform_stress_passes_between_bodies(run, methods, offset):
    """Blocks of unequal stiffness, points that do not match, an interface anywhere in a cell."""
    results = run(stacked(methods, offset))
    stress = results.mesh("points", -1)["cauchy_stress"]
    np.testing.assert_allclose(stress[:, 1], STRESS, rtol=1e-9)
    np.testing.assert_allclose(stress[:, [0, 2, 3]], 0, atol=1e-9 * abs(STRESS))
    history = results.history
    assert history["lower_on_upper_fy"][-1] == pytest.approx(-STRESS, rel=1e-9)
    assert history["lower_on_upper_area"][-1] == pytest.approx(1, rel=1e-9)
    contacts = results.mesh("contacts", -1)
    np.testing.assert_allclose(contacts["pressure"], -STRESS, rtol=1e-9)


@pytest.mark.parametrize("methods", [("cpdi1", "cpdi2"), ("cpdi2", "cpdi2")], ids="-".join)
def test_a_uniform_stress_passes_between_bodies_at_an_angle(run, methods):
    """Domains of CPDI follow the outline of a body at any angle."""
    angle, h, pressure = math.radians(30), 0.2, 3e5
    c, s = math.cos(angle), math.sin(angle)

    def polygon(*corners):
        return {"type": "polygon", "vertices": [[1 + c * x - s * y, 0.3 + s * x + c * y] for x, y in corners]}

    deck = stacked() | {
        "grid": {"type": "structured", "origin": [0, 0], "size": [3, 3.2], "spacing": h},
        "bodies": [
            body("lower", polygon((0, 0), (1, 0), (1, 1), (0, 1)), methods[0], h / 2, "soft"),
            body("upper", polygon((0, 1), (1, 1), (1, 1.8), (0, 1.8)), methods[1], h / 3, "stiff"),
        ],
        "surfaces": [edge("base", "lower", 0), edge("one", "lower", 3), edge("two", "upper", 3), edge("top", "upper", 2)],
        "boundary_conditions": [{"name": name, "surface": name, "fix": "normal"} for name in ("base", "one", "two")],
        "loads": [{"name": "press", "type": "pressure", "surface": "top", "pressure": pressure}],
    }
    results = run(deck)
    across = np.array([-s, c])
    six = results.mesh("points", -1)["cauchy_stress"]
    exact = -pressure * np.array([s * s, c * c, 0, -s * c])
    np.testing.assert_allclose(six[:, :4], np.tile(exact, (len(six), 1)), atol=1e-9 * pressure)
    history = results.history
    force = np.array([history[f"lower_on_upper_f{axis}"][-1] for axis in "xy"])
    np.testing.assert_allclose(force, pressure * across, rtol=1e-9)


def mirrored(method, with_tool):
    """A body pressed against its mirror image, or against a smooth plane."""
    h = 0.2
    deck = {
        "version": 1,
        "grid": {"type": "structured", "origin": [0, -0.1], "size": [3, 3], "spacing": h},
        "materials": {"m": elastic(1e6, 0.3)},
        "bodies": [body("upper", box([0.6, 1], [2.4, 2]), method, h / 2, "m")],
        "surfaces": [edge("top", "upper", 2)],
        "boundary_conditions": [{"name": "drag", "surface": "top", "uy": -0.15, "ux": 0}],
        "steps": {"count": 4},
    }
    if with_tool:
        floor = {"type": "half-space", "point": [0, 1], "normal": [0, 1]}
        return deck | {"tools": [{"name": "floor", "shape": floor, "overlap": 1e-9}]}
    deck["bodies"].append(body("lower", box([0.6, 0], [2.4, 1]), method, h / 2, "m"))
    deck["surfaces"].append(edge("base", "lower", 0))
    deck["boundary_conditions"].append({"name": "base", "surface": "base", "uy": 0.15, "ux": 0})
    return deck | {"contacts": [{"between": ["lower", "upper"]}]}


@pytest.mark.parametrize("method, error", [("cpdi2", 1e-9), ("gimp", 1e-6), ("cpdi1", 1.5e-4)])
def test_a_mirror_image_is_a_smooth_plane(run, method, error):
    """Corners of CPDI2 are free of gaps. Boxes of GIMP and parallelograms of CPDI1 are new in each step, and neighbours do
    not meet at their corners: two bodies then touch at other places than a body touches a plane."""
    pair, plane = run(mirrored(method, False)), run(mirrored(method, True))
    for with_pair, with_plane in zip(pair.history["drag_ry"], plane.history["drag_ry"]):
        assert with_pair == pytest.approx(with_plane, rel=error)
    upper, alone = (of.mesh("points", -1) for of in (pair, plane))
    number = upper["body_id"] == 0
    np.testing.assert_allclose(
        upper["cauchy_stress"][number], alone["cauchy_stress"], atol=100 * error * abs(alone["cauchy_stress"]).max()
    )


SLOPE = {"friction": 0.3, "weight": 1000 * 9.81 * 2}


def on_a_slope(ratio, method="cpdi2"):
    """A block whose weight has a component along the plane that grows to `ratio` times what friction carries."""
    h, g = 0.25, 9.81
    along = {"force": [g * SLOPE["friction"] * ratio, 0], "curve": [[0, 0], [0.2, 0], [1, 1]]}
    weight = {"force": [0, -g], "curve": [[0, 0], [0.2, 1], [1, 1]]}
    load = {"type": "body-force", "bodies": ["upper"], "per": "mass"}
    return {
        "version": 1,
        "grid": {"type": "structured", "origin": [0, -0.5], "size": [6, 3], "spacing": h},
        "materials": {"rock": elastic(100e6, 0.3), "soil": elastic(1e6, 0.3, density=1000)},
        "bodies": [
            body("upper", box([2, 0.6], [4, 1.6]), method, h / 3, "soil"),
            body("lower", box([0, -0.4], [6, 0.6]), method, h / 2, "rock"),
        ],
        "surfaces": [edge("base", "lower", 0)],
        "boundary_conditions": [{"name": "base", "surface": "base", "ux": 0, "uy": 0}],
        "loads": [{"name": "weight", **load, **weight}, {"name": "along", **load, **along}],
        "contacts": [{"between": ["upper", "lower"], "friction": SLOPE["friction"]}],
        "steps": {"count": 5},
    }


@pytest.mark.parametrize("method", METHODS)
def test_a_block_stands_on_a_slope_that_friction_can_carry(run, method):
    """Nothing but contact holds the block. Its weight acts from the first step on."""
    results = run(on_a_slope(0.99, method))
    history = results.history
    np.testing.assert_allclose(history["upper_on_lower_fy"], -SLOPE["weight"], rtol=1e-8)
    expected = SLOPE["friction"] * SLOPE["weight"] * 0.99
    assert history["upper_on_lower_fx"][-1] == pytest.approx(expected, rel=1e-8)
    contacts = results.mesh("contacts", -1)
    limit = SLOPE["friction"] * contacts["pressure"]
    assert (np.linalg.norm(contacts["shear"], axis=1) <= limit * (1 + 1e-9)).all()


def test_a_block_slides_down_a_slope_that_friction_cannot_carry(mpm, tmp_path):
    """Equilibrium ends where the component along the slope exceeds friction, within the smallest step."""
    deck = on_a_slope(1.01) | {"steps": {"count": 5, "smallest": 0.25}}
    (tmp_path / "deck.yaml").write_text(yaml.safe_dump(deck))
    process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out")
    assert process.returncode == 1 and "error[S" in process.stderr, process.stderr
    carried = Results(tmp_path / "out").history["upper_on_lower_fx"].max() / (SLOPE["friction"] * SLOPE["weight"])
    assert 0.93 < carried < 1 + 1e-9


def dragged(method, **rest):
    """A soft block is pressed on a stiff one, and its top is drawn along."""
    h = 0.25
    return {
        "version": 1,
        "grid": {"type": "structured", "origin": [0, 0], "size": [6, 3], "spacing": h},
        "materials": {"stiff": elastic(100e6, 0.3), "soft": elastic(1e6, 0.3)},
        "bodies": [
            body("lower", box([0, 0], [6, 1]), method, h / 2, "stiff"),
            body("upper", box([2, 1], [4, 2]), method, h / 2, "soft"),
        ],
        "surfaces": [edge("top", "upper", 2)],
        "boundary_conditions": [
            {"name": "base", "nodes": {"y": 0}, "fix": ["x", "y"]},
            {"name": "drag", "surface": "top", "ux": 0.3, "curve": [[0, 0], [0.2, 0], [1, 1]]},
        ],
        "loads": [
            {"name": "press", "type": "traction", "surface": "top", "traction": [0, -20e3], "curve": [[0, 0], [0.2, 1], [1, 1]]}
        ],
        "contacts": [{"between": ["upper", "lower"], "friction": 0.3}],
        "steps": {"count": 10},
        **rest,
    }


@pytest.fixture(scope="module")
def dragged_block(run):
    return run(dragged("cpdi2"))


def test_friction_limits_the_force_of_a_dragged_block(dragged_block):
    """Facets of the lower block turn by some 10⁻³, and with them the direction of the friction."""
    history = dragged_block.history
    limit = 0.3 * 20e3 * 2
    assert history["drag_rx"][0] == pytest.approx(0, abs=1e-6 * limit)
    assert history["drag_rx"][-1] == pytest.approx(limit, rel=3e-4)
    assert history["drag_rx"].max() < limit * (1 + 3e-4)
    # Contact points that slide or part carry no more than friction allows.
    contacts = dragged_block.mesh("contacts", -1)
    shear, state = np.linalg.norm(contacts["shear"], axis=1), contacts["state"]
    assert (state == 2).any()
    np.testing.assert_allclose(shear[state == 2], 0.3 * contacts["pressure"][state == 2], rtol=1e-9, atol=1e-3)


def test_action_equals_reaction(dragged_block):
    history = dragged_block.history
    size = np.abs(history["upper_on_lower_fy"]).max()
    for axis in "xy":
        force = history[f"upper_on_lower_f{axis}"]
        np.testing.assert_allclose(history[f"base_r{axis}"], -force, atol=1e-9 * size)
    np.testing.assert_allclose(history["upper_on_lower_fx"], history["drag_rx"], atol=1e-9 * size)
    np.testing.assert_allclose(history["upper_on_lower_fy"], history["press_fy"], atol=1e-9 * size)
    quality = dragged_block.table("quality")
    assert quality["force_error"].max() < 1e-9 and quality["moment_error"].max() < 1e-9


def test_the_columns_of_a_pair(dragged_block):
    """The force is that of the first body on the second; the other columns are those of all contact points that touch."""
    history = dragged_block.history
    of_pair = [name for name in history if name.startswith("upper_on_lower_")]
    assert [name.removeprefix("upper_on_lower_") for name in of_pair] == ["fx", "fy", "contacts", "area", "overlap", "slip"]
    for step in range(1, len(history["time"]) + 1):
        contacts, row = dragged_block.mesh("contacts", step), step - 1
        assert contacts.n_points == history["upper_on_lower_contacts"][row]
        assert contacts["area"].sum() == pytest.approx(history["upper_on_lower_area"][row], rel=1e-12)
        assert max(0, -contacts["gap"].min()) == pytest.approx(history["upper_on_lower_overlap"][row], rel=1e-12)
        sticks = contacts["state"] == 1
        assert contacts["slip"][sticks].max(initial=0) == pytest.approx(history["upper_on_lower_slip"][row], rel=1e-12)
        sign = np.where(contacts["body"] == 0, 1, -1)  # The lower body is the second of the pair.
        force = (sign[:, None] * contacts["force"]).sum(axis=0)
        for axis, name in enumerate("xy"):
            assert force[axis] == pytest.approx(history[f"upper_on_lower_f{name}"][row], rel=1e-9, abs=1e-6)


def test_the_series_of_contact_points(dragged_block):
    contacts = dragged_block.mesh("contacts", -1)
    assert {"pair", "gap", "slip", "tool", "body", "point", "state", "normal", "force", "pressure", "shear", "area"} == set(
        contacts.point_data.keys()
    )
    assert (contacts["pair"] == 0).all() and (contacts["tool"] == -1).all()
    assert set(contacts["body"]) == {0, 1}, "corners of both bodies are contact points"
    np.testing.assert_allclose(np.linalg.norm(contacts["normal"], axis=1), 1, rtol=1e-12)
    # The normal points out of the body that is touched: up for points of the upper body.
    up = contacts["normal"][:, 1]
    assert (up[contacts["body"] == 1] > 0.9).all() and (up[contacts["body"] == 0] < -0.9).all()
    force = contacts["pressure"][:, None] * contacts["normal"] + contacts["shear"]
    # A contact point that first touches in a step whose surface others have taken bears none of it until the next step.
    bears = contacts["area"] > 0
    assert np.count_nonzero(~bears) <= 1
    np.testing.assert_allclose((force * contacts["area"][:, None])[bears], contacts["force"][bears], rtol=1e-9, atol=1e-9)
    shear = np.einsum("ij,ij->i", contacts["shear"], contacts["normal"])
    np.testing.assert_allclose(shear, 0, atol=1e-6)


def test_a_tool_and_a_pair_share_the_series(run):
    tool = {"name": "press", "shape": box([1.5, 2], [4.5, 2.5]), "uy": -0.02, "friction": 0.3}
    deck = dragged("cpdi2", tools=[tool], steps={"count": 2}, surfaces=[], loads=[])
    deck["boundary_conditions"] = deck["boundary_conditions"][:1]
    contacts = run(deck).mesh("contacts", -1)
    on_tool = contacts["tool"] == 0
    assert on_tool.any() and (contacts["pair"][on_tool] == -1).all()
    assert (~on_tool).any() and (contacts["pair"][~on_tool] == 0).all()


def files(directory):
    names = [path for path in sorted(directory.iterdir()) if path.suffix in (".vtu", ".pvd", ".csv")]
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in names}


@pytest.mark.parametrize("method", ["gimp", "cpdi2"])
def test_the_number_of_threads_changes_no_bit(run, method):
    deck = dragged(method, steps={"count": 4})
    assert files(run(deck, threads=1).directory) == files(run(deck, threads=2).directory)


@pytest.mark.parametrize("method", ["gimp", "cpdi2"])
def test_a_run_that_is_resumed_has_the_same_bits(mpm, tmp_path, method):
    """What contact points keep from step to step is in the checkpoint: the step after it slides and sticks."""
    deck = tmp_path / "deck.yaml"
    deck.write_text(yaml.safe_dump(dragged(method, steps={"count": 5}, checkpoint={"every": 3})))
    out = tmp_path / "out"
    process = mpm("run", deck, "--out", out)
    assert process.returncode == 0, process.stderr
    whole = files(out)
    (out / "checkpoint_0005.mpm").unlink()
    (out / "summary.json").unlink()
    process = mpm("run", deck, "--out", out, "--resume")
    assert process.returncode == 0 and "resuming after step 3" in process.stderr, process.stderr
    assert files(out) == whole


def test_the_order_of_the_bodies_hardly_changes_forces(run):
    """Friction depends on the path of the iterations; both orders give an equilibrium within the law of the interface."""
    deck = dragged("cpdi2", contacts=[{"between": ["lower", "upper"], "friction": 0.3}], steps={"count": 5})
    history = run(deck).history
    reference = run(dragged("cpdi2", steps={"count": 5})).history
    np.testing.assert_allclose(history["drag_rx"], reference["drag_rx"], rtol=0, atol=1e-3 * 12e3)
    np.testing.assert_allclose(history["lower_on_upper_fx"], -reference["upper_on_lower_fx"], rtol=0, atol=1e-3 * 12e3)


def test_bodies_part_and_touch_again(run):
    """The upper block is lifted off the lower one and put back: no force between, and no memory of it."""
    deck = stacked()
    motion = [[0, 0], [0.25, 1], [0.5, 0], [0.75, -1], [1, 1]]
    deck["boundary_conditions"][2] |= {"uy": -0.1, "curve": motion}
    deck["steps"] = {"count": 8}
    history = run(deck).history
    converged = history["converged"] == 1
    time = history["time"][converged]
    force, contacts, energy = (
        history[name][converged] for name in ("lower_on_upper_fy", "lower_on_upper_contacts", "strain_energy")
    )
    pressed = force[time == 0.25]
    assert pressed > 0 and force[-1] == pytest.approx(pressed, rel=1e-9)
    parted = (time > 0.5) & (time < 0.8)
    assert parted.sum() >= 2 and not force[parted].any() and not contacts[parted].any()
    assert energy[time == 0.5] == pytest.approx(0, abs=1e-9 * energy[time == 0.25])


def refused(run, **changes):
    message = run(stacked(**changes), code=2)
    assert "error[D076]" in message and "help:" in message, message
    return message


def test_contact_of_a_body_with_itself_is_refused(run):
    message = refused(run, contacts=[{"between": ["lower", "lower"]}])
    assert "with itself" in message and "`lower`" in message


@pytest.mark.parametrize("second", [["lower", "upper"], ["upper", "lower"]])
def test_contact_that_is_given_twice_is_refused(run, second):
    message = refused(run, contacts=[{"between": ["lower", "upper"], "friction": 0.1}, {"between": second}])
    assert "twice" in message and "remove one entry" in message


def test_contact_between_all_that_is_given_twice_is_refused(run):
    assert "twice" in refused(run, contacts=[{"between": "all"}, {"between": "all", "friction": 0.3}])


@pytest.mark.parametrize("between", ["all", ["lower", "upper"]])
def test_contact_of_standard_points_is_refused(run, between):
    message = refused(run, methods=("mpm", "cpdi2"), contacts=[{"between": between}])
    assert "no sides" in message and "cpdi2" in message


def test_bodies_that_stick_together_through_a_third_one_are_refused(run):
    deck = stacked()
    deck["bodies"].append(body("side", box([1, 0], [1.4, 1.8]), "cpdi2", 0.1, "soft"))
    message = run(deck, code=2)
    assert "error[D076]" in message and "`side`" in message and "between: all" in message
    # The remedy that the message names.
    deck["contacts"].append({"between": "all"})
    run(deck)


def test_an_unknown_body_is_named(run):
    message = run(stacked(contacts=[{"between": ["lower", "uper"]}]), code=2)
    assert "`uper`" in message and "upper" in message


@pytest.mark.parametrize("points", [2, 3])
def test_corners_that_touch_bear_the_whole_surface_of_a_cylinder(run, points):
    """Half width a² = 4 P R*/(π E*) of Hertz: between a cylinder and its image, with 3 cells in a. Half a cell is
    uncertain at either end; without the rule for corners that do not touch, the area is 0.6 or 0.2 of 2a."""
    radius, young, h = 0.2, 1e5, 0.0027
    bodies = [
        {"name": name, "material": "rubber", "method": "cpdi2", "points_per_cell": points,
         "shape": {"type": "circle", "center": [0, side * radius], "radius": radius}}
        for name, side in (("upper", 1), ("lower", -1))
    ]
    far = [{"name": name, "body": name, "part": {"half_space": {"point": [0, side * radius], "normal": [0, side]}}}
           for name, side in (("upper", 1), ("lower", -1))]
    found = run({
        "version": 1,
        "grid": {"type": "structured", "origin": [-0.22, -0.42], "size": [0.44, 0.84], "spacing": 0.04,
                 "refine": [{"at": [0, 0], "to": h}]},
        "materials": {"rubber": elastic(young, 0.3)},
        "bodies": bodies,
        "contacts": [{"between": ["upper", "lower"], "adhesion": 1.0}],
        "surfaces": far,
        "boundary_conditions": [
            {"name": "base", "surface": "lower", "ux": 0, "uy": 0},
            {"name": "press", "surface": "upper", "ux": 0, "uy": -0.0015},
        ],
        "steps": {"count": 4},
    })
    force = abs(found.history["upper_on_lower_fy"][-1])
    half = math.sqrt(4 * force * 0.5 * radius / (math.pi * young / (2 * (1 - 0.3**2))))
    area = found.history["upper_on_lower_area"][-1]
    assert area > 2 * half - h and area < 2 * half + 1.5 * h, (area, 2 * half)


def at_rest(k0, method="cpdi2", friction=0.3):
    """Three bodies of one ground at rest, in contact with each other."""
    stress = {"type": "geostatic", "surface": 3, "k0": k0}
    boxes = {"base": ([0, 0], [4, 1]), "left": ([0, 1], [2, 3]), "right": ([2, 1], [4, 3])}
    return {
        "version": 1,
        "grid": {"type": "structured", "origin": [0, 0], "size": [4, 4], "spacing": 0.5},
        "materials": {"soil": elastic(2e7, 0.3, density=1800)},
        "bodies": [body(name, box(*corners), method, [0.25, 0.25], "soil") | {"initial_stress": stress}
                   for name, corners in boxes.items()],
        "contacts": [{"between": "all", "friction": friction}],
        "boundary_conditions": [
            {"name": "base", "nodes": {"y": 0}, "fix": ["x", "y"]},
            {"name": "sides", "nodes": {"x": 0}, "fix": ["x"]},
            {"name": "other", "nodes": {"x": 4}, "fix": ["x"]},
        ],
        "loads": [{"name": "weight", "type": "gravity", "acceleration": [0, -9.81]}],
        "steps": {"count": 2},
    }


@pytest.mark.parametrize("method", METHODS)
def test_ground_at_rest_stays_at_rest_when_its_bodies_are_in_contact(run, method):
    """Pressures K0 γ z between left and right, γ H on the base; nothing moves. With friction, the base may carry some of
    the force beside the corner where all three meet."""
    weight = 1800 * 9.81
    found = run(at_rest(0.5, method))
    assert np.abs(found.mesh("points", -1)["displacement"]).max() < 1e-9
    found = run(at_rest(0.5, method, friction=0))
    assert abs(found.history["left_on_right_fx"][-1]) == pytest.approx(0.5 * weight * 2**2 / 2, rel=1e-6)
    assert abs(found.history["base_on_left_fy"][-1]) == pytest.approx(weight * 2 * 2, rel=1e-6)
    assert np.abs(found.mesh("points", -1)["displacement"]).max() < 1e-9


def test_ground_whose_bodies_press_unequally_is_out_of_balance(run):
    deck = at_rest(0.5)
    deck["bodies"][2]["initial_stress"] = {"type": "geostatic", "surface": 3, "k0": 0.6}
    assert "S017" in run(deck, code=1)


def test_bodies_that_would_pass_through_each_other_are_named(mpm, tmp_path):
    deck = at_rest(0.5)
    deck["bodies"][1]["shape"] = box([0, 1], [1, 3])
    deck["bodies"][2]["shape"] = box([3, 1], [4, 3])
    deck["contacts"] = [{"between": ["base", "left"], "friction": 0.3}]
    (tmp_path / "deck.yaml").write_text(yaml.safe_dump(deck))
    found = mpm("check", tmp_path / "deck.yaml").stderr
    assert "warning[D077]" in found and "`left` and `right`" in found
    deck["contacts"] = [{"between": "all", "friction": 0.3}]
    (tmp_path / "deck.yaml").write_text(yaml.safe_dump(deck))
    assert "D077" not in mpm("check", tmp_path / "deck.yaml").stderr


@pytest.mark.parametrize("method", METHODS)
def test_boxes_on_an_oblique_boundary_are_named_a_staircase(mpm, tmp_path, method):
    deck = at_rest(0.5, method)
    deck["bodies"] = deck["bodies"][:2]
    deck["bodies"][0]["shape"] = {"type": "polygon", "vertices": [[0, 0], [4, 0], [4, 0.4], [0, 1]]}
    (tmp_path / "deck.yaml").write_text(yaml.safe_dump(deck))
    assert ("warning[D078]" in mpm("check", tmp_path / "deck.yaml").stderr) == (method == "gimp")
