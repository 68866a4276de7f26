"""Steps to a Rerun recording; this package is the only importer of rerun, and is imported only when one is asked for.

World entities are in metres under `/world`, whose transform turns y up; `/model` is the plane of (alpha, r).
"""

from .timeline import Timeline

__all__ = ["Timeline"]
