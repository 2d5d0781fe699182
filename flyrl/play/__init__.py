"""A live page in the browser: a simulation in real time that a person acts on.

A `Playable` (`fly`, `worm`), and its course in time (`session`), know nothing of the web; `page`
shows it with MuJoCo's web viewer, which it keeps to this computer.
"""
