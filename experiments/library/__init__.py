"""What `import chainslam` offers: the commands as functions, and what they leave as objects."""
