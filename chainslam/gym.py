"""Exploration as an environment of Gymnasium (docs/howto/policies.md): `import chainslam.gym` registers it."""

from chainslam.experiments.usage import need

need("gymnasium")

import gymnasium  # noqa: E402

from chainslam.experiments.library.environment import FREE, OCCUPIED, UNKNOWN, Exploration  # noqa: E402

__all__ = ["FREE", "OCCUPIED", "UNKNOWN", "Exploration"]

gymnasium.register("chainslam/Exploration-v0", f"{Exploration.__module__}:{Exploration.__name__}")
