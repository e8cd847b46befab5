"""Does the same scan give the same verdicts, whatever the files it comes in and wherever it stands?

    python scripts/bench_formats.py [--spacing-mm 100]

Makes the demo house and its scan, and verifies it as it is; split in two files; in another order; as PTX; with model and
scan 1,000 km away. Then one station of it, without its position in the file: LAS, LAZ, PLY, PCD, XYZ, PTS and NPY with
``--origin``. Prints, for each, how many verdicts differ from the first and the largest difference of a shift. Ends with 1
when a verdict differs.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import laspy
import numpy as np
from headless_entry import package
from numpy.typing import NDArray

PACKAGE = package()

from bim_verify.core.jobs import verify  # noqa: E402
from bim_verify.core.options import VerifyOptions  # noqa: E402
from bim_verify.core.results import VerificationResult  # noqa: E402
from bim_verify.core.scans.campaign import ReturnBlock, Station  # noqa: E402
from bim_verify.core.scans.open import open_scans  # noqa: E402
from bim_verify.core.scans.write_e57 import write_e57  # noqa: E402
from bim_verify.core.scans.write_ply import write_ply  # noqa: E402
from bim_verify.core.simulation.demo import make_demo  # noqa: E402

AWAY_M = np.array([800_000.0, 600_000.0, 100.0])
"""1,000 km."""
RESOLUTION_M = 1e-5
STATION = 4
"""The one in the living room."""

Returns = list[tuple[Station, NDArray[np.float64]]]
"""Stations and their returns as offsets, metres."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spacing-mm", type=float, default=100.0)
    spacing = parser.parse_args().spacing_mm / 1000
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        demo = make_demo(folder)
        returns = read(demo.scan)
        ok = compare(
            "E57 of 11 stations", demo.model, [write_scans(folder / "whole.e57", returns)], spacing, None,
            {
                "E57 of scaled integers": lambda: (demo.model, [demo.scan]),
                "split in two files": lambda: (demo.model, halves(folder, returns)),
                "in another order": lambda: (demo.model, [reversed_order(folder, returns)]),
                "PTX": lambda: (demo.model, [ptx(folder / "scan.ptx", returns)]),
                "1,000 km away": lambda: (move(demo.model, folder / "away.ifc"), [away(folder, returns)]),
            },
        )
        station, offsets = returns[STATION]
        xyz = station.position + offsets
        x, y, z = (float(v) for v in station.position)
        whole = folder / "one.e57"
        write_e57(whole, [station], [ReturnBlock(0, offsets)])
        ok &= compare(
            "E57 of one station", demo.model, [whole], spacing, (x, y, z),
            {kind: lambda kind=kind: (demo.model, [write_cloud(folder / f"one.{kind}", xyz)])  # type: ignore[misc]
             for kind in ("las", "laz", "ply", "pcd", "xyz", "pts", "npy")},
        )  # fmt: skip
    return 0 if ok else 1


def compare(
    name: str, model: Path, scans: list[Path], spacing: float, origin: tuple[float, float, float] | None,
    others: dict[str, Callable[[], tuple[Path, list[Path]]]],
) -> bool:
    """Verify all and print one line for each; whether all verdicts are those of the first."""
    options = VerifyOptions(sample_spacing=spacing, origin=origin)
    first = verify(model, scans, options)
    print(f"{name}: {first.summary()}", flush=True)
    same = True
    for other, make in others.items():
        files = make()
        found = verify(*files, options)
        differing = [a.name for a, b in zip(first.verdicts, found.verdicts, strict=True) if a.status != b.status]
        print(f"  {other}: {len(differing)} verdicts differ {differing[:5]}, "
              f"shifts by at most {1000 * largest_difference(first, found):.3f} mm", flush=True)
        same &= not differing
        for file in files[1]:
            file.unlink()
    return same


def largest_difference(first: VerificationResult, second: VerificationResult) -> float:
    """Of the displacement vectors that both have, metres."""
    pairs = [
        (a.displacement_vector, b.displacement_vector) for a, b in zip(first.verdicts, second.verdicts, strict=True)
        if a.displacement_vector and b.displacement_vector
    ]
    return max((float(np.abs(np.subtract(a, b)).max()) for a, b in pairs), default=0.0)


def read(path: Path) -> Returns:
    source = open_scans([path])
    parts: list[list[NDArray[np.float64]]] = [[] for _ in source.stations]
    for block in source.blocks():
        parts[block.station].append(block.offsets)
    return [(station, np.concatenate(part)) for station, part in zip(source.stations, parts, strict=True)]


def blocks(returns: Returns) -> Iterator[ReturnBlock]:
    return (ReturnBlock(index, offsets) for index, (_, offsets) in enumerate(returns))


def write_scans(path: Path, returns: Returns) -> Path:
    write_e57(path, [station for station, _ in returns], blocks(returns))
    return path


def halves(folder: Path, returns: Returns) -> list[Path]:
    """Every station's returns in two files, every second one."""
    return [write_scans(folder / f"half{k}.e57", [(s, o[k::2]) for s, o in returns]) for k in (0, 1)]


def reversed_order(folder: Path, returns: Returns) -> Path:
    return write_scans(folder / "order.e57", [(s, o[::-1]) for s, o in reversed(returns)])


def away(folder: Path, returns: Returns) -> Path:
    moved = [(Station(s.name, s.position + AWAY_M, s.rotation), o) for s, o in returns]
    return write_scans(folder / "away.e57", moved)


def move(model: Path, target: Path) -> Path:
    """The model 1,000 km away: everything that is placed in the world is moved."""
    import ifcopenshell
    import ifcopenshell.util.unit

    file = ifcopenshell.open(str(model))
    unit = float(ifcopenshell.util.unit.calculate_unit_scale(file))
    for placement in file.by_type("IfcLocalPlacement"):
        if placement.PlacementRelTo is None:
            axes = placement.RelativePlacement
            place = np.array(axes.Location.Coordinates) + AWAY_M / unit
            axes.Location = file.create_entity("IfcCartesianPoint", place.tolist())
    file.write(str(target))
    return target


def ptx(path: Path, returns: Returns) -> Path:
    with path.open("w") as file:
        for station, offsets in returns:
            matrix = np.eye(4)
            matrix[:3, :3], matrix[3, :3] = station.rotation.T, station.position
            file.write(f"1\n{len(offsets)}\n")
            for row in (station.position, *station.rotation.T, *matrix):
                file.write(" ".join(f"{v:.15f}" for v in row) + "\n")
            local = offsets @ station.rotation
            np.savetxt(file, np.column_stack([local, np.full(len(local), 0.5)]), fmt="%.5f")
    return path


def write_cloud(path: Path, xyz: NDArray[np.float64]) -> Path:
    """A cloud without the scanner's position, to 0.01 mm."""
    kind = path.suffix[1:]
    if kind in ("las", "laz"):
        header = laspy.LasHeader(point_format=6, version="1.4")
        header.scales, header.offsets = np.full(3, RESOLUTION_M), np.floor(xyz.min(axis=0))
        cloud = laspy.LasData(header)
        cloud.x, cloud.y, cloud.z = xyz.T
        cloud.write(str(path))
    elif kind == "ply":
        write_ply(path, dict(zip("xyz", xyz.T, strict=True)))
    elif kind == "npy":
        np.save(path, xyz)
    else:
        heads: dict[str, Sequence[str]] = {
            "pts": [str(len(xyz))],
            "pcd": ["# .PCD v0.7", "VERSION 0.7", "FIELDS x y z", "SIZE 8 8 8", "TYPE F F F", "COUNT 1 1 1",
                    f"WIDTH {len(xyz)}", "HEIGHT 1", "VIEWPOINT 0 0 0 1 0 0 0", f"POINTS {len(xyz)}", "DATA ascii"],
        }  # fmt: skip
        np.savetxt(path, xyz, fmt="%.5f", header="\n".join(heads.get(kind, [])), comments="")
        if kind == "xyz":
            path.write_text(path.read_text().lstrip("\n"))
    return path


if __name__ == "__main__":
    raise SystemExit(main())
