"""How large the range noise of each log is, by the scatter of its beams about their lines (docs/contributing/logs.md).

.venv/bin/python -m studies.logs.noise --logs DIR
"""

from dataclasses import dataclass
from pathlib import Path

from chainslam.sim.logs.recorded_log import read_recorded_log
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.extraction.extract import extract
from chainslam.slam.extraction.range_noise import range_noise

from ..runner.command import run_study


@dataclass(frozen=True)
class NoiseStudy:
    """Print what each log's own lines say of its range noise."""

    logs: Path
    """Folder with the logs."""
    names: tuple[str, ...] = ("intel", "aces", "seattle", "dpslam_loop5")
    """The logs."""
    every: int = 4
    """One of so many keyframes is looked at."""
    least_beams: int = 6
    """Segments of fewer beams are left out."""

    def run(self) -> None:
        """Print a line for each log."""
        for name in self.names:
            recording = read_recorded_log(self.logs / f"{name}.log.gz").recording
            rules = ExtractionConfig()
            seen = [extract(recording.scan(k), rules) for k in range(0, len(recording), self.every)]
            assumed_m = float(recording.sigma_m[0])
            found_m = range_noise(seen, assumed_m, self.least_beams)
            said = "no segment is long enough" if found_m is None else f"{1e3 * found_m:.1f} mm by its lines"
            print(f"{name}: {1e3 * assumed_m:.0f} mm assumed, {said}")


if __name__ == "__main__":
    run_study(NoiseStudy)
