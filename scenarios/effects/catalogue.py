"""Writes the page of all effects from their classes.

python -m scenarios.effects.catalogue      # writes docs/reference/effects.md
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from inspect import getdoc
from pathlib import Path

from scenarios.effects import EFFECTS, FORMS
from scenarios.effects.base import SHARE_OF_MEAN, Effect, Parameter, Value
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

SHARES = {
    "unlike": "the front axle has (1 + unlike) times the mean, the rear axle (1 - unlike) times",
    "front_sides": "the front left wheel has this share of the mean more, the front right wheel less",
    "rear_sides": "the same of the rear wheels",
}
"""Parameters of a form that have one meaning in all effects; the head of the page describes them once."""

SHARES_LISTED = "\n".join(f"- `{name}`: {meaning}" for name, meaning in SHARES.items())

HEAD = f"""# Effects

<!-- Made by `python -m scenarios.effects.catalogue` from scenarios/effects/; change it there. -->

The deviations from its nominal equations that the [reference plant](../theory/plant.md) can simulate, and that a
[diagnosis](../guide/gap.md) can name. `effects:` in vehicle.yaml switches them on by id, with all their parameters:

```yaml
effects:
  torque_lag: {{time_constant_s: 0.08}}
  wheel_radius_offset: {{radius_m: 0.285, unlike: 0.004}}
forms: {{wheel_radius_offset: axles unlike}}
```

Values outside the bounds are refused. The effects act in the order of this page. *Excitation* is the driving in which
an effect shows; *confounders* are effects that look similar on many drives. Values marked * depend on the vehicle; they
are those of the car in Table 3 of Tian et al. (2022).

Some effects have several **forms**; `forms:` in vehicle.yaml selects one by name. Forms of axles and wheels have these
parameters (neutral 0):

{SHARES_LISTED}
"""


def page() -> str:
    """The page as Markdown text."""
    parts = [HEAD]
    for stage, meaning in STAGES.items():
        parts.append(f"## {stage.capitalize()}: {meaning}")
        parts += [_section(effect) for effect in EFFECTS.values() if effect.stage == stage]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def _section(effect: type[Effect]) -> str:
    rows = "\n".join(_row(p) for p in effect.parameters())
    return f"""### {effect.id}

{getdoc(effect)}

- Equation: `{effect.equation}`
- Excitation: {effect.excited_by}
- Confounders: {", ".join(f"`{key}`" for key in effect.confounders)}
{_source(effect)}
| parameter | unit | meaning | neutral | bounds | start values |
|---|---|---|---|---|---|
{rows}{"".join(map(_form, FORMS[effect.id][1:]))}"""


def _source(effect: type[Effect]) -> str:
    """A line with the source; empty where the equation is a definition."""
    return "" if effect.source == "definition" else f"- Source: {effect.source}\n"


def _form(other: type[Effect]) -> str:
    further = other.parameters()[len(EFFECTS[other.id].parameters()) :]
    begin = "\n\n" if other is FORMS[other.id][1] else "\n"
    return f"{begin}- Form `{other.form}`: `{other.equation}`. {getdoc(other)}{_further(further)}"


def _further(parameters: Sequence[Parameter]) -> str:
    """What a form has beside the parameters of the first one; those of the same ranges together."""
    said: dict[str, list[str]] = {}
    for p in parameters:
        neutral, bounds, starts = _values(p)
        shared = p.name in SHARES and p.meaning.startswith(SHARE_OF_MEAN)
        about = f"{bounds}, start values {starts}"
        if not shared:
            unit = "" if p.unit == "-" else f" [{p.unit}]"
            about = f"{p.meaning}{unit}; neutral {neutral}, bounds {about}"
        said.setdefault(about, []).append(f"`{p.name}`")
    return "".join(f" {', '.join(names)}: {about}." for about, names in said.items())


def _row(p: Parameter) -> str:
    return f"| `{p.name}` | {p.unit} | {p.meaning} | {' | '.join(_values(p))} |"


def _values(p: Parameter) -> tuple[str, str, str]:
    """Neutral value, bounds and starts."""
    low, high = p.bounds(CAR)
    starts = p.start_values(CAR)
    bounds = f"±{high:.4g}" if low == -high else f"{_value(p.low, low)} to {_value(p.high, high)}"
    pair = len(starts) == 2 and starts[0] == -starts[1]
    listed = f"±{starts[1]:.4g}" if pair else ", ".join(f"{value:.4g}" for value in starts)
    return _value(p.neutral, p.neutral_value(CAR)), bounds, listed + ("*" if callable(p.starts) else "")


def _value(declared: Value, value: float) -> str:
    return f"{value:.4g}" + ("*" if callable(declared) else "")


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    PAGE.write_text(page(), encoding="utf-8")
    print(f"wrote {PAGE}")
