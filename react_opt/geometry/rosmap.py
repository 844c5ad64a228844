"""ROS map_server maps: a YAML file that names an image and says how its shades are to be read.

Occupancy probability of a shade ``s`` in [0, 1] (black to white) is ``p = 1 - s``, or ``s`` with ``negate``.

============ ==========================================================================================
mode         pixel
============ ==========================================================================================
``trinary``  occupied where ``p > occupied_thresh``, free where ``p < free_thresh``, else unknown
``scale``    the same here: what lies between the thresholds is neither surely free nor surely occupied
``raw``      the image's value on 0..255 is the occupancy in percent and is compared with the thresholds;
             above 100 it is unknown; ``negate`` has no meaning (as in Nav2)
============ ==========================================================================================

Colours count as the mean of their channels. A pixel that is not opaque is unknown in every mode; map_server
does so for ``scale`` only and averages alpha into the shade in ``trinary``, where an opaque grey 205 would
become free. Images of 16 bits or with another maxval keep their precision. Image rows run from the top down,
map rows from the bottom up.
"""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from react_opt.errors import Fault, InputError, UsageError
from react_opt.geometry.occupancy import FREE, MAX_PIXELS, OCCUPIED, UNKNOWN, OccupancyMap
from react_opt.jsonio import write_bytes

Mode = Literal["trinary", "scale", "raw"]
_MODES = ("trinary", "scale", "raw")
_FORMATS = ("PPM", "PNG", "BMP", "GIF", "JPEG", "TIFF")  # map_server's; not all Pillow has: EPS runs a programme
_MAX_YAML_BYTES = 1_000_000


@dataclass(frozen=True)
class _Header:
    """The content of a map YAML, checked."""

    image: Path
    resolution_m: float
    origin: tuple[float, float, float]
    negate: bool
    occupied_thresh: float
    free_thresh: float
    mode: Mode

    def classes(self, white: int) -> NDArray[np.uint8]:
        """Return the class of every shade 0..white: the table of this module's docstring."""
        shades = np.arange(white + 1) / white
        if self.mode == "raw":
            percent = np.rint(shades * 255)
            occupancy = np.where(percent <= 100, percent / 100, np.nan)  # NaN is neither above nor below
        else:
            occupancy = shades if self.negate else (white - np.arange(white + 1)) / white
        classes = np.full(white + 1, UNKNOWN, dtype=np.uint8)
        classes[occupancy < self.free_thresh] = FREE
        classes[occupancy > self.occupied_thresh] = OCCUPIED
        return classes


def read_ros_map(path: str | Path) -> OccupancyMap:
    """Read a ROS map.

    Parameters
    ----------
    path
        The YAML file; a relative ``image`` in it is relative to this file.

    Raises
    ------
    InputError
        With every fault of the YAML file at once, or with what is wrong with the image.
    """
    header = _read_header(Path(path))
    shades, white, opaque = _read_image(header.image)
    cells = header.classes(white)[shades]
    if opaque is not None:
        cells[~opaque] = UNKNOWN
    return OccupancyMap(cells[::-1], header.resolution_m, *header.origin)


def write_ros_map(
    map_: OccupancyMap,
    path: str | Path,
    *,
    image_format: Literal["pgm", "png"] = "pgm",
    mode: Mode = "trinary",
    negate: bool = False,
) -> None:
    """Write a ROS map: an image beside the YAML file, then the file itself; both appear whole or not at all.

    Free, occupied and unknown are written as 254, 0 and 205 with ``free_thresh`` 0.196 (map_saver's own
    choice; at 0.25 the unknown pixels would read as free), in raw mode as 0, 100 and 255. In ``scale`` mode
    unknown pixels are transparent, since other readers take a shade between the thresholds as a grade.

    Parameters
    ----------
    map_
        The map.
    path
        The YAML file; the image gets its name with another suffix.
    image_format, mode, negate
        As in the file.

    Raises
    ------
    UsageError
        Where the suffix, the format or the mode is not known, or a PGM would have to be transparent.
    InputError
        Where a file cannot be written.
    """
    path = Path(path)
    if path.suffix not in (".yaml", ".yml"):
        raise UsageError(f"a ROS map is written as .yaml, not {path.name}")
    if image_format not in ("pgm", "png") or mode not in _MODES:
        raise UsageError(f"no such image format or mode: {image_format!r}, {mode!r}")
    top_down = map_.cells[::-1]
    table = np.zeros(3, dtype=np.uint8)
    if mode == "raw":
        table[[FREE, OCCUPIED, UNKNOWN]] = (0, 100, 255)
    else:
        shades = np.array((254, 0, 205), dtype=np.uint8)
        table[[FREE, OCCUPIED, UNKNOWN]] = 255 - shades if negate else shades
    image = Image.fromarray(table[top_down])
    if mode == "scale" and bool((top_down == UNKNOWN).any()):
        if image_format == "pgm":
            raise UsageError("a PGM cannot be transparent: write unknown pixels of a scale map as PNG")
        image.putalpha(Image.fromarray(np.where(top_down == UNKNOWN, 0, 255).astype(np.uint8)))
    buffer = io.BytesIO()
    image.save(buffer, format="PPM" if image_format == "pgm" else "PNG")
    picture = path.with_suffix("." + image_format)
    origin = (float(map_.origin_x_m), float(map_.origin_y_m), float(map_.origin_yaw_rad))
    lines = [
        f"image: {yaml.safe_dump(picture.name).splitlines()[0]}",
        f"mode: {mode}",
        f"resolution: {float(map_.resolution_m)!r}",
        f"origin: [{origin[0]!r}, {origin[1]!r}, {origin[2]!r}]",
        f"negate: {int(negate)}",
        "occupied_thresh: 0.65",
        "free_thresh: 0.196",
    ]
    write_bytes(buffer.getvalue(), picture)
    write_bytes(("\n".join(lines) + "\n").encode(), path)


def _read_header(path: Path) -> _Header:
    """Read and check the YAML file, with all its faults at once."""
    data = _read_yaml(path)
    faults: list[Fault] = []

    def fault(place: str, expected: str, found: object) -> None:
        text = repr(found)
        faults.append(Fault(str(path), place, f"expected {expected}, found {text[:60]}"))

    def number(place: str, value: object, low: float, high: float, expected: str) -> float:
        result = _as_number(value)
        if result is None or not low <= result <= high:
            fault(place, expected, value)
            return low
        return result

    for key in ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh"):
        if key not in data:
            faults.append(Fault(str(path), key, "missing"))
    image = data.get("image", "x")
    if not isinstance(image, str) or not image or "\0" in image:
        fault("image", "the path of an image", image)
        image = "x"
    smallest = 1e-6  # a micrometre; also keeps zero and negative numbers out
    resolution = number("resolution", data.get("resolution", 1), smallest, 1e6, "metres per pixel, a positive number")
    origin = data.get("origin", [0, 0, 0])
    if not isinstance(origin, list) or len(origin) != 3:
        fault("origin", "[x, y, yaw], three numbers", origin)
        origin = [0, 0, 0]
    pose = [number(f"origin[{n}]", v, -1e9, 1e9, "a finite number") for n, v in enumerate(origin)]
    negate = data.get("negate", 0)
    if _as_number(negate) not in (0, 1) and not isinstance(negate, bool):
        fault("negate", "0 or 1", negate)
    thresholds = {
        key: number(key, data.get(key, default), 0, 1, "a number from 0 to 1")
        for key, default in (("occupied_thresh", 1), ("free_thresh", 0))
    }
    if thresholds["free_thresh"] > thresholds["occupied_thresh"] and not any(
        fault.place in thresholds for fault in faults
    ):
        fault("free_thresh", f"at most occupied_thresh ({data['occupied_thresh']})", data["free_thresh"])
    mode = data.get("mode", "trinary")
    if mode not in _MODES:
        fault("mode", "trinary, scale or raw", mode)
    if faults:
        raise InputError(faults)
    return _Header(
        path.parent / image,
        resolution,
        (pose[0], pose[1], pose[2]),
        bool(_as_number(negate)) if not isinstance(negate, bool) else negate,
        thresholds["occupied_thresh"],
        thresholds["free_thresh"],
        mode,
    )


def _read_yaml(path: Path) -> dict[Any, Any]:
    """Return the YAML file's mapping."""
    try:
        with path.open("rb") as stream:
            raw = stream.read(_MAX_YAML_BYTES + 1)
        if len(raw) > _MAX_YAML_BYTES:
            raise InputError.single(str(path), "", "expected a map's YAML, found more than a megabyte")
        data = yaml.safe_load(raw.decode("utf-8"))
    except OSError as error:
        raise InputError.single(str(path), "", f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError.single(str(path), "", "expected YAML in UTF-8, found other bytes") from error
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        mark = getattr(error, "problem_mark", None)
        place = f"line {mark.line + 1}" if mark is not None else ""
        what = getattr(error, "problem", None) or "cannot be parsed"
        raise InputError.single(str(path), place, f"expected YAML: {what}") from error
    if not isinstance(data, dict):
        raise InputError.single(str(path), "", "expected the keys of a map (image, resolution, ...)")
    return data


def _as_number(value: object) -> float | None:
    """Return a finite number, also of a text like ``5e-2`` (a number to ROS, a text to PyYAML), else None."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        number = float(value)
    except (ValueError, OverflowError):
        return None
    return number if isfinite(number) else None


def _read_image(path: Path) -> tuple[NDArray[np.integer[Any]], int, NDArray[np.bool_] | None]:
    """Return ``(rows, cols)`` shades from the top down, the shade of white, and which pixels are opaque."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow's notes on odd metadata; the size is bounded below
            with Image.open(path, formats=_FORMATS) as image:
                if image.width * image.height > MAX_PIXELS:
                    size = f"{image.width} x {image.height}"
                    message = f"expected at most {MAX_PIXELS} pixels, found {size}"
                    raise InputError.single(str(path), "", message)
                image.load()
                return _shades(image, path)
    except UnidentifiedImageError as error:
        raise InputError.single(str(path), "", "expected an image (PGM, PNG, ...), found something else") from error
    except Image.DecompressionBombError as error:
        message = f"expected at most {MAX_PIXELS} pixels, found many more"
        raise InputError.single(str(path), "", message) from error
    except OSError as error:
        reason = error.strerror or str(error) or "unreadable"
        raise InputError.single(str(path), "", f"the image cannot be read: {reason}") from error
    except (ValueError, SyntaxError, EOFError) as error:  # what Pillow raises on broken headers and data
        raise InputError.single(str(path), "", f"the image is broken: {error}") from error


def _shades(image: Image.Image, path: Path) -> tuple[NDArray[np.integer[Any]], int, NDArray[np.bool_] | None]:
    """Return shades, white and opacity of a loaded image of any mode (see :func:`_read_image`)."""
    transparent = image.info.get("transparency")
    if image.mode == "F":
        raise InputError.single(str(path), "", "expected shades as whole numbers, found floating point")
    if image.mode.startswith("I"):  # 16 bits; Pillow widens a PGM of another maxval to 0..65535
        deep = np.asarray(image).astype(np.int64)
        if int(deep.min()) < 0 or int(deep.max()) > 65535:
            raise InputError.single(str(path), "", "expected shades of at most 16 bits")
        return deep, 65535, None if transparent is None else deep != transparent
    if image.mode in ("1", "L", "LA") or (image.mode == "La"):
        wanted = "LA" if image.mode in ("LA", "La") or transparent is not None else "L"
    else:
        wanted = "RGBA" if image.mode in ("RGBA", "RGBa", "PA") or transparent is not None else "RGB"
    pixels = np.asarray(image.convert(wanted))
    if wanted == "L":
        return pixels, 255, None
    opaque = None if wanted == "RGB" else pixels[..., -1] == 255
    if wanted == "LA":
        return pixels[..., 0], 255, opaque
    return pixels[..., :3].sum(axis=-1, dtype=np.uint16), 765, opaque
