"""Controllers of OpenSCENARIO: the catalogue satisfies the schema of the standard and says the drivers."""

import importlib.util
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from rearl_jax.config import ResultsConfig
from rearl_jax.config.driver import record_of
from rearl_jax.config.export import ExportTask, Target
from rearl_jax.config.mobil import MobilConfig
from rearl_jax.export import openscenario, to_openscenario
from rearl_jax.export.drawn import draw
from rearl_jax.export.task import run
from rearl_jax.models.population import Population, population_of_keys, population_of_model
from rearl_jax.models.record import EffectValues
from tests.models.drivers import model

F64 = np.dtype("float64")
is_installed = importlib.util.find_spec("scenariogeneration") is not None
needs_it = pytest.mark.skipif(not is_installed, reason="needs the extra openscenario")


def _people(**keys) -> Population:
    people = population_of_keys(record_of("idm")(**keys), MobilConfig(), F64, 10)
    assert people is not None
    return people


def _properties(text: str) -> dict[str, dict[str, str]]:
    return {
        one.attrib["name"]: {own.attrib["name"]: own.attrib["value"] for own in one.iter("Property")}
        for one in ET.fromstring(text).iter("Controller")
    }


@needs_it
def test_every_driver_is_a_controller_with_its_parameters():
    people = _people(time_gap_sd=0.3, length_sd=0.4)
    exported = to_openscenario(people, 20, 0)
    found, drawn = _properties(exported.text), draw(people, 20, 0)
    assert list(found) == [f"driver_{number}" for number in range(20)]
    for name, values in drawn.values.items():
        assert [float(one[name]) for one in found.values()] == pytest.approx(list(values), rel=1e-5)
    assert [float(one["length"]) for one in found.values()] == pytest.approx(list(drawn.length), rel=1e-5)
    assert {one["car_following"] for one in found.values()} == {"idm"}
    assert exported.text == to_openscenario(people, 20, 0).text


def test_the_catalogue_satisfies_the_schema_and_is_read_by_its_library(tmp_path):
    xosc = pytest.importorskip("scenariogeneration.xosc", reason="needs the extra openscenario")
    xmlschema = pytest.importorskip("xmlschema", reason="needs the extra openscenario")
    path = tmp_path / "ControllerCatalog.xosc"
    path.write_text(to_openscenario(_people(), 2, 0).text, encoding="utf-8")
    (header,) = ET.parse(path).getroot().iter("FileHeader")
    minor = header.attrib["revMinor"]
    (schema, *_) = sorted(Path(str(xosc.__file__)).parents[2].glob(f"schemas/OpenSCENARIO_1_{minor}*.xsd"))
    xmlschema.XMLSchema(str(schema)).validate(str(path))
    reference = xosc.CatalogReference("ControllerCatalog", "driver_1")
    controller = xosc.CatalogReader(reference, str(tmp_path))
    assert isinstance(controller, xosc.Controller)
    assert _properties(path.read_text(encoding="utf-8"))["driver_1"] == dict(controller.properties.properties)


@needs_it
def test_effects_and_noise_are_not_said():
    exported = to_openscenario(
        population_of_model(model(EffectValues("actuator_lag", {"time": 0.4})), F64, with_effects=True), 1, 0
    )
    assert "actuator_lag" in [one.what for one in exported.translations if one.where is None]


@needs_it
def test_the_command_writes_the_catalogue(tmp_path):
    config = ExportTask(study="x", to=Target.openscenario, results=ResultsConfig(root=str(tmp_path)))
    assert run(config)["target"] == "openscenario"
    assert len(_properties((tmp_path / "x" / "ControllerCatalog.xosc").read_text(encoding="utf-8"))) == 100


def test_a_missing_library_is_named_with_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "scenariogeneration", None)
    monkeypatch.setattr(openscenario, "find_spec", lambda name: None)
    with pytest.raises(ModuleNotFoundError, match=r"rearl-jax\[openscenario\]"):
        to_openscenario(_people(), 1, 0)
