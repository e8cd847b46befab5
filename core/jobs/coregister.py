"""Photos onto a model: from an IFC file, images and coarse cameras to refined cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ... import __version__
from ..errors import BimVerifyError
from ..imagery.cameras_file import CameraList, KnownCamera, cameras_of, read_cameras, shifted
from ..imagery.coregistration import CoregisterOptions, CoregistrationResult, is_placed
from ..imagery.detect_lines import detect_lines
from ..imagery.model_edges import sharp_edges
from ..imagery.read_image import check_image, read_grey
from ..imagery.register_image import register_image
from ..imagery.visible_edges import EdgeViewer
from ..model.elements import BuildingModel
from ..model.load import load_model
from ..progress import Progress
from ..sensing.loa import level_sigma
from .inputs import Stopwatch, limited_threads


def coregister(
    model: BuildingModel | str | Path,
    images: Sequence[str | Path],
    cameras: CameraList | str | Path,
    options: CoregisterOptions | None = None,
    progress: Progress | None = None,
) -> CoregistrationResult:
    """Refine the poses of ``images`` by lines that lie on edges of the model. Nothing is written.

    Raises BimVerifyError with one sentence when a file cannot be used or no image could be placed.
    """
    options, progress = options or CoregisterOptions(), progress or Progress()
    if len({str(Path(p).resolve()) for p in images}) < len(images):
        raise BimVerifyError("An image is named twice; name every image once.")
    known = cameras if isinstance(cameras, CameraList) else read_cameras(cameras)
    rows = cameras_of(images, [k.camera.name for k in known.cameras])
    chosen = [known.cameras[row] for row in rows]
    for path, one in zip(images, chosen, strict=True):
        check_image(path, (one.camera.interior.width, one.camera.interior.height))
    with limited_threads(options.threads):
        watch = Stopwatch()
        if not isinstance(model, BuildingModel):
            model = load_model(model, threads=options.threads, cache=options.cache, progress=progress.part(0.0, 0.3))
        chosen = [_local(one, known.frame, model) for one in chosen]
        watch.lap("tessellation")
        viewer = EdgeViewer(model, sharp_edges(model))
        watch.lap("edges")
        found = []
        for number, (path, one) in enumerate(zip(images, chosen, strict=True)):
            progress.update(0.3 + 0.7 * number / len(chosen), f"Registering {Path(path).name}")
            lens = one.camera.interior
            lines = detect_lines(read_grey(path, (lens.width, lens.height)), lens, options.detector)
            found.append(register_image(
                viewer, lines, one, model_sigma=level_sigma(options.loa), focal=options.focal, seed=options.seed
            ))
        watch.lap("registration")
    if not any(is_placed(one) for one in found):
        raise BimVerifyError(f"None of the images could be placed. {Path(images[0]).name}: {found[0].note}")
    warnings = tuple(f"{Path(p).name}: {one.note}" for p, one in zip(images, found, strict=True) if one.note)
    progress.update(1.0, "Images registered")
    return CoregistrationResult(
        model=model, images=tuple(str(p) for p in images), registrations=tuple(found), options=options,
        method=f"bim_verify {__version__} coregister", timings=dict(watch.seconds), warnings=warnings,
    )


def _local(known: KnownCamera, frame: str, model: BuildingModel) -> KnownCamera:
    """The camera in the model's local frame."""
    if frame == "map":
        conversion = model.map_conversion
        if conversion is None:
            raise BimVerifyError(f"The cameras are in the map's frame, but {model.path} has no map conversion.")
        camera = known.camera
        position = conversion.to_model(camera.position[None])[0]
        ends = conversion.to_model(camera.position + camera.rotation * conversion.scale) - position
        known = replace(known, camera=replace(camera, position=position, rotation=ends))
    return shifted(known, model.origin)
