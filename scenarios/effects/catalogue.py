"""Writes the page of all effects from their classes.

python -m scenarios.effects.catalogue      # writes docs/reference/effects.md
"""

from __future__ import annotations

import argparse
from inspect import getdoc
from pathlib import Path

from scenarios.effects import EFFECTS, FORMS
from scenarios.effects.base import Effect, Parameter, Value
from trpac_core.vehicle import Vehicle

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "effects.md"

CAR = Vehicle()
"""The car for values that depend on the vehicle."""

STAGES = {
    "actuators": "command to torque at the wheels",
    "dynamics": "torque to motion",
    "road": "friction under the left and the right wheels",
    "sensors": "motion to signals",
    "perception": "pictures to classes",
}

HEAD = """# Effects

<!-- Made by `python -m scenarios.effects.catalogue` from scenarios/effects/; change it there. -->

What the reference plant can model beyond its nominal equations ([plant.md](plant.md)), and what a diagnosis may name.
`effects:` in vehicle.yaml switches them on by id, with all their parameters; values outside the bounds are refused.
They act in the order of this page, whatever their order in the file. Values marked * depend on the vehicle; shown are
those of the paper's car (Table 3).
"""


def page() -> str:
    """The page as Markdown text."""
    parts = [HEAD, "| id | stage | subsystem | parameters |\n|---|---|---|---|"]
    parts[-1] += "".join(f"\n{_table_row(effect)}" for effect in EFFECTS.values())
    for stage, meaning in STAGES.items():
        parts.append(f"## {stage.capitalize()}: {meaning}")
        parts += [_section(effect) for effect in EFFECTS.values() if effect.stage == stage]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def _table_row(effect: type[Effect]) -> str:
    names = ", ".join(f"`{p.name}`" for p in effect.parameters())
    return f"| [`{effect.id}`](#{effect.id}) | {effect.stage} | {effect.subsystem} | {names} |"


def _section(effect: type[Effect]) -> str:
    rows = "\n".join(_row(p) for p in effect.parameters())
    return f"""### {effect.id}

{getdoc(effect)}

- Equation: `{effect.equation}`
- Source: {effect.source}
- Seen when: {effect.excited_by}
- Looks like: {", ".join(f"`{key}`" for key in effect.confounders)}{"".join(map(_form, FORMS[effect.id][1:]))}

| parameter | unit | meaning | neutral | bounds | a fit starts at |
|---|---|---|---|---|---|
{rows}"""


def _form(other: type[Effect]) -> str:
    further = other.parameters()[len(EFFECTS[other.id].parameters()) :]
    added = "".join(map(_further, further))
    said = f"{other.form}: `{other.equation}`. {getdoc(other)}{added}"
    return f"\n- Another form, which `forms` in vehicle.yaml switches on, is {said}"


def _further(p: Parameter) -> str:
    neutral, bounds, starts = _values(p)
    about = f"neutral {neutral}, bounds {bounds}, a fit starts at {starts}"
    return f" Further parameter `{p.name}` [{p.unit}]: {p.meaning}; {about}."


def _row(p: Parameter) -> str:
    return f"| `{p.name}` | {p.unit} | {p.meaning} | {' | '.join(_values(p))} |"


def _values(p: Parameter) -> tuple[str, str, str]:
    """Neutral value, bounds and starts."""
    low, high = p.bounds(CAR)
    starts = ", ".join(f"{value:.4g}" for value in p.start_values(CAR))
    starts += "*" if callable(p.starts) else ""
    neutral = _value(p.neutral, p.neutral_value(CAR))
    return neutral, f"{_value(p.low, low)} to {_value(p.high, high)}", starts


def _value(declared: Value, value: float) -> str:
    return f"{value:.4g}" + ("*" if callable(declared) else "")


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    PAGE.write_text(page(), encoding="utf-8")
    print(f"wrote {PAGE}")
