"""SVG as a viewer shows it: document, cascade, what is rendered, and what lies on top of what."""
