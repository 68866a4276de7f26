"""The picture of the rooms shows what is there."""

from pathlib import Path

from studies.code.architecture import PLACES, draw, imports, rooms

ROOT = Path(__file__).parents[2]


def parts_of(folder):
    """What a package holds, by the names that an import uses."""
    entries = [path for path in folder.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()]
    return {path.stem for path in entries} - {"__init__"}


def test_every_part_of_a_room_has_its_place_in_one_layer():
    for room in rooms(ROOT):
        told = [part for row in room.layers for part in row]
        assert sorted(told) == sorted(parts_of(ROOT / room.name)), room.name


def test_arrows_lead_down_and_are_in_the_picture_or_told_below_it():
    found, arrows = rooms(ROOT), imports(list(PLACES))
    assert ("experiments", "sim") in arrows
    assert ("slam", "explore") not in arrows
    assert ("explore", "sim") not in arrows
    words = " ".join(text.get_text() for text in draw(found, arrows).axes[0].texts)
    for (importer, imported), count in arrows.items():
        assert f"{importer} → {imported}: {count}" in words or f" {count} " in f" {words} "
