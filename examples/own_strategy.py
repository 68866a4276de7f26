"""A strategy of one's own: always the open end that is farthest to drive to."""

import numpy as np

import chainslam


class Farthest:
    """Chooses among the open ends to which a way is known."""

    def choose(self, situation: chainslam.Situation) -> chainslam.Choice | None:
        """Return the open end that is farthest away; None where there is none that can be reached."""
        metres = np.where(np.isfinite(situation.end_metres), situation.end_metres, -1.0)
        if not len(metres) or metres.max() < 0.0:
            return None
        best = int(np.argmax(metres))
        return chainslam.Choice(situation.open_ends[best], f"the farthest of {len(metres)}, {metres[best]:.1f} m away")


chainslam.STRATEGIES["farthest"] = chainslam.StrategyEntry(Farthest, "the open end that is farthest to drive to")

if __name__ == "__main__":
    for strategy in ("nearest-robot", "farthest"):
        run = chainslam.explore("paper-fig4", strategy=strategy, errorless=True)
        print(f"{strategy}: {run.summary['status']} after {run.summary['path_length_m']:.1f} m")
