"""Robots by name: what each states of itself, and the devices that a simulated one has."""

from pathlib import Path

ROBOTS = {path.stem: path for path in sorted(Path(__file__).parent.glob("*.yaml"))}
"""Files of the bundled robots."""
