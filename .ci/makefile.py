"""What the Makefile's own comments say: `make help`, and the refusal of variables that a target would ignore.

python .ci/makefile.py                        print the help
python .ci/makefile.py "TARGETS" "VARIABLES"  print one sentence where a variable is refused, else nothing
"""

from __future__ import annotations

import difflib
import re
import sys
from pathlib import Path

MAKEFILE = Path(__file__).parents[1] / "Makefile"
EVERYWHERE = ("PYTHON", "VENV", "SHELL", "MAKEFLAGS")
"""Variables that every target uses."""


def targets(makefile: str) -> dict[str, tuple[str, list[str]]]:
    """Description and variables of each target."""
    found = re.findall(r"^([a-z]+):.*?## ([^\[\n]*?)(?: \[(.*)\])?$", makefile, re.MULTILINE)
    return {name: (description, variables.split()) for name, description, variables in found}


def variables(makefile: str) -> dict[str, str]:
    """Description of each variable."""
    return dict(re.findall(r"^([A-Z]+) +\?= +## (.*)$", makefile, re.MULTILINE))


def help_text(makefile: str) -> str:
    """Targets with their variables, and the variables."""
    lines = ["make TARGET [VARIABLE=value ...]", "", "Targets:"]
    for name, (description, used) in targets(makefile).items():
        lines += [f"  {name:<11}{description}", *([f"{'':13}{' '.join(used)}"] if used else [])]
    lines += ["", "Variables; one that is not given leaves the value of the configuration:"]
    lines += [f"  {name:<11}{description}" for name, description in variables(makefile).items()]
    return "\n".join(lines)


def refusal(makefile: str, goals: list[str], given: list[str]) -> str:
    """One sentence on the first variable that is unknown, or that none of the goals uses; empty where all are used."""
    documented, known = targets(makefile), list(variables(makefile))
    used = {name for goal in goals for name in documented.get(goal, ("", known))[1]}
    for name in given:
        if name in used or name in EVERYWHERE:
            continue
        if name in known:
            takers = [target for target, (_, names) in documented.items() if name in names]
            return f"make {' '.join(goals)} does not use {name}; these do: {', '.join(takers)}"
        nearest = difflib.get_close_matches(name.upper(), [*known, *EVERYWHERE], n=1)
        remedy = f"did you mean {nearest[0]}" if nearest else f"known are {', '.join(known)}"
        return f"there is no variable {name}; {remedy}"
    return ""


if __name__ == "__main__":
    text = MAKEFILE.read_text(encoding="utf-8")
    print(refusal(text, *(words.split() for words in sys.argv[1:])) if sys.argv[1:] else help_text(text))
