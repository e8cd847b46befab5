"""From query positions to elements and patches: numbers, levels, what hides what, and what to do."""

from __future__ import annotations

import math
from collections import defaultdict
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..evidence.thresholds import Thresholds
from ..model.elements import BuildingModel
from ..model.samples import SurfaceSamples
from ..sensing.loa import UPPER_BOUND_M
from .face_returns import FaceReturns, face_returns
from .faces import Face
from .levels import Need, corrective_actions, gsa_level, supported_loa
from .measure import measure
from .noise import EdgeStudy, GeneralGaussian, OverlapResiduals, fit_general_gaussian
from .occluders import Blocked, Clutter
from .options import QualityOptions
from .prediction import SPACINGS_M, ErrorTable, component_class, table_for, with_registration
from .results import ElementQuality, Hidden, Measured, PatchQuality
from .survey import Survey

LEAST_HIDDEN_M2 = 0.001
MOST_HIDDEN = 12
"""Occluders listed per element, largest first."""


class Assessor:
    """Assesses one element after the other; ``tables`` are looked up once a size."""

    def __init__(
        self, model: BuildingModel, samples: SurfaceSamples, found: Survey, blocked: Blocked,
        clutter: tuple[Clutter, ...], overlap: OverlapResiduals, edges: EdgeStudy, faces: list[Face | None],
        registration: float, place: float, station_names: tuple[str, ...], positions: NDArray[np.float64],
        options: QualityOptions,
    ) -> None:
        self.model, self.samples, self.found, self.blocked = model, samples, found, blocked
        self.clutter, self.overlap, self.faces = clutter, overlap, faces
        self.registration, self.place, self.names, self.options = registration, place, station_names, options
        self.spacing, self.positions = found.spacing, positions
        self.start = samples.first_of(len(model.elements))
        order = np.argsort(edges.element, kind="stable")
        self._edge_residual = edges.residual[order]
        self._edge_start = np.searchsorted(edges.element[order], np.arange(len(model.elements) + 1))

    def element(self, row: int) -> ElementQuality:
        """One element."""
        element = self.model.elements[row]
        rows = self.start[row] + np.flatnonzero(self.samples.exposed[self.start[row] : self.start[row + 1]])
        measured = measure(rows, self.samples, self.found, self.overlap, self.spacing)
        edge, mixed = self._edges(row)
        kind = component_class(element.ifc_class)
        face = self.faces[row]
        returns = self._returns(face, rows)
        table = table_for(face, cache=self.options.cache) if face is not None and returns is not None else None
        error = self._error(table, element.ifc_class, returns)
        sigma = None if measured.noise is None else math.hypot(measured.noise, self.registration, self.place)
        loa = supported_loa(sigma, error, measured.coverage, Thresholds.partial_coverage)
        need = self._need(table, element.ifc_class, returns, measured, sigma)
        actions = corrective_actions(measured, need)
        hidden, offset = self._hidden(rows), self._offset(rows)
        return ElementQuality(
            global_id=element.global_id, ifc_class=element.ifc_class, name=element.name, storey=element.storey,
            measured=measured, edge_noise=edge.sigma if edge else None, edge_shape=edge.beta if edge else None,
            mixed_share=mixed, hidden=hidden, component=kind, predicted_error=error,
            gsa_level=gsa_level(error, measured.spacing, measured.coverage, Thresholds.partial_coverage),
            supported_loa=loa, actions=actions,
            reason=_reason(measured, hidden, error, need, offset, self.options), built_offset=offset,
        )

    def patches(self, row: int, face_of: NDArray[np.int64]) -> list[PatchQuality]:
        """The element cut into faces and these into squares. ``face_of`` (N,) number of each sample's face."""
        rows = self.start[row] + np.flatnonzero(self.samples.exposed[self.start[row] : self.start[row + 1]])
        if not len(rows):
            return []
        normal = self.samples.normal[rows]
        across = np.where(np.abs(normal[:, [2]]) < 0.95, np.cross([0.0, 0.0, 1.0], normal), [[1.0, 0.0, 0.0]])
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
        u = np.einsum("ij,ij->i", self.samples.position[rows], across)
        v = np.einsum("ij,ij->i", self.samples.position[rows], np.cross(normal, across))
        size = self.options.patch_size
        key = np.column_stack([face_of[rows], np.floor(u / size), np.floor(v / size)]).astype(np.int64)
        label = np.unique(key, axis=0, return_inverse=True)[1].ravel()
        order = np.argsort(label, kind="stable")
        edge = np.searchsorted(label[order], np.arange(int(label.max()) + 2))
        out = []
        for begin, end in pairwise(edge):
            own = rows[order[begin:end]]
            center = self.samples.position[own].mean(axis=0) + self.model.origin
            mean = self.samples.normal[own].mean(axis=0)
            out.append(PatchQuality(
                row, _triple(center), _triple(mean / max(float(np.linalg.norm(mean)), 1e-12)),
                measure(own, self.samples, self.found, self.overlap, self.spacing),
            ))
        return out

    def _edges(self, row: int) -> tuple[GeneralGaussian | None, float | None]:
        residual = self._edge_residual[self._edge_start[row] : self._edge_start[row + 1]]
        if not len(residual):
            return None, None
        known = np.isfinite(residual)
        return fit_general_gaussian(residual[known]), float(1.0 - known.mean())

    def _returns(self, face: Face | None, rows: NDArray[np.int64]) -> FaceReturns | None:
        if face is None:
            return None
        return face_returns(face, rows, self.samples, self.found, self.spacing, self.positions)

    def _error(self, table: ErrorTable | None, ifc_class: str, returns: FaceReturns | None) -> float | None:
        if table is None or returns is None:
            return None
        error = table.expected(component_class(ifc_class), returns.spacing, returns.noise, returns.across.tolist())
        if not math.isfinite(error):
            return None
        return with_registration(error, self.registration, returns.stations, self.place)

    def _need(
        self, table: ErrorTable | None, ifc_class: str, returns: FaceReturns | None, measured: Measured, sigma: float | None
    ) -> Need:
        bound = UPPER_BOUND_M[self.options.loa]
        factor = 1.0
        if table is not None and returns is not None:
            errors = [table.expected(component_class(ifc_class), s, returns.noise) for s in SPACINGS_M]
            allowed = [s for s, e in zip(SPACINGS_M, errors, strict=True) if e <= bound]
            factor = returns.spacing / max(allowed) if allowed else math.inf
        return Need(
            coverage=measured.area > 0 and measured.coverage < self.options.target_coverage,
            spacing=factor,
            noise=sigma is not None and 2.0 * sigma > bound,
        )

    def _offset(self, rows: NDArray[np.int64]) -> float | None:
        moved = self.found.moved[rows]
        faces, inverse = np.unique(moved, return_inverse=True)
        area = np.bincount(inverse.ravel(), weights=self.samples.area[rows] * (moved != 0), minlength=len(faces))
        return float(faces[np.argmax(area)]) if area.any() else None

    def _hidden(self, rows: NDArray[np.int64]) -> tuple[Hidden, ...]:
        """What hides parts of the element, largest first."""
        area: dict[tuple[str, str, int], float] = defaultdict(float)
        own = rows[(self.blocked.element[rows] >= 0) | (self.blocked.clutter[rows] >= 0)]
        if not len(own):
            return ()
        key = np.column_stack([self.blocked.element[own], self.blocked.clutter[own], self.found.best.station[own]])
        kinds, inverse = np.unique(key, axis=0, return_inverse=True)
        total = np.bincount(inverse.ravel(), weights=self.samples.area[own])
        for (element, thing, station), hidden in zip(kinds, total, strict=True):
            if hidden < LEAST_HIDDEN_M2:
                continue
            if element >= 0:
                blocker = self.model.elements[element]
                label = blocker.global_id, f"{blocker.ifc_class} {blocker.name}".strip()
            else:
                label = self.clutter[thing].name, self.clutter[thing].name
            area[(*label, int(station))] += float(hidden)
        largest = sorted(area.items(), key=lambda item: (-item[1], item[0]))[:MOST_HIDDEN]
        return tuple(Hidden(occluder, name, self.names[s], a) for (occluder, name, s), a in largest)


def _reason(
    measured: Measured, hidden: tuple[Hidden, ...], error: float | None, need: Need, offset: float | None,
    options: QualityOptions,
) -> str:
    if measured.area <= 0:
        return "Other elements cover its whole surface, so no scanner can see it."
    if measured.coverage <= 0:
        return f"No station has a return on it: {_largest(measured, hidden)}."
    text = f"{measured.coverage:.0%} of its free surface has returns"
    if measured.spacing is not None:
        text += f", {1000 * measured.spacing:.1f} mm apart"
    if error is not None:
        text += f"; a model of it is expected to be {1000 * error:.1f} mm off"
    text += "."
    if offset is not None:
        text += f" It stands {1000 * abs(offset):.0f} mm off its plan and was measured there."
    if need.coverage:
        text += f" Of what is missing, most is {_largest(measured, hidden)}."
    if need.spacing > 1 and math.isfinite(need.spacing):
        text += f" Returns must be {need.spacing:.1f} times closer for LOA{options.loa}."
    return text


def _largest(measured: Measured, hidden: tuple[Hidden, ...]) -> str:
    cause = max(measured.missing, key=lambda c: measured.missing[c])
    if cause == "occluded" and hidden:
        return f"occluded, by {hidden[0].name} from {hidden[0].station}"
    return cause


def _triple(values: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
