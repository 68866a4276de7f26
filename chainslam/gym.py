"""Exploration as an environment of Gymnasium (docs/howto/policies.md): `import chainslam.gym` registers it."""

import gymnasium

from chainslam.experiments.library.environment import FREE, OCCUPIED, UNKNOWN, Exploration

__all__ = ["FREE", "OCCUPIED", "UNKNOWN", "Exploration"]

gymnasium.register("chainslam/Exploration-v0", f"{Exploration.__module__}:{Exploration.__name__}")
