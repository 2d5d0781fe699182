"""A panel that is drawn nowhere."""


def drawn(played, what, title=None):
    """Arguments of each control or reading of a kind, in a section or in all."""
    panel = Noted(played)
    return [
        call for section, kind, call in panel.calls if kind == what and title in (None, section)
    ]


class Noted:
    """Keeps what is drawn: titles, and (section, what, arguments)."""

    def __init__(self, played):
        self.calls, self.titles = [], [""]
        played.draw(self)

    def section(self, title, is_open=True):
        self.titles.append(title)
        return True

    def __getattr__(self, what):
        return lambda *arguments: self.calls.append((self.titles[-1], what, [*arguments]))
