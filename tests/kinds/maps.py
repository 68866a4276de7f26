"""ROS maps and pictures as they come: transparent, quoted, moved, turned."""

import io
from pathlib import Path

import numpy as np
from PIL import Image

from chainslam.sim.worlds import DrawingOptions, load

from .case import Case, Rng, pick
from .plan import drawn, plan

PIXEL_M = 0.05
TURNS = {3: 2, 6: 1, 8: 3}
"""By the number of EXIF's orientation, quarter turns."""


def floor(rng: Rng) -> tuple[np.ndarray, float]:
    """Return pixels: 0 wall, 1 free, 2 unknown, and the free area, m2."""
    of = plan(rng)
    rows, columns = round(of.h / PIXEL_M), round(of.w / PIXEL_M)
    cells = np.full((rows + 20, columns + 20), 2, dtype=np.uint8)
    inner = cells[10 : 10 + rows, 10 : 10 + columns]
    inner[:] = 0
    inner[2:-2, 2:-2] = 1
    x, low, high = (round(value / PIXEL_M) for value in (of.x, of.low, of.high))
    inner[:, x : x + 2] = 0
    inner[low:high, x : x + 2] = 1
    return cells, float(np.count_nonzero(cells == 1)) * PIXEL_M**2


def png(image: Image.Image, **more: object) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, "PNG", **more)
    return buffer.getvalue()


def grey(cells: np.ndarray) -> Image.Image:
    """Return the picture that map_saver writes."""
    return Image.fromarray(np.array([0, 254, 205], dtype=np.uint8)[cells])


def yaml_scalars(rng: Rng, folder: Path) -> Case:
    """Values as yaml-cpp reads them: in quotes, after several blanks; an image that moved; a key twice is refused."""
    cells, area = floor(rng)
    (folder / "m.png").write_bytes(png(grey(cells)))
    quote, gap = pick(rng, ("", "'", '"')), pick(rng, (" ", "   ", " \t"))
    image = pick(rng, ("m.png", "/home/alice/maps/m.png", "../elsewhere/m.png", "C:\\\\maps\\\\m.png"))
    rows = {
        "image": image if "\\" not in image else f"'{image}'",
        "resolution": f"{quote}{PIXEL_M}{quote}",
        "origin": pick(rng, ("[0, 0, 0]", "[-1.5, 2, -nan]", f"[{quote}0.0{quote}, 0, 0.0]")),
        "negate": pick(rng, ("0", f"{quote}0{quote}")),
        "occupied_thresh": f"{quote}0.65{quote}",
        "free_thresh": f"{quote}0.196{quote}",
    }
    lines = [f"{key}:{gap}{value}" for key, value in rows.items()]
    rng.shuffle(lines)
    twice = rng.random() < 0.2
    if twice:
        lines.append(pick(rng, lines))
    content = ("\n".join(lines) + "\n").encode()
    return drawn(folder / "m.yaml", content, area, "expected each key once" if twice else "")


def transparent(rng: Rng, folder: Path) -> Case:
    """What is transparent is unknown, in every mode of pixels and of the map."""
    cells, area = floor(rng)
    shades = np.array([0, 254, int(pick(rng, (0, 254, 128)))], dtype=np.uint8)[cells]
    seen = np.where(cells == 2, 0, 255).astype(np.uint8)
    image = Image.merge("LA", (Image.fromarray(shades), Image.fromarray(seen))).convert(pick(rng, ("LA", "RGBA")))
    (folder / "m.png").write_bytes(png(image))
    mode = pick(rng, ("trinary", "scale"))
    head = f"image: m.png\nresolution: {PIXEL_M}\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\n"
    return drawn(folder / "m.yaml", f"{head}free_thresh: 0.196\nmode: {mode}\n".encode(), area)


def pictures(rng: Rng, folder: Path) -> Case:
    """Bare pictures: turned by EXIF, negative, of a stated scale or with the YAML beside."""
    cells, area = floor(rng)
    image, said = grey(cells), {"scale": PIXEL_M}
    more: dict[str, object] = {}
    turn = 0
    match int(rng.integers(3)):
        case 0:
            exif = Image.Exif()
            number = pick(rng, sorted(TURNS))
            exif[0x0112], turn = number, TURNS[number]
            more = {"exif": exif}
        case 1:
            image, said = Image.fromarray(255 - np.asarray(image)), {"scale": PIXEL_M, "negate": True}
        case _:
            said = {}
            text = f"image: m.png\nresolution: {PIXEL_M}\norigin: [0, 0, 0]\nnegate: 0\n"
            (folder / "m.yaml").write_text(f"{text}occupied_thresh: 0.65\nfree_thresh: 0.196\n")
    case = drawn(folder / "m.png", png(image, **more), area, **said)
    size = image.size[::-1] if turn % 2 else image.size

    def check(world: object) -> str:
        x0, y0, x1, y1 = world.free.bounds  # type: ignore[attr-defined]
        wide = (x1 - x0 > y1 - y0) == (size[0] > size[1])
        return case.check(world) or ("" if wide or abs((x1 - x0) - (y1 - y0)) < 0.2 else "not turned")

    return Case(lambda: load(folder / "m.png", options=DrawingOptions(**said)), check)
