"""Walking statistics of flyrl beside those of flygym-gymnasium."""
