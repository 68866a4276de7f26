"""Common formats that are not read: their names and how to convert them."""

from pathlib import Path

from ..drawing import WorldError

SVG = "export it as SVG or DXF"
STOREY = "export a plan of one storey as SVG or DXF"
CLOUD = "cut it at the scanner's height and save that as a picture"
GEO = "save it as GeoJSON (ogr2ogr -f GeoJSON plan.geojson FILE)"
LOG = "it is a log, which `chainslam replay` reads"
FORMATS: dict[str, tuple[str, str]] = {
    ".ifc": ("an IFC building model", "cut a plan of one storey out of it as SVG (IfcConvert FILE plan.svg)"),
    ".pdf": ("a PDF document", "save its page as SVG (inkscape FILE --export-filename=plan.svg, or pdftocairo -svg)"),
    ".dwg": ("an AutoCAD DWG drawing", "save it as DXF (dwg2dxf FILE of LibreDWG, or Save As)"),
    ".sdf": ("a Gazebo world (SDF)", "draw its walls as SVG, or drive in Gazebo itself (docs/howto/simulators.md)"),
    ".wbt": ("a Webots world", "draw its walls as SVG, or drive in Webots itself (docs/howto/simulators.md)"),
    **dict.fromkeys((".urdf", ".xacro"), ("a robot description (URDF)", "it holds no building: draw the walls as SVG")),
    **dict.fromkeys((".rvt", ".rfa", ".pln", ".skp", ".3dm", ".fcstd"), ("a building model", STOREY)),
    **dict.fromkeys((".ai", ".eps", ".ps", ".cdr", ".vsdx", ".vsd", ".drawio", ".fig", ".odg"), ("a drawing", SVG)),
    **dict.fromkeys((".psd", ".xcf", ".kra", ".heic", ".avif", ".jp2"), ("a picture", "save it as PNG")),
    **dict.fromkeys((".obj", ".stl", ".dae", ".gltf", ".glb", ".fbx", ".blend", ".step", ".stp"), ("a model", STOREY)),
    **dict.fromkeys((".pcd", ".ply", ".las", ".laz", ".e57", ".xyz", ".bt", ".ot"), ("points in space", CLOUD)),
    **dict.fromkeys((".osm", ".kml", ".kmz", ".gpkg", ".shp", ".gml", ".gpx", ".topojson"), ("a map", GEO)),
    **dict.fromkeys((".bag", ".db3", ".mcap", ".log", ".clf", ".npz"), ("a log", LOG)),
    **dict.fromkeys((".pbstream", ".posegraph"), ("a SLAM state", "save its map (nav2's map_saver_cli)")),
    **dict.fromkeys((".zip", ".tar", ".gz", ".7z"), ("an archive", "unpack it, and name a file in it")),
    **dict.fromkeys((".inc", ".cfg"), ("a part of a Stage world", "name the bitmap in it, with --scale METRES")),
    ".xml": ("an XML file", "rename it to .svg if it is an SVG drawing"),
}  # fmt: skip
"""By the file name's extension: what it is, and what to do."""
STAGE = (
    "a Stage world",
    "name its bitmap, with --scale METRES a pixel: the size of its floorplan over the picture's width in pixels",
)
IRSIM = (
    "an IR-SIM world",
    "drive in IR-SIM itself (examples/irsim_robot.py, docs/howto/simulators.md), or draw its walls as SVG",
)


def check_foreign(path: Path) -> None:
    """Raise WorldError, with its name and how to convert it, for a known format that is not read."""
    suffix = path.suffix.lower()
    told = FORMATS.get(suffix)
    if suffix == ".world":
        told = FORMATS[".sdf"] if _begins_as_xml(path) else STAGE
    if told is not None:
        raise WorldError(f"expected a drawing of a building, found {told[0]} ({suffix}): {told[1]}")


def check_yaml(data: bytes) -> None:
    """Raise WorldError for a YAML file that describes a world of a simulator instead of a map."""
    keys = {line.split(b":")[0].strip() for line in data.splitlines() if line[:1].isalpha() and b":" in line}
    if b"image" not in keys and b"world" in keys and keys & {b"robot", b"obstacle"}:
        raise WorldError(f"expected a ROS map YAML with image: and resolution:, found {IRSIM[0]}: {IRSIM[1]}")


def _begins_as_xml(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(200).lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<")
    except OSError:
        return False
