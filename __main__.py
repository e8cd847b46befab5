"""``python -m bim_verify``, and the console script: an interrupt while the libraries load is answered in one line too."""

from __future__ import annotations

import os
import sys


def main() -> int:
    """Run the console script; see ``cli.main``."""
    code = _run()
    if "bpy" in sys.modules:  # Blender as a module may hang in its own clean-up at exit; all files are written
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code


def _run() -> int:
    try:
        from . import cli

        return cli.main()
    except KeyboardInterrupt:
        print("bim-verify: Interrupted; no result was written.", file=sys.stderr)
        return 130


if __name__ == "__main__":
    raise SystemExit(main())
