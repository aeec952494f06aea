"""Find phrases that the documentation avoids, in texts that users and contributors read.

    python scripts/plain_words.py          every hit with its remedy; exit code 1 where there is one
    python scripts/plain_words.py --count  hits by phrase

A phrase is a regular expression; `# plain-words: skip` on a line exempts it, such as a quotation.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
PLACES = (
    "README.md", "CHANGELOG.md", "CONTRIBUTING.md", "docs/**/*.md", "docs/**/*.ipynb",
    "configs/**/*.yaml", "vcam_cli/**/*.py", "vcam_cli/**/*.yaml", "scripts/*.py", ".github/**/*.*",
)  # fmt: skip
PHRASES = {
    r"\bwhat (?:\w+ )?is (?:not )?(?:simulated|called|told|left|printed|known|seen)\b": "name it",
    r"\bthat which\b|\bthose of which\b": "name it",
    r"\b(?:none|one|most|some|all|each|points?|parts?|lines?) of which\b": "start a new sentence",
    r"\bas far as\b": "where; if; up to",
    r"\bso many\b": "a number, or `count`",
    r"\b(?:is|are|was|were|be) told\b": "report; state; print",
    r"\bask(?:s|ed)? for\b": "request; need; require",
    r"\bgo(?:es)? by\b": "follow; use",
    r"\bstand(?:s)? for\b": "represent; replace",
    r"\bheed(?:s|ed)?\b": "consider; use",
    r"\bwonder(?:s|ed)?\b": "check",
    r"\bHow sure\b": "confidence interval",
    r"\boff the line\b": "nonlinearity residual",
    r"\btransfer of contrast\b": "MTF",
    r"\bsignal over noise\b": "SNR",
    r"\bin so many words\b": "explicitly",
    r"\bsays? so\b": "report; state",
    r"(?-i:\bis none\b)": "there is no ...; the name of the thing",
    r", of which\b": "start a new sentence",
    r"\bnine times in ten\b": "90 %",
    r"\bright camera files?\b": "correct camera file",
    r"\btaken? (?:to be|as 0)\b": "assumed to be; becomes 0",
    r"\bis said to\b|\bthere can be\b": "state it",
    r"\bwhat kind of\b": "kind of",
    r"\b(?:than|by|of) chance\b(?! of)(?! that)": "significant; random",
    r"\bfrom which on\b": "above which",
    r"\bnobody\b": "unknown; not given; not measured",
    r"\bthere is to (?:say|know|compare|see)\b": "name it",
    r"\bas people say\b": "in words",
    r"\bno name of\b|\bis there and no\b": "is not the name of; exists and is not",
    r"\bto and fro\b": "back and forth",
    r"\boff alike\b": "equal deviations",
    r"\bis seen\b(?= how)|\basks how\b": "depends on",
}
"""A phrase -> what to write in its place."""
SKIP = "plain-words: skip"


def files() -> Iterator[Path]:
    """Yield the files whose texts are read."""
    for place in PLACES:
        yield from (path for path in sorted(ROOT.glob(place)) if path.is_file())


def hits() -> Iterator[tuple[Path, int, str, str]]:
    """Yield file, line number, phrase found and remedy."""
    for path in files():
        if path == Path(__file__).resolve():
            continue
        text = path.read_text("utf-8")
        for pattern, remedy in PHRASES.items():
            for found in re.finditer(pattern, text, re.IGNORECASE):
                line = text[text.rfind("\n", 0, found.start()) + 1 :].partition("\n")[0]
                if SKIP not in line:
                    yield path, text.count("\n", 0, found.start()) + 1, found[0], remedy


def main() -> int:
    """Print hits and return 1 where there are any."""
    found = list(hits())
    if "--count" in sys.argv:
        for phrase, count in Counter(phrase.lower() for _, _, phrase, _ in found).most_common():
            print(f"{count:4} {phrase}")
    else:
        for path, number, phrase, remedy in found:
            print(f"{path.relative_to(ROOT)}:{number}: {phrase!r}; write: {remedy}")
    print(f"{len(found)} phrases to rewrite", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
