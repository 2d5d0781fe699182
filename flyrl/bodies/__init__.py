"""The bodies, as MuJoCo model specifications."""
