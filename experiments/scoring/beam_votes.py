"""The true wall of a segment, by the vote of its beams."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

ONE_FACE_SHARE = 0.8
"""A segment is of one wall if at least this share of its beams came from it."""
UNLABELLED = -1


@dataclass(frozen=True)
class BeamVote:
    """The votes of a segment's beams."""

    faces: Int[np.ndarray, " b"]
    """The true face of each beam that met one."""
    beams: int
    """How many beams there are, those that met nothing among them."""
    winner: int
    """The wall of most beams; `UNLABELLED` where no beam met one."""
    on_winner: int
    """How many beams came from it."""
    face: int
    """The face of that wall with most beams; `UNLABELLED` where no beam met one."""

    @property
    def is_clear(self) -> bool:
        """Whether enough beams came from one wall."""
        return self.on_winner > 0 and self.on_winner >= ONE_FACE_SHARE * self.beams

    @property
    def wall(self) -> int:
        """The wall if it is clear, else `UNLABELLED`."""
        return self.winner if self.is_clear else UNLABELLED


def vote(
    first_and_last: Sequence[int], face_of_beam: Int[np.ndarray, " k"], walls_of_faces: Int[np.ndarray, " f"]
) -> BeamVote:
    """Count the beams of a segment from its first to its last, past the last beam of the scan to the first."""
    first, last = first_and_last
    count = len(face_of_beam)
    span = np.arange(first, last + 1 + (count if last < first else 0)) % count
    faces = face_of_beam[span]
    faces = faces[faces >= 0]
    if not len(faces):
        return BeamVote(faces, len(span), UNLABELLED, 0, UNLABELLED)
    walls = walls_of_faces[faces]
    votes = np.bincount(walls)
    winner = int(votes.argmax())
    face = int(np.bincount(faces[walls == winner]).argmax())
    return BeamVote(faces, len(span), winner, int(votes[winner]), face)
