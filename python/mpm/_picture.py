"""Pictures of results: the command ``mpm picture``, :meth:`Result.plot` and :meth:`Result.animate`."""

from __future__ import annotations

import argparse
import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from mpm import _mpm
from mpm._errors import MpmError, ResultsError, UsageError

if TYPE_CHECKING:
    from mpm._deck import StrPath

Array = npt.NDArray[np.float64]

INSTALL = "pictures need PyVista: pip install pyvista"
INSTALL_FILM = "films need imageio: pip install imageio imageio-ffmpeg"
#: Width of a picture, and bounds of the height of what it shows, [pixel].
WIDTH, LOW, HIGH = 1200, 240, 760
#: Room for the title, the scale and the axes around it, [pixel].
TOP, BOTTOM, LEFT, RIGHT = 108, 170, 105, 45
#: Share of the points at either end of the values that may exceed the colour scale, [%].
BEYOND = 0.5
#: Width of the picture that the largest displacement takes with ``warp``.
WARP = 0.08
#: Frames of a film in a second.
RATE = 8
INK = "#1f2933"
TOOL = "#9aa5b1"
#: Names of the components of tensors and vectors, by their number.
COMPONENTS = {
    3: ("X", "Y", "Z"),
    6: ("XX", "YY", "ZZ", "XY", "YZ", "XZ"),
    9: ("XX", "XY", "XZ", "YX", "YY", "YZ", "ZX", "ZY", "ZZ"),
}
#: The kind of quantity of a field; fields that are not listed have no unit.
QUANTITIES = {
    "displacement": "length",
    "displacement_datum": "length",
    "cauchy_stress": "stress",
    "von_mises_stress": "stress",
    "pressure": "stress",
    "pressure_smoothed": "stress",
    "preconsolidation_pressure": "stress",
    "volume": "volume",
    "plastic_work": "stress",
    "principal_stress": "stress",
    "maximum_shear_stress": "stress",
}


@dataclass(frozen=True)
class Drawn:
    """What a picture shows: the field, its component, the step."""

    directory: Path
    field: str
    component: str | None
    warp: float | bool

    @property
    def name(self) -> str:
        """The field in words."""
        words = {"J": "det F", "von_mises_stress": "von Mises stress"}.get(self.field, self.field.replace("_", " "))
        if self.component:
            words += f" {self.component.lower()}"
        return words


def pyvista() -> Any:
    """The module ``pyvista``, set up to draw without a window.

    Raises:
        UsageError: It is not installed.
    """
    try:
        import pyvista as module
    except ImportError:
        raise UsageError(INSTALL) from None
    if not has_display():
        # VTK says on every picture that it draws without a window.
        module.vtk_verbosity("off")
    return module


def draw(
    directory: StrPath,
    *,
    field: str | None = None,
    step: int | str = "last",
    warp: bool | float = False,
    out: StrPath | None = None,
    plotter: Any = None,
) -> Path | Any:
    """Draws the points of a run, coloured by a field; see :meth:`mpm.Result.plot`."""
    directory = Path(directory)
    frames = _frames(directory)
    if step == "all":
        return _film(directory, frames, field, warp, out)
    frame = _frame(directory, frames, step)
    drawn = Drawn(directory, *_field(frame, field), warp)
    scene = Scene(drawn, frame)
    if plotter is not None:
        return scene.onto(plotter, frame)
    if out is None:
        return scene.onto(pyvista().Plotter(window_size=scene.size), frame)
    out = Path(out)
    if out.suffix.lower() not in (".png", ".jpg", ".jpeg", ".tif", ".bmp"):
        raise UsageError(f"`{out}`: a single step is a picture; give a file that ends in .png, or --step all for a film")
    out.parent.mkdir(parents=True, exist_ok=True)
    plotter = scene.onto(pyvista().Plotter(off_screen=True, window_size=scene.size), frame)
    plotter.screenshot(str(out))
    plotter.close()
    return out


def _film(
    directory: Path, frames: list[Frame], field: str | None, warp: bool | float, out: StrPath | None
) -> Path:
    last = frames[-1]
    drawn = Drawn(directory, *_field(last, field), warp)
    out = directory / "picture.gif" if out is None else Path(out)
    kind = out.suffix.lower()
    if kind not in (".gif", ".mp4", ".png"):
        raise UsageError(f"`{out}`: all steps make a film; give a file that ends in .gif or .mp4 (or .png for one each)")
    scene = Scene(drawn, *frames)
    out.parent.mkdir(parents=True, exist_ok=True)
    if kind == ".png":
        for frame in frames:
            plotter = scene.onto(pyvista().Plotter(off_screen=True, window_size=scene.size), frame)
            plotter.screenshot(str(out.with_name(f"{out.stem}_{frame.step:04}.png")))
            plotter.close()
        return out.with_name(f"{out.stem}_{frames[0].step:04}.png")
    plotter = pyvista().Plotter(off_screen=True, window_size=scene.size)
    try:
        if kind == ".gif":
            plotter.open_gif(str(out), fps=RATE)
        else:
            plotter.open_movie(str(out), framerate=RATE)
    except (ImportError, ModuleNotFoundError):
        raise UsageError(INSTALL_FILM) from None
    for frame in frames:
        plotter.clear()
        scene.onto(plotter, frame)
        plotter.write_frame()
    plotter.close()
    return out


@dataclass(frozen=True)
class Frame:
    """The files of one step."""

    directory: Path
    step: int
    time: float
    points: Path

    def file(self, kind: str) -> Path | None:
        """The file of another kind of the same step, if the run wrote it."""
        for ending in ("vtu", "pvtu"):
            path = self.directory / f"{kind}_{self.step:04}.{ending}"
            if path.exists():
                return path
        return None

    def read(self, kind: str) -> Any:
        """The contents of the file of a kind, or ``None``."""
        path = self.file(kind)
        mesh = None if path is None else pyvista().read(str(path))
        return mesh if mesh is not None and mesh.n_points > 0 else None


def _frames(directory: Path) -> list[Frame]:
    if not (directory / "run.json").exists():
        raise ResultsError(f"there are no results in `{directory}`")
    series = directory / "points.pvd"
    if not series.exists():
        raise ResultsError(f"`{directory}` has no files of points: the deck sets `output: {{every: 0}}`")
    frames = []
    for time, path in _mpm.series(str(series)):
        digits = "".join(character for character in Path(path).stem.split("_")[1] if character.isdigit())
        frames.append(Frame(directory, int(digits), time, Path(path)))
    if not frames:
        raise ResultsError(f"`{directory}` has no files of points yet")
    return frames


def _frame(directory: Path, frames: list[Frame], step: int | str) -> Frame:
    if step == "last":
        return frames[-1]
    if step == "first":
        return frames[0]
    try:
        number = int(step)
    except ValueError:
        raise UsageError(f"the step is `{step}`; give a number, last or all") from None
    for frame in frames:
        if frame.step == number:
            return frame
    written = ", ".join(str(frame.step) for frame in frames[:12]) + (", …" if len(frames) > 12 else "")
    raise UsageError(f"`{directory}` has no files of step {number}; it has those of the steps {written}")


def _field(frame: Frame, asked: str | None) -> tuple[str, str | None]:
    """The field and the component that are asked for; by default the von Mises stress, or what was written."""
    data = frame.read("points").point_data
    names = [name for name in data if name not in ("body_id", "material_id", "point_id")]
    if asked is None:
        for name in ("von_mises_stress", "pressure", "cauchy_stress", "displacement"):
            if name in names:
                return name, None
        return (names or ["body_id"])[0], None
    name, _, component = asked.partition(":")
    if name not in data:
        raise UsageError(f"the results have no field `{name}`; they have {', '.join(sorted(data.keys()))}")
    width = 1 if data[name].ndim == 1 else data[name].shape[1]
    known = _components(name, width)
    if not component:
        return name, None
    for entry in known:
        if entry.lower() == component.lower() and width > 1:
            return name, entry
    raise UsageError(f"the field `{name}` has no component `{component}`; it has {', '.join(known) if width > 1 else 'one'}")


def _units(directory: Path) -> dict[str, str]:
    """The units of the results by kind of quantity, or the names of the quantities."""
    for name in ("summary.json", "run.json"):
        try:
            units = json.loads((directory / name).read_text()).get("units")
        except (OSError, ValueError):
            continue
        if units:
            return dict(units)
    return {}


def _title(directory: Path) -> str:
    try:
        return str(json.loads((directory / "run.json").read_text()).get("title") or directory.name)
    except (OSError, ValueError):
        return directory.name


class Scene:
    """A view that is the same for all frames: colours, camera, size of the picture."""

    def __init__(self, drawn: Drawn, *frames: Frame) -> None:
        self.drawn = drawn
        self.units = _units(drawn.directory)
        bodies = [self._bodies(frame) for frame in frames]
        self.factor = self._factor(bodies[-1]) if drawn.warp else 1.0
        warped = [self._warped(body) for body in bodies]
        every = np.array([body.bounds for body in warped])
        for frame in frames:
            tools = frame.read("tools")
            if tools is not None:
                every = np.vstack([every, tools.bounds])
        self.low, self.high = every[:, 0::2].min(axis=0), every[:, 1::2].max(axis=0)
        self.flat = bool(self.high[2] - self.low[2] <= 1e-12 * max(self.high - self.low))
        self.values = np.concatenate([self._values(body) for body in bodies])
        self.range = self._range()
        extent = self.high - self.low
        inner = HIGH if not self.flat else (WIDTH - LEFT - RIGHT) * extent[1] / max(extent[0], 1e-300)
        self.size = [WIDTH, int(min(max(inner, LOW), HIGH)) + TOP + BOTTOM]
        self.power = _power(*self.range)

    def _bodies(self, frame: Frame) -> Any:
        """The domains of the points, and squares or cubes of their volume for points without domains."""
        points, domains = frame.read("points"), frame.read("domains")
        if points is None:
            raise ResultsError(f"the file of step {frame.step} has no points")
        if domains is not None and domains.n_cells == points.n_points:
            return domains
        bare = points
        if domains is not None:
            with_domain = np.isin(points.point_data["point_id"], domains.cell_data["point_id"])
            bare = points.extract_points(~with_domain, include_cells=False)
        squares = _squares(bare)
        return squares if domains is None else domains.merge(squares, merge_points=False)

    def _values(self, body: Any) -> Array:
        return _component(np.asarray(body.cell_data[self.drawn.field], dtype=float), self.drawn)

    def _range(self) -> tuple[float, float]:
        """The colour scale: all values, or all but a few extreme ones that would hide the others."""
        values = self.values[np.isfinite(self.values)]
        if len(values) == 0:
            return 0.0, 1.0
        low, high = float(values.min()), float(values.max())
        inner_low, inner_high = (float(x) for x in np.percentile(values, [BEYOND, 100 - BEYOND]))
        if high - low > 1.4 * (inner_high - inner_low) > 0:
            low, high = inner_low, inner_high
        size = max(abs(low), abs(high))
        if size == 0.0:
            return 0.0, 1.0
        if high - low <= 1e-9 * size:
            low, high = low - 0.05 * size, high + 0.05 * size
        if low < 0 < high and min(-low, high) > 0.05 * max(-low, high):
            most = max(-low, high)
            return -most, most
        return low, high

    def _factor(self, body: Any) -> float:
        if not isinstance(self.drawn.warp, bool):
            return float(self.drawn.warp)
        largest = float(np.linalg.norm(body.cell_data["displacement"], axis=1).max(initial=0.0))
        bounds = np.array(body.bounds)
        size = float((bounds[1::2] - bounds[0::2]).max())
        if largest == 0.0:
            return 1.0
        exact = WARP * size / largest
        power = 10.0 ** np.floor(np.log10(exact))
        return float(max(p for p in (1, 2, 5) if p * power <= exact) * power)

    def _warped(self, body: Any) -> Any:
        if not self.drawn.warp or self.factor == 1.0:
            return body
        if "displacement" not in body.cell_data:
            raise UsageError("`warp` needs the field `displacement`, which the deck does not write")
        joined = body.clean(tolerance=1e-9).cell_data_to_point_data(pass_cell_data=True)
        joined.points = joined.points + (self.factor - 1.0) * joined.point_data["displacement"]
        joined.point_data.clear()
        return joined

    def onto(self, plotter: Any, frame: Frame) -> Any:
        """Draws a frame."""
        body = self._warped(self._bodies(frame))
        body = body.copy(deep=False)
        shrink = 10.0**-self.power
        body.cell_data["shown"] = shrink * self._values(body)
        body.set_active_scalars("shown", preference="cell")
        low, high = self.range
        diverging = low < 0 < high and abs(low + high) <= 1e-9 * high
        shown = body if self.flat else body.extract_surface(algorithm=None)
        many = body.n_cells > 6000
        plotter.set_background("white")
        plotter.add_mesh(
            shown,
            scalars="shown",
            cmap="RdBu_r" if diverging else "viridis",
            clim=[shrink * low, shrink * high],
            show_edges=not many,
            edge_color="#52606d",
            edge_opacity=0.35 if not many else 0.0,
            line_width=1,
            lighting=not self.flat,
            show_scalar_bar=False,
        )
        self._scale(plotter)
        self._tools(plotter, frame)
        self._surfaces(plotter, frame)
        self._words(plotter, frame)
        self._camera(plotter)
        return plotter

    def _scale(self, plotter: Any) -> None:
        unit = self.unit(QUANTITIES.get(self.drawn.field))
        if self.power:
            unit = f"10^{self.power} {unit}".strip()
        title = self.drawn.name + (f" [{unit}]" if unit else "")
        least, most = float(np.nanmin(self.values)), float(np.nanmax(self.values))
        low, high = self.range
        margin = 1e-6 * (high - low)
        shrink = 10.0**-self.power
        beyond = [
            f"{shrink * least:.4g}" if least < low - margin else "",
            f"{shrink * most:.0f}" if most > high + margin and shrink * most >= 1000 else
            f"{shrink * most:.3g}" if most > high + margin else "",
        ]
        if any(beyond):
            words = " and ".join(part for part in (f"down to {beyond[0]}" * bool(beyond[0]), f"up to {beyond[1]}" * bool(beyond[1])) if part)
            title += f"; some values beyond the scale: {words}"
        width, height = self.size
        left, right, base, thick = 0.2 * width, 0.8 * width, 62, 24
        bar = plotter.add_scalar_bar(
            title="",
            n_labels=0,
            width=(right - left) / width,
            height=thick / height,
            position_x=left / width,
            position_y=base / height,
        )
        bar.SetBarRatio(1.0)
        bar.SetTitleRatio(0.0)
        for value, text in _ticks(shrink * low, shrink * high, 6):
            x = left + (right - left) * (value - shrink * low) / (shrink * (high - low))
            _write(plotter, text, np.array([x - 4.3 * len(text), base - 25]), 10)
        _write(plotter, title, np.array([0.5 * width - 4.3 * len(title), base - 52]), 10)

    def _tools(self, plotter: Any, frame: Frame) -> None:
        tools = frame.read("tools")
        if tools is None:
            return
        if self.flat:
            plotter.add_mesh(tools, color=INK, line_width=4, show_scalar_bar=False)
        else:
            plotter.add_mesh(tools, color=TOOL, opacity=0.55, show_edges=False, show_scalar_bar=False)

    def _surfaces(self, plotter: Any, frame: Frame) -> None:
        surfaces = frame.read("surfaces")
        if surfaces is not None and self.drawn.warp in (False, 1, 1.0):
            plotter.add_mesh(
                surfaces.points, color="#c2410c", point_size=4 if self.flat else 3, render_points_as_spheres=True
            )

    def _words(self, plotter: Any, frame: Frame) -> None:
        # Time orders the steps; in most decks it is a mere count, so that a unit would mislead.
        parts = [f"step {frame.step}, time {frame.time:.6g}"]
        if self.drawn.warp and self.factor != 1.0:
            parts.append(f"displacements × {self.factor:g}")
        if frame.read("tools") is not None:
            parts.append("tools: dark lines" if self.flat else "tools: grey")
        if frame.read("surfaces") is not None and self.drawn.warp in (False, 1, 1.0):
            parts.append("surfaces: orange")
        title = _title(self.drawn.directory)
        title = title if len(title) <= 95 else title[:94] + "…"
        height = self.size[1]
        _write(plotter, title, np.array([24.0, height - 34.0]), 13)
        _write(plotter, "; ".join(parts), np.array([24.0, height - 60.0]), 10)

    def _camera(self, plotter: Any) -> None:
        plotter.enable_parallel_projection()
        extent, middle = self.high - self.low, 0.5 * (self.low + self.high)
        width, height = self.size
        camera = plotter.camera
        if self.flat:
            # The bodies fill the width or the height between title and scale, whichever is smaller.
            scale = max(extent[1] / (height - TOP - BOTTOM), extent[0] / (width - LEFT - RIGHT))
            x = middle[0] - 0.5 * (LEFT - RIGHT) * scale
            y = middle[1] - 0.5 * (BOTTOM - TOP) * scale
            camera.focal_point, camera.position, camera.up = (x, y, 0.0), (x, y, 1.0), (0.0, 1.0, 0.0)
            camera.parallel_scale = 0.5 * height * scale
            self._axes(plotter, (x - 0.5 * width * scale, y - 0.5 * height * scale), scale)
        else:
            direction = np.array([-1.0, -1.9, 1.0]) / np.linalg.norm([-1.0, -1.9, 1.0])
            right = np.cross(-direction, [0.0, 0.0, 1.0])
            right /= np.linalg.norm(right)
            up = np.cross(right, -direction)
            across, along = (float(np.abs(extent * axis).sum()) for axis in (right, up))
            scale = max(along / (height - TOP - BOTTOM - 60), across / (width - LEFT - RIGHT - 120))
            middle = middle - 0.5 * (BOTTOM - TOP) * scale * up
            camera.focal_point = tuple(middle)
            camera.position = tuple(middle + 3.0 * float(np.linalg.norm(extent)) * direction)
            camera.up = (0.0, 0.0, 1.0)
            camera.parallel_scale = 0.5 * height * scale
            corner = np.array([right, up]) @ middle - 0.5 * scale * np.array([width, height])
            self._axes_in_space(plotter, np.array([right, up]), corner, scale)
        plotter.reset_camera_clipping_range()

    def _axes(self, plotter: Any, corner: tuple[float, float], scale: float) -> None:
        """Lines with round numbers below and beside the bodies; `corner` is that of the picture, `scale` a pixel."""
        gap = 12 * scale
        low, high = self.low[:2] - gap, self.high[:2]
        lines: list[tuple[list[float], list[float]]] = []
        length = self.unit("length")
        for axis in (0, 1):
            room = (self.high[axis] - self.low[axis]) / scale
            names = _ticks(self.low[axis], high[axis], min(8, max(1, int(room / (110 if axis == 0 else 80)))))
            end = self.high.copy()[:2]
            start = low.copy()
            start[axis], end[axis] = self.low[axis], high[axis]
            end[1 - axis] = low[1 - axis]
            lines.append(([*start, 0.0], [*end, 0.0]))
            for value, text in names:
                at = low.copy()
                at[axis] = value
                tip = at.copy()
                tip[1 - axis] -= 6 * scale
                lines.append(([*at, 0.0], [*tip, 0.0]))
                pixel = (tip - corner) / scale
                offset = (-4.3 * len(text), -24) if axis == 0 else (-9.5 * len(text) - 4, -9)
                _write(plotter, text, pixel + np.array(offset), 10)
            middle = 0.5 * (self.low[:2] + self.high[:2])
            name = f"{'xy'[axis]} [{length}]"
            if axis == 0:
                pixel = (np.array([middle[0], low[1]]) - corner) / scale + np.array([-4.5 * len(name), -52])
            else:
                pixel = (np.array([low[0], self.high[1]]) - corner) / scale + np.array([-60, 12])
            _write(plotter, name, pixel, 10)
        _lines(plotter, lines)

    def _axes_in_space(self, plotter: Any, view: Array, corner: Array, scale: float) -> None:
        """The edges of the box around the bodies that meet at its lowest corner, with round numbers."""
        length = self.unit("length")
        lines: list[tuple[list[float], list[float]]] = []
        low, high = self.low, self.high
        # The edges nearest to the eye below, and the one at the left.
        starts = {0: (low[0], low[1], low[2]), 1: (low[0], low[1], low[2]), 2: (low[0], high[1], low[2])}
        outward = {0: (0.0, -1.0, 0.0), 1: (-1.0, 0.0, 0.0), 2: (-1.0, 0.0, 0.0)}
        for axis, start in starts.items():
            end = list(start)
            end[axis] = high[axis]
            lines.append((list(start), end))
            direction = view @ np.array(outward[axis])
            direction /= np.linalg.norm(direction)
            span = float(np.linalg.norm(view[:, axis])) * (high[axis] - low[axis]) / scale
            for value, text in _ticks(low[axis], high[axis], max(2, int(span / 80))):
                at = np.array(start)
                at[axis] = value
                reach = np.array(outward[axis]) * 8 * scale
                lines.append((list(at), list(at + reach)))
                pixel = (view @ (at + reach) - corner) / scale + 14 * direction
                _write(plotter, text, pixel + np.array([-4.3 * len(text) + 6 * direction[0], -9]), 10)
            at = 0.5 * (np.array(start) + np.array(end))
            pixel = (view @ at - corner) / scale + 58 * direction
            name = f"{'xyz'[axis]} [{length}]"
            _write(plotter, name, pixel + np.array([-4.3 * len(name) + 55 * min(direction[0], 0.0), -9]), 10)
        _lines(plotter, lines)

    def unit(self, quantity: str | None) -> str:
        """The unit of a quantity, or its name if the deck states no units; empty without a quantity."""
        if quantity is None:
            return ""
        return self.units.get(quantity, quantity)


def _power(low: float, high: float) -> int:
    """The power of a thousand that is taken out of numbers so that they have few digits."""
    size = max(abs(low), abs(high))
    if size == 0.0 or 1e-2 <= size < 1e5:
        return 0
    return int(3 * np.floor(np.log10(size) / 3))


def _ticks(low: float, high: float, most: int) -> list[tuple[float, str]]:
    """Round numbers from `low` to `high`, at most about so many, and their texts."""
    if not high > low:
        return []
    step = (high - low) / max(most, 1)
    power = 10.0 ** np.floor(np.log10(step))
    step = float(next(m for m in (1, 2, 2.5, 5, 10) if m * power >= step * (1 - 1e-9)) * power)
    first, last = int(np.ceil(low / step - 0.02)), int(np.floor(high / step + 0.02))
    digits = max(0, -int(np.floor(np.log10(step)))) + (1 if round(step / power, 6) == 2.5 else 0)
    large = max(abs(low), abs(high)) >= 1e6 or step < 1e-4
    return [(k * step, f"{k * step + 0.0:.6g}" if large else f"{k * step + 0.0:.{digits}f}") for k in range(first, last + 1)]


def _write(plotter: Any, text: str, pixel: Array, size: int) -> None:
    plotter.add_text(text, position=(float(pixel[0]), float(pixel[1])), font_size=size, color=INK, font="arial")


def _lines(plotter: Any, lines: list[tuple[list[float], list[float]]]) -> None:
    ends = np.array([point for line in lines for point in line], dtype=float)
    mesh = pyvista().PolyData()
    mesh.points = ends
    mesh.lines = np.column_stack([np.full(len(lines), 2), np.arange(2 * len(lines)).reshape(-1, 2)]).ravel()
    plotter.add_mesh(mesh, color=INK, line_width=1.5, lighting=False, show_scalar_bar=False)


def _format(low: float, high: float) -> str:
    """A format with about four digits of the largest number."""
    size = max(abs(low), abs(high))
    if size == 0.0 or 1e-2 <= size < 1e6:
        digits = 0 if size >= 1000 else 1 if size >= 100 else 2 if size >= 10 else 3
        return f"%.{digits}f"
    return "%.3g"


def _components(name: str, width: int) -> tuple[str, ...]:
    numbered = tuple(str(k + 1) for k in range(width))
    return numbered if name == "principal_stress" else COMPONENTS.get(width, numbered)


def _component(values: Array, drawn: Drawn) -> Array:
    if values.ndim == 1:
        return values
    if drawn.component is None:
        weights = np.ones(values.shape[1])
        if values.shape[1] == 6:
            weights[3:] = 2.0
        size: Array = np.sqrt((values**2 * weights).sum(axis=1))
        return size
    known = _components(drawn.field, values.shape[1])
    return values[:, known.index(drawn.component)]


def _squares(points: Any) -> Any:
    """Squares (cubes) of the volume of points, with the fields of the points."""
    module = pyvista()
    x = np.asarray(points.points)
    flat = bool(np.ptp(x[:, 2]) == 0.0)
    size = 0.5 * np.asarray(points.point_data["volume"], dtype=float) ** (1 / 2 if flat else 1 / 3)
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    if not flat:
        corners = [(a, b, c) for c in (-1, 1) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    at = (x[:, None, :] + size[:, None, None] * np.array(corners, dtype=float)).reshape(-1, 3)
    n = len(corners)
    kind = module.CellType.QUAD if flat else module.CellType.HEXAHEDRON
    cells = np.column_stack([np.full(len(x), n), np.arange(n * len(x)).reshape(-1, n)])
    mesh = module.UnstructuredGrid(cells.ravel(), np.full(len(x), kind), at)
    for name in points.point_data:
        mesh.cell_data[name] = points.point_data[name]
    return mesh


def has_display() -> bool:
    """Whether a window can be opened."""
    if sys.platform.startswith("linux"):
        return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return True


def is_notebook() -> bool:
    """Whether this is a notebook, which shows pictures itself."""
    module = sys.modules.get("IPython")
    shell = None if module is None else module.get_ipython()
    return shell is not None and "IPKernelApp" in getattr(shell, "config", {})


def _newest() -> Path:
    """The results that were written last, in the working directory or in ``results``."""
    found = [*Path("results").glob("*/run.json"), *Path().glob("*/run.json"), *Path().glob("run.json")]
    if not found:
        raise UsageError("there are no results here; name their directory: mpm picture results/NAME")
    newest = max(found, key=lambda path: path.stat().st_mtime).parent
    print(f"the newest results: {newest}", file=sys.stderr)
    return newest


def _warp_factor(text: str) -> float | bool:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a factor of displacements, such as 10") from None


def main(arguments: list[str]) -> int:
    """The command ``mpm picture``; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="mpm picture",
        description="Draw the results of a run: the bodies coloured by a field, with tools and surfaces.",
    )
    parser.add_argument("results", nargs="?", metavar="DIR", help="results directory [default: the newest results]")
    parser.add_argument(
        "--field",
        metavar="NAME[:COMPONENT]",
        help="field that colours the points, such as displacement or cauchy_stress:YY [default: von_mises_stress]",
    )
    parser.add_argument("--step", default="last", metavar="N|last|all", help="step, or all for a film [default: last]")
    parser.add_argument(
        "--warp",
        nargs="?",
        const=True,
        default=False,
        type=_warp_factor,
        metavar="FACTOR",
        help="exaggerate displacements, by a factor that makes them visible unless one is given",
    )
    parser.add_argument(
        "--out",
        metavar="FILE",
        help="file to write: .png, or .gif or .mp4 with --step all [default: DIR/picture.png, DIR/picture.gif]",
    )
    options = parser.parse_args(arguments)
    try:
        directory = Path(options.results) if options.results else _newest()
        step = options.step
        if options.out and Path(options.out).suffix.lower() in (".gif", ".mp4"):
            step = "all"
        out = options.out or directory / ("picture.gif" if step == "all" else "picture.png")
        written = draw(directory, field=options.field, step=step, warp=options.warp, out=out)
    except (MpmError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"the picture is {written}")
    return 0
