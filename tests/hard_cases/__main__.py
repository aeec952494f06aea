"""The hard cases as a table, on one page: what errs by how much where floating point is hard.

    python -m tests.hard_cases [--why] [WORD...]

Columns: the case; where its reference comes from, worked out in 50 digits or more or exact by
itself; the largest error of vcam's form, and what it may be; the largest error of the form that
one would write first. Errors are relative, those marked abs absolute.

WORD picks the cases whose name or subject has it; --why tells what is hard, how the naive form is
written and why so much error is allowed. Exit code 1 where a case does not hold.
"""

from __future__ import annotations

import argparse
import textwrap

from .cases import CASES
from .hard_case import Case, Verdict, judge

WIDE = 118


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.hard_cases")
    parser.add_argument("words", nargs="*", metavar="WORD", help="some cases; default all")
    parser.add_argument("--why", action="store_true", help="tell what is hard, and why")
    options = parser.parse_args()
    held = [
        _section(subject, chosen, options.why)
        for subject, cases in CASES.items()
        if (chosen := [c for c in cases if _asked(f"{subject} {c.name}", options.words)])
    ]
    good, count = sum(g for g, _ in held), sum(n for _, n in held)
    print(f"\n{good} of {count} cases hold")
    return 0 if held and good == count else 1


def _asked(text: str, words: list[str]) -> bool:
    return not words or any(word.lower() in text.lower() for word in words)


def _section(subject: str, cases: list[Case], why: bool) -> tuple[int, int]:
    """Prints a subject's lines; (cases that hold, cases)."""
    print(f"\n{_line(subject.upper(), 'reference', 'ours', 'allowed    ', 'naive form', '')}")
    good = 0
    for case in cases:
        verdict = judge(case)
        good += verdict.holds
        print(_row(case, verdict), flush=True)
        if why:
            _explain(case)
    return good, len(cases)


def _row(case: Case, verdict: Verdict) -> str:
    said = "holds" if verdict.holds else "FAILS"
    ours, allowed = (f"{e:.1e}" if e else "0" for e in (verdict.ours, case.allowed))
    allowed += " abs" if case.absolute else "    "
    return _line(case.name, case.reference, ours, allowed, verdict.naive_said, said)


def _line(name: str, reference: str, ours: str, allowed: str, naive: str, verdict: str) -> str:
    return f"{name:<51}{reference:<29}{ours:>7}{allowed:>13}{naive:>13}  {verdict}".rstrip()


def _explain(case: Case) -> None:
    kind = "absolute" if case.absolute else "relative"
    for label, text in (
        ("hard", case.hard),
        ("naive", case.form),
        ("allowed", f"{kind} error; {case.why}"),
    ):
        print(textwrap.fill(text, WIDE, initial_indent=f"    {label + ':':<9}",
                            subsequent_indent=" " * 13))  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(main())
