"""A progress bar for runs, on terminals and in notebooks."""

from __future__ import annotations

import shutil
import sys
import time
from typing import Any

from mpm._run import Run, Step

_WIDTH = 24
#: Shortest time between two redraws, [s].
_FRAME = 0.1


def _is_notebook() -> bool:
    """Whether a notebook kernel is present to display the bar."""
    if "IPython" not in sys.modules:
        return False
    from IPython import get_ipython

    return getattr(get_ipython(), "kernel", None) is not None


class Bar:
    """A progress bar for a run; by default, shown only on a terminal or in a notebook."""

    def __init__(self, wanted: bool | None, run: Run) -> None:
        self._run = run
        self._handle: Any = None
        self._began = time.monotonic()
        self._drawn = 0.0
        in_notebook = _is_notebook()
        on_terminal = sys.stderr is not None and getattr(sys.stderr, "isatty", bool)()
        self._is_shown = wanted if wanted is not None else in_notebook or on_terminal
        self._is_shown = self._is_shown and (in_notebook or sys.stderr is not None)
        self._in_notebook = in_notebook

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *_: object) -> None:
        if self._is_shown and not self._in_notebook and self._drawn:
            print(file=sys.stderr)

    def show(self, step: Step) -> None:
        """Draws the bar after a step if a redraw is due."""
        now = time.monotonic()
        ends = step.time >= step.end_time
        if not self._is_shown or (now - self._drawn < _FRAME and not ends):
            return
        self._drawn = now
        part = min(1.0, step.time / step.end_time)
        filled = round(part * _WIDTH)
        left = (now - self._began) * (1 - part) / part if part > 0 else 0.0
        stage = f"  {step.stage}" if step.stage else ""
        text = (
            f"{'█' * filled}{'░' * (_WIDTH - filled)} {100 * part:5.1f} %  step {step.index}{stage}  "
            f"residual {step.residual:.1e}  {left:.0f} s left"
        )
        if not self._in_notebook:
            width = shutil.get_terminal_size().columns - 1
            print(f"\r{text[:width]:<{min(width, 78)}}", end="", file=sys.stderr, flush=True)
            return
        from IPython.display import display

        bundle = {"text/plain": text}
        if self._handle is None:
            self._handle = display(bundle, raw=True, display_id=True)
        else:
            self._handle.update(bundle, raw=True)
