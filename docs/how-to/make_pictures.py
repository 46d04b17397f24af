"""Makes the pictures of the pages listed in `PAGES`, and of `report.md`.

    python docs/how-to/make_pictures.py target/release/mpm

Every block of Python under a comment `picture: NAME` is run as it stands and must write that file, which then goes to
`docs/images`. The picture of a report is taken with Chromium, if there is one. Needs the packages of
tests/python/requirements.txt, and no display.
"""

import base64
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
IMAGES = HERE.parent / "images"
# The deck whose results each page shows.
PAGES = {"paraview.md": "beam", "stages.md": "excavation", "footing.md": "footing_stages"}
PAGES |= {"slope.md": "slope", "bearing.md": "bearing", "triaxial.md": "triaxial"}
PAGES |= {"pipe.md": "pipe", "cone.md": "cone", "plough.md": "plough"}
# What the pictures need besides the results of the deck.
FURTHER = {"triaxial.md": "element inputs/triaxial.yaml --material clay --path triaxial-drained --confining 100e3 --to 0.2 --steps 40"}
BLOCK = re.compile(r"<!-- picture: (\S+) -->\n```python\n(.*?)```", re.S)


def main():
    program = Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "inputs").symlink_to(ROOT / "inputs")
        environment = dict(os.environ, PYVISTA_OFF_SCREEN="true", MPLBACKEND="Agg")
        for page, deck in PAGES.items():
            subprocess.run([program, "run", f"inputs/{deck}.yaml"], check=True, cwd=folder)
            if page in FURTHER:
                subprocess.run([program, *FURTHER[page].split()], check=True, cwd=folder)
            for name, code in BLOCK.findall((HERE / page).read_text()):
                subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, check=True)
                (IMAGES / name).write_bytes((Path(folder) / name).read_bytes())
                print(IMAGES / name)
        subprocess.run([program, "report", "results/beam", "--units", "m,N,s"], check=True, cwd=folder)
        picture_of_report(Path(folder) / "results" / "beam" / "report.html")


def picture_of_report(page):
    """The first screen of a report."""
    sys.path.insert(0, str(ROOT / "tests" / "python"))
    import browser

    if program := browser.find():
        with browser.Browser(program) as window:
            window.look()
            window.open(page.as_uri())
            clip = {"x": 0, "y": 0, "width": 820, "height": 1010, "scale": 1}
            picture = window.call("Page.captureScreenshot", format="png", clip=clip)
        (IMAGES / "report.png").write_bytes(base64.b64decode(picture["data"]))
        print(IMAGES / "report.png")


if __name__ == "__main__":
    main()
