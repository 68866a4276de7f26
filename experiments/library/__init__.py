"""The public functions and objects of `import chainslam`: the commands as functions, and their results."""
