"""Scenes on the native batch: the engine, with the leg controllers running inside it."""
