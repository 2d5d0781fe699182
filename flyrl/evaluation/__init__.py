"""Entrants × terrains -> paired results: metrics, statistics, results files."""
