"""Where steering matters: how far the best law is from what planning on the simulation reaches."""
