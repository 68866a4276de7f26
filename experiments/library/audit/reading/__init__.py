"""Trajectories and graphs with the covariances that they state, as files of any system have them."""
