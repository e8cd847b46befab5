"""From the scene's settings to what core wants, and where things come from when Bonsai holds the project."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.errors import BimVerifyError
from ..core.options import InputOptions, VerifyOptions
from ..core.progress import Progress
from ..core.scans.origins import Origins, parse_origins
from . import bonsai, frame
from .session import SESSION

if TYPE_CHECKING:
    from ..core.model.elements import BuildingModel
    from ..core.results import VerificationResult


def options(settings: bpy.types.PropertyGroup) -> VerifyOptions:
    """The options of the scene; raises BimVerifyError where one cannot be understood."""
    return VerifyOptions(
        loa=int(settings.loa),
        sigma=settings.sigma_mm / 1000,
        align=settings.align,
        sample_spacing=settings.spacing_mm / 1000,
        fusion=settings.fusion,
        preset=settings.preset,
        registration_sigma=settings.known_sigma(),
        scan_frame=settings.scan_frame,
        origin=scanner_position(settings.origin),
        threads=settings.threads,
        memory_gb=settings.memory_gb,
        dense=tuple(bpy.path.abspath(scan.path) for scan in settings.scans if scan.use and scan.dense),
    )


def take_options(settings: bpy.types.PropertyGroup, given: VerifyOptions) -> None:
    """The settings of the scene as ``options`` has them to give these options again; dense points are scans."""
    settings.loa, settings.sigma_mm, settings.align = str(given.loa), 1000 * given.sigma, given.align
    settings.spacing_mm, settings.fusion, settings.preset = 1000 * given.sample_spacing, given.fusion, given.preset
    settings.take_sigma(given.registration_sigma)
    settings.scan_frame = given.scan_frame
    settings.origin = in_text(given.origin)
    settings.threads, settings.memory_gb = given.threads, given.memory_gb


def in_words(model: BuildingModel) -> str:
    """``96 elements in 2 storeys, IFC4``"""
    storeys = len({element.storey for element in model.elements} - {""})
    return f"{len(model.elements)} elements in {storeys} storey{'s' if storeys != 1 else ''}, {model.schema}"


def scanner_position(text: str) -> Origins:
    """``X,Y,Z`` to metres, or ``FILE=X,Y,Z; FILE=X,Y,Z``; None for an empty text."""
    if not text.strip():
        return None
    entries = [part for part in text.split(";") if part.strip()] if "=" in text else [text.replace(";", ",")]
    return parse_origins("Scanner position", entries)


def in_text(given: Origins) -> str:
    """The reverse of ``scanner_position``."""
    if given is None:
        return ""
    places = given.items() if isinstance(given, Mapping) else [("", given)]
    return "; ".join(f"{name}{'=' * bool(name)}{','.join(repr(float(v)) for v in place)}" for name, place in places)


def scan_paths(settings: bpy.types.PropertyGroup) -> list[str]:
    """The scan files in use, absolute; dense points of photos are none."""
    return [bpy.path.abspath(scan.path) for scan in settings.scans if scan.use and not scan.dense]


def without_repeats(paths: Iterable[str]) -> list[str]:
    """The first of all that name one file."""
    return list({Path(path).resolve(): path for path in reversed(list(paths))}.values())[::-1]


def points_and_stations(path: str, options: VerifyOptions) -> tuple[int, int]:
    """What a scan file says it holds; zeros where it cannot be read."""
    from ..core.scans.open import open_scans

    try:
        source = open_scans([path], origin=options.origin)
    except BimVerifyError:
        return 0, 0
    return source.point_count, len(source.stations)


def epochs(settings: bpy.types.PropertyGroup, grouping: str) -> list[list[str]]:
    """The scan files in use by epoch, earliest first: all as ONE, EACH its own, or NUMBERED by the scans' ``epoch``."""
    paths = scan_paths(settings)
    if grouping == "EACH":
        return [[path] for path in paths]
    if grouping == "ONE":
        return [paths]
    number = [scan.epoch for scan in settings.scans if scan.use and not scan.dense]
    return [[path for path, n in zip(paths, number, strict=True) if n == epoch] for epoch in sorted(set(number))]


def result(scene: bpy.types.Scene) -> VerificationResult | None:
    """The result that the scene shows, with the decisions made since; None when it is not in memory (any more)."""
    from . import verdicts

    found = SESSION.results.get(scene.bim_verify.result_key)
    return None if found is None else replace(found, decisions=verdicts.decisions(scene))


def model_path(settings: bpy.types.PropertyGroup) -> str:
    """The IFC file: Bonsai's, else the scene's; empty when there is none."""
    return bonsai.live_path() or bpy.path.abspath(settings.model_path)


def folder(scene: bpy.types.Scene) -> Path:
    """Where to propose a file: beside the .blend file, else beside the model, else at home."""
    if bpy.data.filepath:
        return Path(bpy.data.filepath).parent
    model = model_path(scene.bim_verify)
    return Path(model).parent if model else Path.home()


def has_model(settings: bpy.types.PropertyGroup) -> bool:
    """A model is there: Bonsai holds one, or the scene names a file."""
    return bonsai.live_file() is not None or bool(settings.model_path)


def model_loader(scene: bpy.types.Scene, path: str = "") -> Callable[[Progress], BuildingModel]:
    """How to get the model at ``path`` (default: the scene's), for a worker thread. Call this on the main thread.

    What Bonsai holds in memory is written to a temporary file here, so that edits that were not saved count, and
    nothing of Bonsai is used in another thread.
    """
    from ..core.model.load import load_model

    threads = scene.bim_verify.threads
    if (live := bonsai.live_copy()) is not None:
        folder, copy = live
        known = bonsai.live_path() or "unsaved.ifc"

        def load_live(progress: Progress) -> BuildingModel:
            with folder:
                return replace(load_model(copy, threads=threads, progress=progress), path=known)

        return load_live
    path = bpy.path.abspath(path) or model_path(scene.bim_verify)
    loaded = SESSION.models.get(scene.session_uid)

    def load(progress: Progress) -> BuildingModel:
        model = load_model(path, threads=threads, progress=progress)
        return loaded if loaded is not None and loaded.content_hash == model.content_hash else model

    return load


def model_of(file: Any) -> BuildingModel:
    """The model in an ``ifcopenshell.file`` that stands nowhere on disk."""
    from ..core.model.load import load_model

    with tempfile.TemporaryDirectory(prefix="bim_verify_") as folder:
        path = Path(folder) / "model.ifc"
        file.write(str(path))
        return load_model(path, cache=False)


def adopt_frame(scene: bpy.types.Scene, model: BuildingModel | None, cloud: NDArray[np.float64] | None = None) -> None:
    """Set the frame of the scene: Bonsai's, else the model's, else (no model yet) the cloud's ((N, 3) metres)."""
    chosen = bonsai.view_frame(scene)
    if chosen is None and model is not None:
        low, high = model.bounds
        chosen = frame.frame_for(model.origin, float(np.abs([low, high]).max()))
    if chosen is None and cloud is not None and len(cloud) and frame.stored(scene) is None:
        middle = np.median(cloud, axis=0)
        chosen = frame.frame_for(middle, float(np.abs(cloud - middle).max()))
    if chosen is not None and chosen != frame.stored(scene):
        frame.store(scene, chosen)


def placement(model: BuildingModel | None, paths: Sequence[str], options: InputOptions) -> NDArray[np.float64]:
    """(4, 4) from the frame of the scan files to the model frame, metres, as verification takes it without alignment.

    For a worker thread. Without a model, scans stay where they are.
    """
    from ..core.alignment.transform import TransformedSource
    from ..core.scans.frame import to_model_frame
    from ..core.scans.open import open_scans

    if model is None or not paths:
        return np.eye(4)
    given = options.origin
    if given is not None and not isinstance(given, Mapping):  # where points lie does not hang on it: no reason to refuse
        given = dict.fromkeys(paths, given)
    source = to_model_frame(model, open_scans(paths, origin=given), options.scan_frame)
    return source.transform if isinstance(source, TransformedSource) else np.eye(4)
