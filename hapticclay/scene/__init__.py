"""How a scene is written: fields, units, files, text, experiments."""
