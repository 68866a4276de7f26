"""The format numbers of the files that are read back: a file's keys and their order change only with its number.

A recorded log (`log.npz`, `log.arrow`) has its own, in `sim.logs.recorded_robot`.
"""

FORMAT = 1
"""Of `summary.json`, `map.npz`, `map.geojson`, the records of a campaign, `comparison.json` and `contrast.json`."""
CONFIG_FORMAT = 2
"""Of `config.json`, of a run or of a campaign. 1 had no `settings` in a campaign, and what `settings.RENAMED` lists."""
