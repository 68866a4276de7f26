"""The stochastic map as a factor graph; the only importer of gtsam."""
