"""How fast flyrl is beside other simulators of the fly; flyrl itself is measured by flyrl.bench."""
