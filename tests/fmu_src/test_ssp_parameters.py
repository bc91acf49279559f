"""Parameter sets of SSP packages: bound to systems and elements, mapped and converted as SSP 1.0 has it, or refused."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from fmu_src.ssp import SSC, SSD, SSV
from fmu_src.ssp_client import bound_parameters, problems, simulate
from fmu_src.ssp_parameters import SSM
from scenarios.fmu_client.archives import UnitFileError

NAMESPACES = f'xmlns:ssd="{SSD}" xmlns:ssc="{SSC}" xmlns:ssv="{SSV}" xmlns:ssm="{SSM}"'
KM_H = '<ssc:Unit name="km/h"><ssc:BaseUnit m="1" s="-1" factor="0.2777777777777778"/></ssc:Unit>'
UNIT = """<fmiModelDescription fmiVersion="2.0" modelName="Car" guid="1"><CoSimulation modelIdentifier="Car"/>
<UnitDefinitions>
<Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit>
<Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit>
<Unit name="points"/>
</UnitDefinitions>
<TypeDefinitions><SimpleType name="Gear"><Enumeration>
<Item name="low" value="1"/><Item name="high" value="4"/>
</Enumeration></SimpleType></TypeDefinitions>
<ModelVariables>VARIABLES</ModelVariables><ModelStructure/></fmiModelDescription>"""
PARAMETERS = {
    "start_speed": '<Real unit="m/s" start="0"/>',
    "air": '<Real unit="degC" start="0"/>',
    "rise": '<Real unit="degC" relativeQuantity="true" start="0"/>',
    "mass": '<Real start="0"/>',
    "score": '<Real unit="points" start="0"/>',
    "wheels": '<Integer start="0"/>',
    "front": '<Boolean start="false"/>',
    "gear": '<Enumeration declaredType="Gear" start="1"/>',
    "road": '<String start=""/>',
}


def description() -> str:
    """Of a unit with these parameters, an input and an output."""
    variables = [("speed", "input", "continuous", '<Real unit="m/s" start="0"/>')]
    variables += [(name, "parameter", "fixed", kind) for name, kind in PARAMETERS.items()]
    variables += [("way", "output", "continuous", "<Real/>")]
    rows = (
        f'<ScalarVariable name="{name}" valueReference="{index}" causality="{causality}" variability="{variability}">'
        f"{kind}</ScalarVariable>"
        for index, (name, causality, variability, kind) in enumerate(variables)
    )
    return UNIT.replace("VARIABLES", "".join(rows))


Make = Callable[..., Path]


def real(name: str, value: object, unit: str = "") -> str:
    return one(name, "Real", value, f' unit="{unit}"' if unit else "")


def one(name: str, kind: str, value: object, more: str = "") -> str:
    return f'<ssv:Parameter name="{name}"><ssv:{kind} value="{value}"{more}/></ssv:Parameter>'


def set_of(*parameters: str, units: str = "", enumerations: str = "") -> str:
    return (
        f'<ssv:ParameterSet {NAMESPACES} version="1.0" name="set">'
        f"<ssv:Parameters>{''.join(parameters)}</ssv:Parameters>"
        + (f"<ssv:Enumerations>{enumerations}</ssv:Enumerations>" if enumerations else "")
        + (f"<ssv:Units>{units}</ssv:Units>" if units else "")
        + "</ssv:ParameterSet>"
    )


def entry(source: str, target: str, change: str = "", more: str = "") -> str:
    return f'<ssm:MappingEntry source="{source}" target="{target}"{more}>{change}</ssm:MappingEntry>'


def integers(source: int, target: int) -> str:
    row = f'<ssc:MapEntry source="{source}" target="{target}"/>'
    return f"<ssc:IntegerMappingTransformation>{row}</ssc:IntegerMappingTransformation>"


def connector_of(name: str, kind: str) -> str:
    row = f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Real/></ssd:Connector>'
    return f"<ssd:Connectors>{row}</ssd:Connectors>"


def mapping_of(*entries: str) -> str:
    return f'<ssm:ParameterMapping {NAMESPACES} version="1.0">{"".join(entries)}</ssm:ParameterMapping>'


def mapped(*entries: str) -> str:
    return f"<ssd:ParameterMapping>{mapping_of(*entries)}</ssd:ParameterMapping>"


def inline(values: str, mapping: str = "", more: str = "") -> str:
    within = f"<ssd:ParameterValues>{values}</ssd:ParameterValues>"
    return f"<ssd:ParameterBinding{more}>{within}{mapping}</ssd:ParameterBinding>"


def file(source: str, mapping: str = "", more: str = "") -> str:
    return f'<ssd:ParameterBinding source="{source}"{more}>{mapping}</ssd:ParameterBinding>'


def bindings(*each: str) -> str:
    return f"<ssd:ParameterBindings>{''.join(each)}</ssd:ParameterBindings>" if each else ""


def component(name: str, *bound: str, more: str = "", connectors: str = "") -> str:
    within = connectors + bindings(*bound)
    return f'<ssd:Component name="{name}" source="resources/Car.fmu"{more}>{within}</ssd:Component>'


def system(
    elements: str, *bound: str, name: str = "whole", connectors: str = "", connections: str = ""
) -> str:
    return (
        f'<ssd:System name="{name}">{connectors}{bindings(*bound)}<ssd:Elements>{elements}</ssd:Elements>'
        f"{connections}</ssd:System>"
    )


@pytest.fixture
def package(tmp_path: Path) -> Make:
    """Writes a package of a system with further files."""

    def make(whole: str, units: str = "", **files: str) -> Path:
        with zipfile.ZipFile(tmp_path / "Car.fmu", "w") as archive:
            archive.writestr("modelDescription.xml", description())
        with zipfile.ZipFile(tmp_path / "made.ssp", "w") as archive:
            archive.write(tmp_path / "Car.fmu", "resources/Car.fmu")
            archive.writestr(
                "SystemStructure.ssd",
                f'<ssd:SystemStructureDescription {NAMESPACES} version="1.0" name="made">{whole}'
                + (f"<ssd:Units>{units}</ssd:Units>" if units else "")
                + "</ssd:SystemStructureDescription>",
            )
            for name, text in files.items():
                archive.writestr(f"resources/{name.replace('__', '.')}", text)
        return tmp_path / "made.ssp"

    return make


def values(made: Path) -> dict[str, object]:
    return {parameter.name: parameter.value for parameter in bound_parameters(made).parameters}


def refused(made: Path) -> str:
    """The one sentence with which a package is refused; no simulation of it begins."""
    with pytest.raises(UnitFileError) as raised:
        bound_parameters(made)
    with pytest.raises(UnitFileError):
        simulate(made, 0.1)
    assert str(raised.value).count("\n") == 0
    return str(raised.value)


# What is followed


def test_a_prefix_takes_the_set_of_an_element_to_a_system(package: Make) -> None:
    car = set_of(real("mass", 1200.0), one("wheels", "Integer", 4))
    made = package(
        system(component("a") + component("ab"), file("resources/car.ssv", more=' prefix="a."')), car__ssv=car
    )
    assert problems(made) == []
    assert values(made) == {"a.mass": 1200.0, "a.wheels": 4}


def test_names_of_a_system_go_through_the_systems_within_it(package: Make) -> None:
    inner = system(component("car"), inline(set_of(real("car.mass", 1.0))), name="inner")
    outer = inline(set_of(real("inner.car.air", 7.0), real("car.mass", 2.0)))
    assert values(package(system(inner + component("car"), outer))) == {
        "inner.car.mass": 1.0, "inner.car.air": 7.0, "car.mass": 2.0,
    }  # fmt: skip


def test_systems_win_over_elements_and_later_bindings_over_earlier_ones(package: Make) -> None:
    def mass(value: float, name: str = "mass") -> str:
        return inline(set_of(real(name, value)))

    low = component("car", mass(1.0), mass(2.0))
    assert values(package(system(low))) == {"car.mass": 2.0}
    inner = system(low, mass(3.0, "car.mass"), name="inner")
    assert values(package(system(inner))) == {"inner.car.mass": 3.0}
    top = mass(5.0, "inner.car.mass"), mass(4.0, "inner.car.mass")
    assert values(package(system(inner, *top))) == {"inner.car.mass": 4.0}


def test_units_are_converted_to_those_of_the_variables(package: Make) -> None:
    base = '<ssc:BaseUnit K="1" factor="0.5555555555555556" offset="255.3722222222222"/>'
    fahrenheit = f'<ssc:Unit name="degF">{base}</ssc:Unit>'
    given = set_of(
        real("speed", 72.0, "km/h"), real("start_speed", 36.0, "km/h"), real("air", 68.0, "degF"),
        real("rise", 18.0, "degF"), real("score", 3.0, "points"), units=KM_H + fahrenheit,
    )  # fmt: skip
    assert values(package(system(component("car", file("resources/a.ssv"))), a__ssv=given)) == pytest.approx(
        {"car.speed": 20.0, "car.start_speed": 10.0, "car.air": 20.0, "car.rise": 10.0, "car.score": 3.0}
    )


def test_a_set_within_the_structure_may_use_the_units_of_the_structure(package: Make) -> None:
    given = inline(set_of(real("speed", 36.0, "km/h")))
    assert values(package(system(component("car", given)), units=KM_H)) == pytest.approx({"car.speed": 10.0})


def test_a_mapping_renames_and_transforms_after_the_conversion_of_units(package: Make) -> None:
    entries = (
        entry("v", "speed", '<ssc:LinearTransformation factor="2" offset="1"/>'),
        entry("v", "start_speed", '<ssc:LinearTransformation factor="0.5"/>', ' suppressUnitConversion="true"'),
        entry("axle", "front", '<ssc:BooleanMappingTransformation><ssc:MapEntry source="true" target="false"/>'
              '<ssc:MapEntry source="false" target="true"/></ssc:BooleanMappingTransformation>'),
        entry("axles", "wheels", integers(2, 4)),
        entry("stage", "gear", '<ssc:EnumerationMappingTransformation><ssc:MapEntry source="fast" target="high"/>'
              "</ssc:EnumerationMappingTransformation>"),
    )  # fmt: skip
    given = set_of(
        real("v", 36.0, "km/h"), one("axle", "Boolean", "true"), one("axles", "Integer", 2),
        one("stage", "Enumeration", "fast"), units=KM_H,
    )  # fmt: skip
    expected = {
        "car.speed": 21.0,
        "car.start_speed": 18.0,
        "car.front": False,
        "car.wheels": 4,
        "car.gear": 4,
    }
    within = package(system(component("car", inline(given, mapped(*entries)))))
    assert problems(within) == []
    assert values(within) == pytest.approx(expected)
    beside = file("resources/a.ssv", '<ssd:ParameterMapping source="resources/a.ssm"/>')
    made = package(system(component("car", beside)), a__ssv=given, a__ssm=mapping_of(*entries))
    assert problems(made) == []
    assert values(made) == pytest.approx(expected)


def test_the_prefix_comes_before_the_mapping(package: Make) -> None:
    given = inline(set_of(real("m", 3.0)), mapped(entry("car.m", "car.mass")), ' prefix="car."')
    assert values(package(system(component("car"), given))) == {"car.mass": 3.0}


def test_enumerations_are_taken_by_the_names_of_the_unit_or_by_numbers(package: Make) -> None:
    gears = '<ssc:Enumeration name="G"><ssc:Item name="reverse" value="-1"/></ssc:Enumeration>'
    table = integers(-1, 1)
    assert values(package(system(component("car", inline(set_of(one("gear", "Enumeration", "high"))))))) == {
        "car.gear": 4
    }
    given = set_of(one("gear", "Enumeration", "reverse", ' name="G"'), enumerations=gears)
    assert values(package(system(component("car", inline(given, mapped(entry("gear", "gear", table))))))) == {
        "car.gear": 1
    }


def test_a_parameter_of_a_system_goes_to_the_elements_behind_it(package: Make) -> None:
    connectors, of_car = connector_of("weight", "parameter"), connector_of("mass", "parameter")
    ends = 'startConnector="weight" endElement="car" endConnector="mass"'
    connections = f"<ssd:Connections><ssd:Connection {ends}/></ssd:Connections>"
    inner = system(
        component("car", connectors=of_car), name="inner", connectors=connectors, connections=connections
    )
    assert values(package(system(inner, inline(set_of(real("inner.weight", 900.0)))))) == {
        "inner.car.mass": 900.0
    }


def test_names_that_no_variable_has_are_ignored_and_named(package: Make) -> None:
    given = inline(set_of(real("mass", 1.0), real("colour", 2.0)))
    with pytest.warns(UserWarning, match=r"ignored: .*'colour'"):
        assert values(package(system(component("car", given)))) == {"car.mass": 1.0}
    given = inline(set_of(real("mass", 1.0), real("m", 2.0)), mapped(entry("m", "mass"), entry("n", "air")))
    with pytest.warns(UserWarning, match=r"'n' to 'air': no such source; .*parameter 'mass': no entry"):
        assert values(package(system(component("car", given)))) == {"car.mass": 2.0}


# What is refused


LINEAR = '<ssc:LinearTransformation factor="2"/>'
WRONG = {
    "unknown unit": (inline(set_of(real("speed", 1.0, "knot"))), "'speed'.*no definition of 'knot' in the set"),
    "other dimension": (
        inline(set_of(real("speed", 1.0, "kg"), units='<ssc:Unit name="kg"><ssc:BaseUnit kg="1"/></ssc:Unit>')),
        "'kg' cannot be converted to 'm/s'",
    ),
    "unit for a bare number": (inline(set_of(real("mass", 1.0, "km/h"), units=KM_H)), "'mass'.* has no unit"),
    "unit that the unit does not define": (
        inline(set_of(real("score", 1.0, "km/h"), units=KM_H)), "no definition of 'points' in the unit"),
    "factor 0": (
        inline(set_of(real("speed", 1.0, "km/h"), units=KM_H.replace("0.2777777777777778", "0"))), "has the factor 0"),
    "no finite number": (inline(set_of(real("mass", "NaN"))), "'mass': for .* is nan; expected a finite number"),
    "a factor without end": (
        inline(set_of(real("m", 1.0)), mapped(entry("m", "mass", LINEAR.replace("2", "INF")))), "is inf; expected"),
    "mapping to nothing": (
        inline(set_of(real("m", 1.0)), mapped(entry("m", "weight"))),
        "mapping of 'm' to 'weight': its target 'weight' is no variable of .*element 'car'",
    ),
    "target twice": (inline(set_of(real("m", 1.0)), mapped(entry("m", "mass"), entry("m", "mass"))), "stands twice"),
    "parameter twice": (inline(set_of(real("mass", 1.0), real("mass", 2.0))), "'mass': stands twice in its set"),
    "an output": (inline(set_of(real("way", 1.0))), "'way'.*is output and no value that can be set"),
    "another type": (inline(set_of(real("wheels", 4.0))), "'wheels'.*is of type Real; expected Integer"),
    "a text": (inline(set_of(one("road", "String", "a.yaml"))), "'road'.*a text, which fmpy's master does not set"),
    "bytes": (inline(set_of(one("mass", "Binary", "00"))), "'mass': is binary"),
    "item": (inline(set_of(one("gear", "Enumeration", "middle"))), "no item middle. Known: low, high"),
    "transformation of another type": (
        inline(set_of(one("w", "Integer", 4)), mapped(entry("w", "wheels", LINEAR))),
        "LinearTransformation is for Real, not for Integer",
    ),
    "no entry in the table": (
        inline(set_of(one("w", "Integer", 3)), mapped(entry("w", "wheels", integers(2, 4)))),
        "has no entry for 3",
    ),
    "unknown enumeration": (
        inline(set_of(one("gear", "Enumeration", "low", ' name="G"'))), "no enumeration 'G' in its file"),
    "no set": ("<ssd:ParameterBinding/>", "ParameterBinding 1: has no source and no set inline"),
    "two sets": (
        inline(set_of(real("mass", 1.0)), more=' source="resources/Car.fmu"'),
        "ParameterBinding 1: states a source and a set inline",
    ),
    "another kind of set": (file("resources/Car.fmu", more=' type="text/csv"'), "is of type text/csv; expected"),
    "a source in the component": (file("resources/Car.fmu", more=' sourceBase="component"'), "its sourceBase is"),
    "a set on the network": (file("http://localhost/a.ssv"), "no 'http://localhost/a.ssv' in the package"),
    "no XML": (file("resources/Car.fmu"), "resources/Car.fmu: "),
    "something else inline": (inline("<ssv:Parameters/>"), "Expected a set by the schema of SSP 1.0"),
    "a value that is no number": (inline(set_of(real("mass", "heavy"))), "'heavy' is not a valid value.*by the schema"),
    "a mapping without target": (
        inline(set_of(real("m", 1.0)), mapped('<ssm:MappingEntry source="m"/>')), "'target' is required"),
}  # fmt: skip


@pytest.mark.parametrize(("binding", "said"), WRONG.values(), ids=list(WRONG))
def test_what_cannot_be_followed_is_refused_by_name(package: Make, binding: str, said: str) -> None:
    text = refused(package(system(component("car", binding))))
    assert re.search(said, text), text
    assert "made.ssp" in text


def test_elements_that_cannot_be_followed_are_refused_by_name(package: Make) -> None:
    other = component("car", more=' type="application/x-ssp-package"')
    assert "element 'car': is of type application/x-ssp-package" in refused(package(system(other)))
    between = component("a.b") + system(component("b"), name="a")
    given = inline(set_of(real("a.b.mass", 1.0)))
    assert "'a.b.mass' means variables of two elements" in refused(package(system(between, given)))
    assert "has two elements 'car'" in refused(package(system(component("car") * 2)))
    given = inline(set_of(real("v", 1.0)))
    text = refused(package(system(component("car"), given, connectors=connector_of("v", "input"))))
    assert "sets the connector 'v'" in text
    assert "input 'speed' is not connected" in refused(
        package(system(component("car", connectors=connector_of("speed", "input"))))
    )
    connection = (
        '<ssd:Connections><ssd:Connection startElement="a" startConnector="way" endElement="b" endConnector="speed">'
        f"{LINEAR}</ssd:Connection></ssd:Connections>"
    )
    text = refused(package(system(component("a") + component("b"), connections=connection)))
    assert "connection of 'way' to 'speed': has a transformation" in text


@pytest.mark.parametrize("name", ["a__ssv", "a__ssm", "a__txt"])
def test_sets_and_mappings_are_hostile_texts(package: Make, name: str) -> None:
    entity = '<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]>' + set_of(real("mass", "&x;"))
    source = f"resources/{name.replace('__', '.')}"
    text = refused(package(system(component("car", file(source))), **{name: entity}))
    assert "document type" in text or "external entity" in text
    laughs = '<!DOCTYPE a [<!ENTITY x "1"><!ENTITY y "&x;&x;">]>' + set_of(real("mass", "&y;"))
    assert "document type" in refused(package(system(component("car", file(source))), **{name: laughs}))
    assert "root:" not in text


def test_a_unit_that_is_none_is_refused(package: Make, tmp_path: Path) -> None:
    made = package(system(component("car").replace("Car.fmu", "a.ssv")), a__ssv=set_of())
    assert "resources" in refused(made) or "a.ssv" in refused(made)
