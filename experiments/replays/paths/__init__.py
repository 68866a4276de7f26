"""What finds the path of a recorded drive without a back end: offline refinement, and external programs."""
