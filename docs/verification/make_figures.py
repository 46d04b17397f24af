"""Runs the decks of the verification pages, prints their tables and draws their figures.

    python docs/verification/make_figures.py target/release/mpm
    python docs/verification/make_figures.py target/release/mpm --only beam shear --results results/verification

Results stay under `--results`; runs found there are not repeated, so remove the directory to start afresh. Figures
go to this directory, the picture of the README to docs/images. Needs the packages of tests/python/requirements.txt.
"""

import argparse

import matplotlib

from pages import annulus, beam, collapse, compaction, domains, locking, picture, shear
from pages.runs import Runs

PAGES = {
    "domains": domains,
    "compaction": compaction,
    "shear": shear,
    "beam": beam,
    "annulus": annulus,
    "collapse": collapse,
    "locking": locking,
    "picture": picture,
}


def main():
    matplotlib.rcParams["font.size"] = 9
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mpm", help="the program")
    parser.add_argument("--results", default="results/verification", help="where the runs leave their results")
    parser.add_argument("--only", nargs="+", choices=PAGES, default=list(PAGES), help="pages to make")
    arguments = parser.parse_args()
    runs = Runs(arguments.mpm, arguments.results)
    for page in arguments.only:
        print(f"\n## {page}")
        PAGES[page].draw(runs)


if __name__ == "__main__":
    main()
