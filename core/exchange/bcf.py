"""BCF 3.0 and 2.1: one topic a finding, with the camera that shows it, a picture, and the element's GlobalId.

Every file name in the archive is a GUID made here from the element's GlobalId; no name of the model becomes a path. The
same finding has the same topic GUID in every run, so that a tool that imports the file again updates its topics.
"""

from __future__ import annotations

import datetime
import io
import re
import uuid
from collections.abc import Collection
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..errors import BimVerifyError
from ..files import whole_file
from ..model.raycast import RayScene
from ..progress import Progress
from ..report.camera import Camera
from ..report.palette import STATUS_HEX, rgb, to_linear
from ..report.render import face_pixels, shade_view, trace_view
from ..results import Status, VerificationResult
from .findings import DEFAULT_STATUSES, Finding, findings, plain_text
from .viewpoint import finding_camera

Version = Literal["3.0", "2.1"]
VERSIONS: tuple[Version, ...] = ("3.0", "2.1")
NAMESPACE = uuid.UUID("6f0c2b6e-52a5-4c39-9f8e-0f2a4b0a7d11")
"""Of the topics' GUIDs."""
PICTURE_SIZE = (480, 360)
TYPES: dict[str, str] = {
    "ABSENT": "Error", "DEVIATING": "Error", "PARTIAL": "Warning", "NOTOBSERVED": "Info", "CONFIRMED": "Info",
}  # fmt: skip
PRIORITIES: dict[str, str] = {
    "ABSENT": "High", "DEVIATING": "High", "PARTIAL": "Normal", "NOTOBSERVED": "Low", "CONFIRMED": "Low",
}  # fmt: skip
AUTHOR = "bim_verify"
IFC_GUID = re.compile(r"[0-9A-Za-z_$]{22}")
OTHERS: tuple[float, float, float] = (0.80, 0.80, 0.79)


def write_bcf(
    path: str | Path,
    result: VerificationResult,
    *,
    version: Version = "3.0",
    statuses: Collection[Status] = DEFAULT_STATUSES,
    global_ids: Collection[str] | None = None,
    pictures: bool = True,
    progress: Progress | None = None,
) -> int:
    """Write one topic a finding and return how many; BimVerifyError when ``path`` cannot be written.

    ``statuses``: which verdicts are findings. ``global_ids``: only these elements. ``pictures``: with a snapshot each.
    """
    if version not in VERSIONS:
        raise BimVerifyError(f"BCF {version} is not written; choose {' or '.join(VERSIONS)}.")
    progress = progress or Progress()
    chosen = findings(result, statuses, global_ids)
    writer = _Writer(result, version)
    scene = RayScene(result.model) if chosen else None
    first = result.samples.first_of(len(result.verdicts))
    grey = to_linear(np.tile(np.array(OTHERS), (len(result.model.triangles), 1)))
    for number, finding in enumerate(chosen):
        progress.update(number / len(chosen), "Drawing the findings")
        assert scene is not None
        part = slice(int(first[finding.row]), int(first[finding.row + 1]))
        samples = result.samples
        aspect = PICTURE_SIZE[0] / PICTURE_SIZE[1]
        camera = finding_camera(result.model, finding.row, samples.position[part], samples.normal[part], scene, aspect)
        snapshot = None
        if pictures:
            own = slice(result.model.triangle_start[finding.row], result.model.triangle_start[finding.row + 1])
            colors = grey.copy()
            colors[own] = to_linear(np.array(rgb(STATUS_HEX[finding.status])))
            view = trace_view(result.model, camera, PICTURE_SIZE, scene=scene)
            snapshot = _png(shade_view(view, face_pixels(view, colors), background=(1.0, 1.0, 1.0)))
        writer.add(number, finding, camera, snapshot)
    with whole_file(path) as temporary:
        writer.archive.save(temporary)
    progress.update(1.0, "BCF written")
    return len(chosen)


def topic_guid(global_id: str) -> str:
    """The GUID of the topic on an element."""
    return str(uuid.uuid5(NAMESPACE, global_id))


def _date(text: str) -> datetime.datetime | None:
    """The day or time of a scan as a time with a zone; None where the scans do not say it."""
    try:
        found = datetime.datetime.fromisoformat(text)
    except ValueError:
        return None
    return (found if found.tzinfo else found.replace(tzinfo=datetime.UTC)).replace(microsecond=0)


def _written(path: str) -> Any | None:
    """When a file was written last; None where it is gone."""
    from xsdata.models.datatype import XmlDateTime

    try:
        written = datetime.datetime.fromtimestamp(int(Path(path).stat().st_mtime), datetime.UTC)
    except OSError:
        return None
    return XmlDateTime.from_datetime(written)


class _Writer:
    """Where the two versions differ."""

    def __init__(self, result: VerificationResult, version: Version) -> None:
        self._result, self._v3 = result, version == "3.0"
        project = plain_text(result.model.project_name) or Path(result.model.path).name
        self._now = datetime.datetime.now(datetime.UTC).replace(microsecond=0)
        self._seen = _date(result.scan_date) or self._now
        if self._v3:
            from bcf.v3 import bcfxml, model, topic, visinfo

            extensions = model.Extensions(
                topic_types=model.ExtensionsTopicTypes(topic_type=sorted(set(TYPES.values()))),
                topic_statuses=model.ExtensionsTopicStatuses(topic_status=["Open", "Closed"]),
                priorities=model.ExtensionsPriorities(priority=["High", "Normal", "Low"]),
                topic_labels=model.ExtensionsTopicLabels(topic_label=sorted(STATUS_HEX)),
                users=model.ExtensionsUsers(user=[AUTHOR]),
            )
            self.archive: Any = bcfxml.BcfXml.create_new(project, extensions)
            self._model: Any = model
        else:
            from bcf.v2 import bcfxml, topic, visinfo  # type: ignore[no-redef]
            from bcf.v2 import model as model2

            self.archive = bcfxml.BcfXml.create_new(project)
            self.archive.project_info = None  # its extension schema would be a file that nobody needs
            self.archive.version = model2.Version(version_id="2.1", detailed_version="2.1")
            self._model = model2
        self._topic: Any = topic
        self._visinfo: Any = visinfo

    def add(self, number: int, finding: Finding, camera: Camera, snapshot: bytes | None) -> None:
        from xsdata.models.datatype import XmlDateTime

        m = self._model
        guid = topic_guid(finding.verdict.global_id)
        if guid in self.archive.topics:  # some files use a GlobalId twice
            guid = topic_guid(f"{finding.verdict.global_id} #{self._result.model.elements[finding.row].step_id}")
        handler = self._topic.TopicHandler.create_new(
            finding.title, finding.text, AUTHOR, topic_type=TYPES[finding.status], topic_status="Open"
        )
        topic = handler.topic
        topic.guid, topic.index, topic.priority = guid, number, PRIORITIES[finding.status]
        topic.creation_date, topic.modified_date = map(XmlDateTime.from_datetime, (self._seen, self._now))
        topic.modified_author = AUTHOR
        topic.labels = m.TopicLabels(label=[finding.status]) if self._v3 else [finding.status]
        handler._topic_dir = Path(guid)  # where bcf-client keeps the folder's name
        model = self._result.model
        file = (m.File if self._v3 else m.HeaderFile)(
            filename=plain_text(Path(model.path).name), is_external=True, date=_written(model.path),
            ifc_project=model.project_id if IFC_GUID.fullmatch(model.project_id) else None,
        )
        handler.header = m.Header(files=m.HeaderFiles(file=[file])) if self._v3 else m.Header(file=[file])
        view = self._visinfo.VisualizationInfoHandler(self._view(finding, camera), snapshot)
        handler.add_visinfo_handler(view, f"{view.guid}.png" if snapshot is not None else None)
        self.archive.topics[guid] = handler

    def _view(self, finding: Finding, camera: Camera) -> Any:
        m = self._model
        component = m.Component(ifc_guid=plain_text(finding.verdict.global_id), originating_system=AUTHOR)
        color = STATUS_HEX[finding.status].lstrip("#").upper()
        if self._v3:
            colored = m.ComponentColoringColor(
                components=m.ComponentColoringColorComponents(component=[component]), color=color
            )
        else:
            colored = m.ComponentColoringColor(component=[component], color=color)
        eye = camera.center - camera.reach * camera.forward + self._result.model.origin
        orthogonal = {
            "camera_view_point": self._triple(m.Point, eye),
            "camera_direction": self._triple(m.Direction, camera.forward),
            "camera_up_vector": self._triple(m.Direction, camera.up),
            "view_to_world_scale": float(camera.width * PICTURE_SIZE[1] / PICTURE_SIZE[0]),
        }
        if self._v3:
            orthogonal["aspect_ratio"] = PICTURE_SIZE[0] / PICTURE_SIZE[1]
        return m.VisualizationInfo(
            guid=str(uuid.uuid5(NAMESPACE, f"view {finding.verdict.global_id}")),
            components=m.Components(
                selection=m.ComponentSelection(component=[component]),
                visibility=m.ComponentVisibility(default_visibility=True),
                coloring=m.ComponentColoring(color=[colored]),
            ),
            orthogonal_camera=m.OrthogonalCamera(**orthogonal),
        )

    @staticmethod
    def _triple(kind: Any, values: NDArray[np.float64]) -> Any:
        x, y, z = (float(v) for v in values)
        return kind(x=x, y=y, z=z)


def _png(image: NDArray[np.uint8]) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(image).convert("RGB").quantize(128).save(stream, "PNG", optimize=True)
    return stream.getvalue()
