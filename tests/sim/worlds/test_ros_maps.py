"""ROS maps and pictures: what is transparent, quoted, moved, turned, blurred or negated."""

import numpy as np
import pytest
from PIL import Image

from chainslam.sim.worlds import DrawingOptions, World, WorldError, load

HEADER = "image: m.png\nresolution: {}\norigin: {}\nnegate: {}\noccupied_thresh: {}\nfree_thresh: {}\nmode: {}\n"


def _grey(wall=0, free=254, unknown=205):
    """Return a room of 8 x 6 m at 0.05 m, whose right third nobody has seen."""
    image = np.full((160, 200), unknown, dtype=np.uint8)
    image[20:140, 20:180] = free
    for rows, columns in (
        ((20, 22), (20, 180)),
        ((138, 140), (20, 180)),
        ((20, 140), (20, 22)),
        ((20, 140), (178, 180)),
    ):
        image[slice(*rows), slice(*columns)] = wall
    image[20:140, 120:180] = unknown
    return image


def _yaml(tmp_path, resolution="0.05", origin="[0, 0, 0]", negate="0", occupied="0.65", free="0.196", mode="trinary"):
    (tmp_path / "m.yaml").write_text(HEADER.format(resolution, origin, negate, occupied, free, mode))
    return load(tmp_path / "m.yaml")


def _truth(tmp_path) -> World:
    Image.fromarray(_grey()).save(tmp_path / "m.png")
    return _yaml(tmp_path)


def _clear(mode, wall=0, free=254):
    """Return the same map with what is unknown left out, as `map_saver --mode scale --fmt png` writes it."""
    grey = _grey(wall, free, unknown=0)
    seen = np.where(_grey(unknown=205) == 205, 0, 255).astype(np.uint8)
    if mode == "P":
        return Image.fromarray(np.where(seen, np.where(grey > 100, 1, 2), 0).astype(np.uint8), "P")
    return Image.merge("LA", (Image.fromarray(grey), Image.fromarray(seen))).convert(mode)


@pytest.mark.parametrize("pixels", ["LA", "RGBA", "P"])
@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
def test_what_is_transparent_is_unknown(tmp_path, pixels, mode):
    truth = _truth(tmp_path)
    image = _clear(pixels, *((100, 0) if mode == "raw" else ()))
    if pixels == "P":
        shade = [0, 0, 0, *((0, 0, 0) if mode == "raw" else (254,) * 3), *((100,) * 3 if mode == "raw" else (0, 0, 0))]
        image = _clear("P")
        image.putpalette(shade)
        image.save(tmp_path / "m.png", transparency=0)
    else:
        image.save(tmp_path / "m.png")
    assert _yaml(tmp_path, mode=mode).free.equals(truth.free)
    if mode != "raw":
        alone = load(tmp_path / "m.png", options=DrawingOptions(scale=0.05))
        assert alone.free.area == pytest.approx(truth.free.area, rel=0.01)
        assert any("transparent" in note for note in alone.reading.notes)


@pytest.mark.parametrize("quote", ['"', "'", ""])
@pytest.mark.parametrize("gap", [" ", "\t", "  \t "])
def test_values_are_read_as_yaml_cpp_reads_them(tmp_path, quote, gap):
    truth, q = _truth(tmp_path), quote
    text = (
        f"image:{gap}{q}m.png{q}\nresolution:{gap}{q}0.05{q}\norigin:{gap}[{q}0{q}, {q}0.{q}, {q}+0e0{q}]\n"
        f"negate:{gap}{q}0{q}\noccupied_thresh:{gap}{q}.65{q}\nfree_thresh:{gap}{q}0.196{q}\nmode:{gap}{q}trinary{q}\n"
    )
    (tmp_path / "m.yaml").write_text(text)
    assert load(tmp_path / "m.yaml").free.equals(truth.free)


@pytest.mark.parametrize("key", ["image", "resolution", "origin", "negate", "mode", "other"])
def test_a_key_twice_is_refused(tmp_path, key):
    _truth(tmp_path)
    text = HEADER.format(0.05, "[0, 0, 0]", 0, 0.65, 0.196, "trinary")
    (tmp_path / "m.yaml").write_text(f"{text}other: 1\n{key}: 1\n")
    with pytest.raises(WorldError, match=f"once in the YAML file, found '{key}' twice"):
        load(tmp_path / "m.yaml")


@pytest.mark.parametrize("name", ["/home/a/maps/m.png", "maps/m.png", "../m.png", "C:\\\\maps\\\\m.png", "./m.png"])
def test_an_image_that_moved_is_found_beside_the_yaml_and_told(tmp_path, name):
    truth = _truth(tmp_path)
    (tmp_path / "m.yaml").write_text(f'image: "{name}"\nresolution: 0.05\n')
    world = load(tmp_path / "m.yaml")
    assert world.free.equals(truth.free)
    assert any("m.png beside the YAML" in note for note in world.reading.notes) == (name != "./m.png")


@pytest.mark.parametrize("yaw", ["nan", "-nan", ".nan", "-NaN", '"nan"'])
def test_a_yaw_that_is_no_number_is_zero_with_a_word_and_a_place_is_not(tmp_path, yaw):
    truth = _truth(tmp_path)
    world = _yaml(tmp_path, origin=f"[0, 0, {yaw}]")
    assert world.free.equals(truth.free)
    assert any("yaw" in note for note in world.reading.notes)
    with pytest.raises(WorldError, match="origin"):
        _yaml(tmp_path, origin=f"[0, {yaw}, 0]")


def test_the_yaml_beside_a_picture_is_read_with_it_unless_something_else_is_said(tmp_path):
    truth = _truth(tmp_path)
    _yaml(tmp_path, resolution="0.02", origin="[1, 2, 0]")
    world = load(tmp_path / "m.png")
    assert world.free.area == pytest.approx(truth.free.area * 0.4**2, rel=1e-6)
    assert "m.yaml says" in world.reading.scale
    assert load(tmp_path / "m.png", options=DrawingOptions(scale=0.05)).free.area == pytest.approx(truth.free.area)
    (tmp_path / "m.yaml").write_text("image: other.png\nresolution: 0.02\n")
    assert load(tmp_path / "m.png").free.area == pytest.approx(truth.free.area, rel=1e-6)


@pytest.mark.parametrize("turn", range(2, 9))
@pytest.mark.parametrize("suffix", ["jpg", "png", "tif", "webp"])
def test_a_picture_is_turned_as_a_viewer_turns_it(tmp_path, turn, suffix):
    image = Image.fromarray(_grey(unknown=255))
    exif = Image.Exif()
    exif[0x0112] = turn
    image.save(tmp_path / f"m.{suffix}", exif=exif, **({"lossless": True} if suffix == "webp" else {}))
    bounds = load(tmp_path / f"m.{suffix}").free.bounds
    wide, high = bounds[2] - bounds[0], bounds[3] - bounds[1]
    assert (wide < high) == (turn in (5, 6, 7, 8))


def test_jpeg_is_told_to_blur(tmp_path):
    Image.fromarray(_grey()).save(tmp_path / "m.jpg", quality=60)
    (tmp_path / "m.yaml").write_text("image: m.jpg\nresolution: 0.05\n")
    for name in ("m.yaml", "m.jpg"):
        assert any("JPEG" in note for note in load(tmp_path / name).reading.notes)


def test_a_picture_may_be_negative_and_its_threshold_another(tmp_path):
    grey = _grey(wall=90, free=200, unknown=200)
    grey[60:80, 60:80] = 150
    Image.fromarray(grey).save(tmp_path / "a.png")
    Image.fromarray(255 - grey).save(tmp_path / "b.png")
    plain = load(tmp_path / "a.png")
    assert load(tmp_path / "b.png", options=DrawingOptions(negate=True, threshold=160 / 255)).free.equals(plain.free)
    without = load(tmp_path / "a.png", options=DrawingOptions(threshold=0.5))
    assert without.free.area == pytest.approx(plain.free.area + 1.0, abs=1e-6)
