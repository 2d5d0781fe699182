"""Policy and environment -> episode records."""
