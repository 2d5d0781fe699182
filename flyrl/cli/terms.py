"""The user's own terms: Python objects by name, imported because the user named them."""

from collections.abc import Sequence

from flyrl.entry_points import load_module
from flyrl.tasks import Term
from flyrl.tasks.extension import TERM_TYPES
from flyrl.validation import one_of


def load_terms(names: Sequence[str]) -> dict[str, Term]:
    """Import terms by name.

    Modules are looked for where Python looks, and after that in the current folder. Importing a
    module runs its code.

    Parameters
    ----------
    names
        `module:attribute` each.

    Returns
    -------
    The terms by these names, in this order.

    Raises
    ------
    ValueError
        A name that is given twice or is not of this form, a module or attribute that does not
        exist, a module that cannot be imported, or an attribute that is no term.
    """
    terms: dict[str, Term] = {}
    for i, name in enumerate(names):
        key = f"task.terms[{i}]"
        if name in terms:
            raise ValueError(f"{key} is {name!r}, which is there already")
        terms[name] = _load(name, key)
    return terms


def _load(name: str, key: str) -> Term:
    found = load_module(name, key, "my_terms:HEIGHT")
    attribute = name.partition(":")[2]
    terms = {known: term for known, term in found.items() if isinstance(term, TERM_TYPES)}
    if attribute in found and attribute not in terms:
        kinds = ", ".join(kind.__name__ for kind in TERM_TYPES)
        raise ValueError(
            f"{key}: {name} must be one of {kinds}, got a {type(found[attribute]).__name__}"
        )
    return terms[one_of(f"{key}, of the terms in {found['__file__']},", attribute, terms)]
