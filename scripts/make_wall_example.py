"""Two scans of a panelled wall that moved between them, and its IFC model: what docs/displacement.md walks through.

    python scripts/make_wall_example.py [--out wall_example]
"""

from __future__ import annotations

import argparse

from headless_entry import package

PACKAGE = package()

from bim_verify.core.simulation.wall_example import GUID, write_wall_example  # noqa: E402


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", default="wall_example")
    folder = write_wall_example(parser.parse_args().out)
    print(f"{folder}: base.e57, later.e57, wall.ifc (the wall's GlobalId is {GUID})")


if __name__ == "__main__":
    main()
