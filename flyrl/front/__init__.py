"""The front door: what most users of flyrl call, as `flyrl.walk`, `flyrl.train` and the like."""
