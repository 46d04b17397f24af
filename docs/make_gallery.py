"""Runs the decks of `inputs` and draws each into `images/gallery`, for `gallery.md`.

    python docs/make_gallery.py

Needs the package `mpm` with PyVista, and no display.
"""

import tempfile
from pathlib import Path

import mpm

HERE = Path(__file__).resolve().parent
INPUTS = HERE.parent / "inputs"
IMAGES = HERE / "images" / "gallery"
#: The decks, with the field that shows most and how it is drawn.
DRAWN = {
    "arch": {},
    "bearing": {"field": "equivalent_plastic_strain"},
    "collapse": {"field": "displacement"},
    "cone": {},
    "excavation": {"field": "displacement:X"},
    "footing_stages": {"field": "displacement:Y"},
    "pipe": {},
    "plough": {},
    "slope": {"field": "displacement"},
}


def main():
    IMAGES.mkdir(parents=True, exist_ok=True)
    for name, choices in DRAWN.items():
        with tempfile.TemporaryDirectory() as folder:
            result = mpm.Deck.load(INPUTS / f"{name}.yaml").run(folder, progress=False)
            print(result.plot(out=IMAGES / f"{name}.png", **choices))


if __name__ == "__main__":
    main()
