"""Reading a map's file, whatever its type, and distinguishing the two kinds of JSON."""

import json
from pathlib import Path
from typing import Any

from ..drawing import Drawing, WorldError, shorten
from ..options import AS_DRAWN, DrawingOptions
from .geojson.reader import from_geojson
from .plan_json import from_json

FILE_MAX = 64 * 2**20


def read_bytes(path: Path) -> bytes:
    """Return a file's bytes; raise WorldError if it is not a regular file of reasonable size."""
    try:
        if not path.is_file():
            found = "a directory" if path.is_dir() else "something else" if path.exists() else "no such file"
            raise WorldError(f"expected a map file, found {found} at {shorten(str(path))}: check the path")
        size = path.stat().st_size
        if not 0 < size <= FILE_MAX:
            raise WorldError(f"expected a map file of 1 byte to 64 MB, found {size} bytes: choose another file")
        return path.read_bytes()
    except OSError as error:
        raise WorldError(f"expected a readable file, found {shorten(str(error))}: check the path") from None


def read_json_map(data: bytes, options: DrawingOptions = AS_DRAWN) -> Drawing:
    """Return the drawing in a JSON file's bytes, told by its content: GeoJSON has a "type", a plan has "walls"."""
    document = _parse(data)
    if isinstance(document, dict) and "walls" in document:
        return from_json(document, options)
    if isinstance(document, dict) and isinstance(document.get("type"), str):
        return from_geojson(document, options)
    raise WorldError(
        f'expected a plan with "walls" or GeoJSON with a "type", found {shorten(document)}: see docs on world files'
    )


def _parse(data: bytes) -> Any:
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as error:
        raise WorldError(f"expected JSON, found {shorten(str(error))}: correct the file") from None
