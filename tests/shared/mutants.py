"""Sentences with something changed: of each, what is true of its numbers has to be told apart."""

import re
from collections.abc import Callable, Iterable, Mapping

from trdlab.explanations.rules import UnsupportedSentenceError


def numbers(sentence: str) -> list[str]:
    """Returns the sentence with each of its numbers changed in its last digit, up and down."""
    result = []
    for match in re.finditer(r"\d+(?:\.\d+)?", sentence):
        text, decimals = match[0], len(match[0].partition(".")[2])
        for step in (1, -1):
            digits = int(text.replace(".", "")) + step
            if digits >= 0:
                other = f"{digits / 10**decimals:.{decimals}f}"
                result.append(sentence[: match.start()] + other + sentence[match.end() :])
    return result


def words(sentence: str, others: Mapping[str, str]) -> list[str]:
    """Returns the sentence with each of the words it has exchanged for the other, once."""
    changed = (
        # a whole word, or what begins or ends with a comma
        re.sub(rf"(?!\B\w){re.escape(old)}(?<!\w\B)", new, sentence, count=1)
        for old, new in others.items()
    )
    return [mutant for mutant in changed if mutant != sentence]


def exchanged(sentence: str, one: str, other: str) -> list[str]:
    """Returns the sentence with two names exchanged, if it has one of them."""
    swap = {one: other, other: one, _capital(one): other, _capital(other): one}
    pattern = rf"\b(?:{'|'.join(map(re.escape, swap))})\b"
    mutant = _capital(re.sub(pattern, lambda found: swap[found[0]], sentence))
    return [mutant] if mutant != sentence else []


def survivors(mutants: Iterable[str], check: Callable[[str], object]) -> list[str]:
    """Returns those that pass for true."""
    survived = []
    for mutant in mutants:
        try:
            check(mutant)
        except UnsupportedSentenceError:
            continue
        survived.append(mutant)
    return survived


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
