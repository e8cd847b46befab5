"""``python -m bim_verify``."""

from .cli import main

raise SystemExit(main())
