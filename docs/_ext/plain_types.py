"""Types of the interface as a reader wants them: `float`, and not with the range that settings are checked against."""

from typing import get_type_hints

from sphinx.application import Sphinx

RANGED = ("LidarSpec", "RobotSpec", "ScannerSpec", "WheelSpec")
"""Classes of the interface whose fields are settings."""


def without_ranges(app: Sphinx) -> None:
    """Take the ranges out of what autodoc reads; the build needs them no more."""
    from chainslam.slam import robot

    for name in RANGED:
        kind = getattr(robot, name)
        for each in (kind, kind.__init__):
            hints = get_type_hints(each)
            each.__annotations__ = {field: hints[field] for field in each.__annotations__}


def setup(app: Sphinx) -> dict[str, bool]:
    """Tell Sphinx of it."""
    app.connect("builder-inited", without_ranges)
    return {"parallel_read_safe": True}
