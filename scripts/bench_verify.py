"""How fast is ``verify``, and how much memory does it take, beside CloudCompare on the same points and mesh?

    python scripts/bench_verify.py [--million-returns 5 20 40] [--queries 300000] [--quick]

Makes a storey of rooms (28 thousand triangles) and scans it from four stations; then runs, each in a process of its own,
``verify`` on the E57 (the model in memory, kernels compiled and exposure known from an earlier run, as on the second day
of a project) and CloudCompare's cloud-to-mesh distance on the same returns as binary PLY. Prints wall time, processor
time and peak memory of both, and the stages of ``verify``.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from headless_entry import package

PACKAGE = package()

from bim_verify.core.jobs import verify  # noqa: E402
from bim_verify.core.model.elements import BuildingModel  # noqa: E402
from bim_verify.core.options import VerifyOptions  # noqa: E402
from bim_verify.core.scans.write_e57 import write_e57  # noqa: E402
from bim_verify.core.scans.write_ply import write_ply  # noqa: E402
from bim_verify.core.simulation.box_building import building_model, four_room_stations, four_rooms, scan  # noqa: E402

DIVISIONS = 7
"""Each edge is cut into so many: the boxes' few triangles become as many as a real model has."""
GRID_SQUARE_DEG = 360.0 * 150.0
"""Of one station's sphere, in steps squared."""


@dataclass(frozen=True)
class Run:
    """One process: seconds of wall and processor, gigabytes at most."""

    wall: float
    processor: float
    memory_gb: float
    output: str


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--million-returns", type=float, nargs="+", default=[5.0, 20.0, 40.0])
    parser.add_argument("--queries", type=int, default=300_000)
    parser.add_argument("--memory-gb", type=float, default=3.0)
    parser.add_argument("--quick", action="store_true", help="one million returns only")
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--make", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    model = dense_building()
    spacing = float(np.sqrt(surface(model) / arguments.queries))
    if arguments.make:
        print(make_scan(model, arguments.million_returns[0], arguments.make))
        return
    if arguments.one:
        verify_once(model, arguments.one, spacing, arguments.memory_gb)
        return
    sizes = [1.0] if arguments.quick else arguments.million_returns
    print(f"{len(model.triangles):,} triangles, {len(model.elements)} elements, {os.cpu_count()} processors, "
          f"load {os.getloadavg()[0]:.1f} at the start", flush=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_mesh(folder / "mesh.ply", model)
        scan_run(folder, 0.2)
        own_run(folder, arguments)  # compiles the kernels and fills the caches
        for million in sizes:
            count = scan_run(folder, million)
            print(f"\n{count:,} returns (load {os.getloadavg()[0]:.1f})", flush=True)
            own = own_run(folder, arguments)
            found = json.loads(own.output)
            report("verify", own)
            print(f"    of it verify() itself {found['wall']:.1f} s: "
                  + ", ".join(f"{stage} {s:.1f}" for stage, s in found["timings"].items()))
            print(f"    {found['queries']:,} query positions, {found['exposed']:,} exposed; {found['summary']}", flush=True)
            if shutil.which("CloudCompare") is None:
                print("  CloudCompare is not installed (Debian package cloudcompare): nothing to compare with")
                continue
            report("CloudCompare", run(
                ["CloudCompare", "-SILENT", "-AUTO_SAVE", "OFF", "-O", "cloud.ply", "-O", "mesh.ply", "-C2M_DIST"], folder
            ))


def dense_building() -> BuildingModel:
    """A storey of four rooms as boxes, with as many triangles as a real building."""
    model = building_model(four_rooms())
    a, b, c = (model.vertices[model.triangles[:, i]] for i in range(3))
    u, v = (b - a) / DIVISIONS, (c - a) / DIVISIONS
    steps = [(i, j) for i in range(DIVISIONS) for j in range(DIVISIONS - i)]
    upright = [[(i, j), (i + 1, j), (i, j + 1)] for i, j in steps]
    turned = [[(i + 1, j), (i + 1, j + 1), (i, j + 1)] for i, j in steps if i + j < DIVISIONS - 1]
    corners = np.stack(
        [np.stack([a + i * u + j * v for i, j in small], axis=1) for small in upright + turned], axis=1
    ).reshape(-1, 3, 3)
    repeat = DIVISIONS**2
    return replace(
        model, vertices=corners.reshape(-1, 3), triangles=np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3),
        triangle_element=np.repeat(model.triangle_element, repeat), transparent=np.repeat(model.transparent, repeat),
    )


def surface(model: BuildingModel) -> float:
    """Area of all triangles, m2."""
    a, b, c = (model.vertices[model.triangles[:, i]] for i in range(3))
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def make_scan(model: BuildingModel, million: float, folder: Path) -> int:
    """Write ``scan.e57`` and the same returns as ``cloud.ply``; how many they are."""
    stations = four_room_stations()
    source = scan(model, stations, step_deg=float(np.sqrt(GRID_SQUARE_DEG * len(stations) / (million * 1e6))))
    write_e57(folder / "scan.e57", source.stations, source.blocks(), scaled_integer_m=1e-5)
    xyz = np.concatenate([s.position + o for s, o in zip(source.stations, source.offsets, strict=True)])
    write_ply(folder / "cloud.ply", dict(zip("xyz", xyz.astype(np.float32).T, strict=True)))
    return len(xyz)


def write_mesh(path: Path, model: BuildingModel) -> None:
    """The model as one binary PLY mesh."""
    face = np.empty(len(model.triangles), dtype=[("count", "u1"), ("row", "<i4", 3)])
    face["count"], face["row"] = 3, model.triangles
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(model.vertices)}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {len(face)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode() + model.vertices.astype("<f4").tobytes() + face.tobytes())


def scan_run(folder: Path, million: float) -> int:
    """``make_scan`` in a new process: this one must stay small, since a process counts its parent's memory as its own."""
    command = [sys.executable, str(Path(__file__).resolve()), "--make", str(folder), "--million-returns", str(million)]
    return int(run(command, folder).output)


def own_run(folder: Path, arguments: argparse.Namespace) -> Run:
    """``verify`` in a new process."""
    return run(
        [sys.executable, str(Path(__file__).resolve()), "--one", str(folder / "scan.e57"),
         "--queries", str(arguments.queries), "--memory-gb", str(arguments.memory_gb)], folder,
    )


def run(command: list[str], folder: Path) -> Run:
    """Run a command and count what it took."""
    with tempfile.TemporaryFile("w+") as output:
        start = time.perf_counter()
        process = subprocess.Popen(
            command, cwd=folder, stdout=output, env={**os.environ, "QT_QPA_PLATFORM": "offscreen"}
        )
        _, status, used = os.wait4(process.pid, 0)
        wall = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        text = output.read()
    if process.returncode:
        raise SystemExit(f"{command[0]} ended with {process.returncode}: {text[-500:]}")
    return Run(wall, used.ru_utime + used.ru_stime, used.ru_maxrss * 1024 / 1e9, text)


def report(name: str, found: Run) -> None:
    """One line."""
    print(f"  {name:13s} {found.wall:6.1f} s wall, {found.processor:6.1f} s processor, {found.memory_gb:.2f} GB at most",
          flush=True)


def verify_once(model: BuildingModel, scan_file: Path, spacing: float, memory_gb: float) -> None:
    """What the measured process does."""
    start = time.perf_counter()
    result = verify(model, [scan_file], VerifyOptions(sample_spacing=spacing, memory_gb=memory_gb))
    print(json.dumps({
        "wall": time.perf_counter() - start, "timings": result.timings, "queries": len(result.samples),
        "exposed": int(result.samples.exposed.sum()), "summary": str(result.summary()),
    }))


if __name__ == "__main__":
    main()
