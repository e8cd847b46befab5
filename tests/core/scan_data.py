"""Scans made in code, in every format, with known truth."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np
from numpy.typing import NDArray

from bim_verify.core.scans.campaign import ReturnBlock, ScanSource, Station
from bim_verify.core.scans.e57_header import quaternion_to_matrix


@dataclass
class Cloud:
    """Points in the scan frame with whole-number intensities."""

    xyz: NDArray[np.float64]
    intensity: NDArray[np.float32]
    color: NDArray[np.uint8]


def make_cloud(count: int = 500, seed: int = 1, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Cloud:
    """Random points on a 0.1 mm raster, so that text with four decimals holds them exactly."""
    rng = np.random.default_rng(seed)
    xyz = np.round(rng.uniform(-20.0, 20.0, (count, 3)) + shift, 4)
    intensity = rng.integers(1, 2000, count).astype(np.float32)
    return Cloud(xyz, intensity, rng.integers(0, 256, (count, 3)).astype(np.uint8))


def station(name: str = "A", *, position: tuple[float, float, float] = (1.0, -2.0, 1.5), known: bool = True) -> Station:
    rotation = quaternion_to_matrix(0.6, 0.3, -0.5, 0.55) if known else np.eye(3)
    return Station(name, np.array(position), rotation, known=known)


def block_of(cloud: Cloud, place: Station, number: int = 0) -> ReturnBlock:
    return ReturnBlock(number, cloud.xyz - place.position, cloud.intensity, cloud.color)


@dataclass
class Whole:
    """All returns of a source."""

    xyz: NDArray[np.float64]
    station: NDArray[np.int64]
    intensity: NDArray[np.float32] | None
    color: NDArray[np.uint8] | None
    row: NDArray[np.int32] | None
    column: NDArray[np.int32] | None


def read_all(source: ScanSource, block_size: int = 1_000_000, *, attributes: bool = True) -> Whole:
    blocks = list(source.blocks(block_size, attributes=attributes))
    assert all(0 < len(block.offsets) <= block_size for block in blocks)

    def joined(name: str) -> NDArray | None:
        parts = [getattr(block, name) for block in blocks]
        return None if any(part is None for part in parts) else np.concatenate(parts)

    return Whole(
        np.concatenate([block.offsets + source.stations[block.station].position for block in blocks]),
        np.concatenate([np.full(len(block.offsets), block.station) for block in blocks]),
        joined("intensity"), joined("color"), joined("row"), joined("column"),
    )


def text_rows(cloud: Cloud, separator: str = " ") -> str:
    lines = [
        separator.join([f"{x:.4f}", f"{y:.4f}", f"{z:.4f}", f"{i:.0f}", *(str(c) for c in rgb)])
        for (x, y, z), i, rgb in zip(cloud.xyz, cloud.intensity, cloud.color, strict=True)
    ]
    return "\n".join(lines) + "\n"


def write_las(path: Path, cloud: Cloud) -> None:
    header = laspy.LasHeader(point_format=2, version="1.2")
    header.scales = np.full(3, 1e-4)
    header.offsets = np.round(cloud.xyz[0])
    las = laspy.LasData(header)
    las.x, las.y, las.z = cloud.xyz.T
    las.intensity = cloud.intensity.astype(np.uint16)
    las.red, las.green, las.blue = (cloud.color.astype(np.uint16) << 8).T
    las.write(path)


def vertex_table(cloud: Cloud, order: str = "<") -> NDArray:
    """Properties in an unusual order, doubles for coordinates, an unknown one among them."""
    table = np.zeros(
        len(cloud.xyz),
        [("green", "u1"), ("z", order + "f8"), ("label", order + "i2"), ("x", order + "f8"), ("red", "u1"),
         ("intensity", order + "f4"), ("y", order + "f8"), ("blue", "u1")],
    )
    table["x"], table["y"], table["z"] = cloud.xyz.T
    table["red"], table["green"], table["blue"] = cloud.color.T
    table["intensity"] = cloud.intensity
    return table


_PLY_NAMES = {"u1": "uchar", "f8": "double", "i2": "short", "f4": "float"}


def ply_header(encoding: str, table: NDArray, count: int | None = None) -> str:
    lines = ["ply", f"format {encoding} 1.0", "comment made in a test", "element camera 1", "property float fov"]
    lines.append(f"element vertex {len(table) if count is None else count}")
    lines += [f"property {_PLY_NAMES[table.dtype[name].str[1:]]} {name}" for name in table.dtype.names or ()]
    return "\n".join([*lines, "element face 0", "property list uchar int vertex_indices", "end_header", ""])


def write_ply_file(path: Path, cloud: Cloud, encoding: str) -> None:
    order = ">" if encoding == "binary_big_endian" else "<"
    table = vertex_table(cloud, order)
    if encoding == "ascii":
        rows = "\n".join(" ".join(repr(value) for value in row.tolist()) for row in table)
        path.write_text(ply_header(encoding, table) + "60.0\n" + rows + "\n")
    else:
        fov = np.array([60.0], order + "f4").tobytes()
        path.write_bytes(ply_header(encoding, table).encode() + fov + table.tobytes())


def pcd_table(cloud: Cloud) -> NDArray:
    table = np.zeros(
        len(cloud.xyz),
        [("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("rgb", "<f4"), ("normal", "<f4", (3,)), ("intensity", "<f4")],
    )
    table["x"], table["y"], table["z"] = cloud.xyz.T
    red, green, blue = cloud.color.astype(np.uint32).T
    table["rgb"] = (red << 16 | green << 8 | blue).view(np.float32)
    table["intensity"] = cloud.intensity
    return table


def pcd_header(data: str, width: int, height: int = 1, viewpoint: str = "0 0 0 1 0 0 0") -> str:
    return (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb normal intensity\n"
        f"SIZE 8 8 8 4 4 4\nTYPE F F F F F F\nCOUNT 1 1 1 1 3 1\nWIDTH {width}\nHEIGHT {height}\n"
        f"VIEWPOINT {viewpoint}\nPOINTS {width * height}\nDATA {data}\n"
    )


def pack_lzf(data: bytes) -> bytes:
    """LZF that uses back references for runs of equal bytes only."""
    out = bytearray()
    at = 0
    while at < len(data):
        run = 1
        while at + run < len(data) and run < 265 and data[at + run] == data[at]:
            run += 1
        if run >= 5:
            out += bytes([0, data[at]])
            rest = run - 1
            if rest - 2 < 7:
                out += bytes([(rest - 2) << 5, 0])
            else:
                out += bytes([7 << 5, rest - 2 - 7, 0])
            at += run
        else:
            out += bytes([0, data[at]])
            at += 1
    return bytes(out)


def write_pcd(path: Path, cloud: Cloud, data: str, *, height: int = 1, viewpoint: str = "0 0 0 1 0 0 0") -> None:
    table = pcd_table(cloud)
    header = pcd_header(data, len(table) // height, height, viewpoint)
    if data == "ascii":
        rows = "\n".join(
            " ".join(repr(float(v)) for v in (*row.tolist()[:4], *row["normal"], row["intensity"])) for row in table
        )
        path.write_text(header + rows + "\n")
    elif data == "binary":
        path.write_bytes(header.encode() + table.tobytes())
    else:
        plain = b"".join(np.ascontiguousarray(table[name]).tobytes() for name in table.dtype.names or ())
        packed = pack_lzf(plain)
        path.write_bytes(header.encode() + struct.pack("<II", len(packed), len(plain)) + packed)


def ptx_scan(cloud: Cloud, place: Station, columns: int, missing: NDArray[np.bool_] | None = None) -> str:
    """One scan, points in the sensor frame with nine decimals; ``missing`` are written as zeros."""
    matrix = np.eye(4)
    matrix[:3, :3] = place.rotation.T
    matrix[3, :3] = place.position
    head = [str(columns), str(len(cloud.xyz) // columns)]
    for row in (place.position, *place.rotation.T, *matrix):
        head.append(" ".join(f"{value:.15f}" for value in row))
    local = (cloud.xyz - place.position) @ place.rotation
    rows = []
    for k, (point, i, rgb) in enumerate(zip(local, cloud.intensity, cloud.color, strict=True)):
        if missing is not None and missing[k]:
            rows.append("0 0 0 0.500000 0 0 0")
        else:
            rows.append(" ".join([*(f"{v:.9f}" for v in point), f"{i:.0f}", *(str(c) for c in rgb)]))
    return "\n".join(head + rows) + "\n"
