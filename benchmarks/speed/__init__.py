"""How fast flyrl is on this machine, part by part, and beside other simulators of the fly."""
