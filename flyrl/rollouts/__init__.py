"""Policy × environment -> episode records."""
