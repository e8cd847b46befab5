"""What every headless script does: find the package, pass on what follows ``--``, leave with the exit code."""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType

CHECKOUT = Path(__file__).resolve().parent.parent
NAME = "bim_verify"


def run(command: str) -> None:
    """Run ``bim-verify COMMAND`` with the arguments after ``--`` and end the process with its exit code.

    The process is left by ``os._exit``: Blender in a Python module may hang or crash in its own clean-up at exit, and
    ``blender --python`` would otherwise go on and end with 0.
    """
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    code = 1
    try:
        cli = importlib.import_module(f"{package().__name__}.cli")
        code = cli.main([command, *arguments])
    except SystemExit as leave:  # argparse: wrong usage, or --help
        code = leave.code if isinstance(leave.code, int) else int(leave.code is not None)
    except KeyboardInterrupt:
        code = 130
    except ImportError as error:
        print(
            f"bim_verify cannot be loaded: {error}. Install the extension in Blender, or pip install it.",
            file=sys.stderr,
        )
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def package() -> ModuleType:
    """``bim_verify``: the copy that this script lies in, else the installed package, else the installed extension.

    Inside Blender the libraries it needs come with the extension, wherever the code itself is taken from.
    """
    repositories = extension_repositories()
    if (CHECKOUT / "core").is_dir() and (CHECKOUT / "__init__.py").is_file():
        return load_checkout()
    if importlib.util.find_spec(NAME) is not None:
        return importlib.import_module(NAME)
    for repository in repositories:
        name = f"bl_ext.{repository}.{NAME}"
        if importlib.util.find_spec(name) is not None:
            return importlib.import_module(name)
    raise ImportError("no package of that name is installed")


def load_checkout() -> ModuleType:
    """The folder above as the package ``bim_verify``, whatever the folder is called."""
    known = sys.modules.get(NAME)
    if known is not None and getattr(known, "__path__", None) == [str(CHECKOUT)]:
        return known
    spec = importlib.util.spec_from_file_location(NAME, CHECKOUT / "__init__.py", submodule_search_locations=[str(CHECKOUT)])
    if spec is None or spec.loader is None:
        raise ImportError(f"{CHECKOUT} is no package")
    module = importlib.util.module_from_spec(spec)
    sys.modules[NAME] = module
    spec.loader.exec_module(module)
    return module


def extension_repositories() -> list[str]:
    """Blender's extension repositories; none without Blender.

    Importing ``bpy`` also puts the wheels of the installed extensions on the import path.
    """
    if importlib.util.find_spec("bpy") is None:
        return []
    import bpy

    return [repository.module for repository in bpy.context.preferences.extensions.repos]
