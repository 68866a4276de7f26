"""Steps to a Rerun recording. This is the only package that imports rerun, and it is only imported for a recording.

World entities are in metres under `/world`, whose transform turns y up; `/model` is the plane of (alpha, r).
"""

from .timeline import Timeline

__all__ = ["Timeline"]
