"""Keys of drivers on the command line: chosen, changed, refused with the nearest one, and listed."""

import pytest

from rearl_jax.cli.composition import UsageError, compose_task
from rearl_jax.cli.help import task_help
from rearl_jax.config.driver import MODELS, record_of
from rearl_jax.tasks import TASKS
from tests.refusal import refused

BY_WORDS = {task.words: task for task in TASKS}
SIMULATING = ("evaluate", "sweep thresholds", "sweep scale", "study table1", "study table3", "study fig6", "study fig7")
SIMULATING += ("study budget",)


def composed(words, *overrides, config_dir=None):
    return compose_task(BY_WORDS[words], list(overrides), config_dir)


@pytest.mark.parametrize("words", SIMULATING)
def test_every_task_that_simulates_has_them(words):
    config = composed(words, "driver=idm", "driver.time_gap=1.2", "driver.time_gap_sd=.3", "mobil.politeness=.3")
    assert type(config.driver) is record_of("idm")
    assert (config.driver.time_gap, config.driver.time_gap_sd, config.mobil.politeness) == (1.2, 0.3, 0.3)
    assert composed(words).driver.is_default


def test_classes_are_given_whole_or_key_by_key():
    whole = composed("evaluate", "driver=gipps", "driver.classes={truck: {share: 0.1, time_gap: 1.8}}")
    single = composed("evaluate", "driver=gipps", "driver.classes.truck.share=0.1", "driver.classes.truck.time_gap=1.8")
    assert whole.driver.classes == single.driver.classes == {"truck": {"share": 0.1, "time_gap": 1.8}}


def test_a_file_of_the_users_own_is_a_choice(tmp_path):
    (tmp_path / "driver").mkdir()
    (tmp_path / "driver" / "fleet.yaml").write_text("# Our fleet\ndefaults: [constant_time_headway]\ntime_gap: 1.1\n")
    config = composed("evaluate", "driver=fleet", "driver.jam_gap=3", config_dir=str(tmp_path))
    assert (config.driver.model, config.driver.time_gap, config.driver.jam_gap) == ("constant_time_headway", 1.1, 3.0)


@pytest.mark.parametrize(
    ("overrides", "code", "key", "nearest"),
    [
        (["driver=idmm"], "choice-unknown", "driver", "idm"),
        (["driver=idm", "driver.timegap=1"], "key-unknown", "driver.timegap", "driver.time_gap"),
        (["driver=idm", "driver.gap_gain=1"], "key-unknown", "driver.gap_gain", "driver."),
        (["mobil.polite=1"], "key-unknown", "mobil.polite", "mobil.politeness"),
    ],
)
def test_mistakes_are_answered_with_the_nearest_key(overrides, code, key, nearest):
    with refused(code, UsageError, key=key) as caught:
        composed("evaluate", *overrides)
    assert f"nearest: {nearest}" in caught.value.problem.fault


def test_discovery_calibrates_the_model_that_is_chosen():
    assert composed("discover").driver == record_of("idm")()
    assert composed("discover", "driver=constant_time_headway").driver == record_of("constant_time_headway")()


def test_the_model_that_is_chosen_stays_unless_others_are_asked_for():
    def names(*overrides):
        return [driver.model for driver in composed("discover", *overrides).compared]

    assert names() == ["idm", *sorted(set(MODELS) - {"idm"})]
    assert names("driver=idm") == ["idm"]
    assert names("driver.time_gap=1.0") == ["idm"]
    assert names("driver=gipps") == ["gipps"]
    assert names("driver=gipps", "discover.base=[idm,fvdm,gipps]") == ["gipps", "idm", "fvdm"]
    assert names("discover.base=[]") == ["idm"]
    assert names("discover.oracle=grade") == ["idm"]


def test_an_unknown_model_cannot_be_compared():
    with refused("out-of-range", key="discover.base", value="wiedemann"):
        composed("discover", "discover.base=[wiedemann]")


def test_help_lists_all_models_and_the_keys_of_the_chosen_one():
    text = task_help(BY_WORDS["evaluate"], ["driver=constant_time_headway"])
    for name, model in MODELS.items():
        assert f"driver={name}  {model.title}" in text
    words = " ".join(text.split())
    for key in ("driver.gap_gain=0.1", "driver.time_gap=1.5", "mobil.politeness=0.0", "driver.time_gap_sd=0.0"):
        assert key in words
    assert "driver.comfort_decel" not in words
    assert "desired time gap T [s]; usual middle setting of adaptive cruise control" in words
