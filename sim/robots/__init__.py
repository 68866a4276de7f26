"""Robots by name: their descriptions and simulated devices."""

from pathlib import Path

ROBOTS = {path.stem: path for path in sorted(Path(__file__).parent.glob("*.yaml"))}
"""Files of the bundled robots."""
