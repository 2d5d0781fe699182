"""Every entrant on every terrain -> paired results: metrics, statistics, results files."""
