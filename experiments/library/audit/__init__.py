"""May these covariances be believed? Trajectories of any SLAM system, against a truth, a reference or relations."""
