"""How fast flyrl is on this machine, part by part."""
