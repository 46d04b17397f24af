"""Makes the pictures of `paraview.md` with the snippets of that page.

    python docs/how-to/make_pictures.py target/debug/mpm

Every block of Python under a comment `picture: NAME` is run as it stands and must write that file, which then goes to
`docs/images`. Needs the packages of tests/python/requirements.txt, and no display.
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
IMAGES = HERE.parent / "images"
BLOCK = re.compile(r"<!-- picture: (\S+) -->\n```python\n(.*?)```", re.S)


def main():
    program = Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        deck = HERE.parent.parent / "inputs" / "beam.yaml"
        subprocess.run([program, "run", deck, "--out", f"{folder}/results/beam"], check=True)
        environment = dict(os.environ, PYVISTA_OFF_SCREEN="true", MPLBACKEND="Agg")
        for name, code in BLOCK.findall((HERE / "paraview.md").read_text()):
            subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, check=True)
            (IMAGES / name).write_bytes((Path(folder) / name).read_bytes())
            print(IMAGES / name)


if __name__ == "__main__":
    main()
