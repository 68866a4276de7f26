"""The robot's motion told by its scans."""
