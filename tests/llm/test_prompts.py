"""Questions about a scene made by hand and about random ones: text, order, shared beginnings."""

from collections import Counter
from functools import cache, partial
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.detection import Cues
from rearl_jax.config.llm import PromptConfig
from rearl_jax.config.metrics import HistConfig, OutOfBounds
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import derive_state, find_follower, find_leader
from rearl_jax.core.spawn import spawn
from rearl_jax.core.state import make_state
from rearl_jax.decision.loop import LoopOptions, assess, initial_loop_state
from rearl_jax.detection.detector import DetectionOptions
from rearl_jax.llm.prompts import Prompter
from rearl_jax.llm.surroundings import PLACES, look_around
from rearl_jax.llm.template import PromptTemplate
from rearl_jax.llm.variables import Asked, neighbours_of, ranks
from tests.llm.situations import (
    ask_small,
    make_situation,
    make_table,
    make_thresholds,
    random_situation,
    small_situation,
    small_table,
)

GOLDEN = Path(__file__).parent / "golden"


@cache
def random_table(hist):
    """Three references of eight seconds and ten vehicles."""
    rng = np.random.default_rng(7)
    shape = (3, 8, 10)
    return make_table(rng.uniform(3, 34, shape), rng.uniform(30, 200, shape), rng.integers(0, 5, shape), hist)


def ask_random(n_seconds, oob=OutOfBounds.clip):
    """Questions of each second of random traffic, the situations and the references."""
    hist = HistConfig(oob=oob)
    prompter = Prompter(random_table(hist), TrafficModel(), PromptConfig(), DetectionOptions(hist=hist))
    situations = [random_situation(second) for second in range(n_seconds)]
    return [prompter.questions(each, make_thresholds(8)) for each in situations], situations, random_table(hist)


def section(question, name):
    """The line of a question that begins with that word."""
    return next(line for line in question.messages[1].text.splitlines() if line.startswith(name))


def test_text_equals_the_golden_file():
    """To renew the file after an intended change: delete it, run this test, and read the new file."""
    file = GOLDEN / "questions.txt"
    questions = ask_small()
    parts = [f"[{questions[0].messages[0].role}]\n{questions[0].messages[0].text}\n"]
    for question in questions:
        place = f"scenario {question.scenario}, vehicle {question.vehicle}, choices {question.choices}"
        parts.append(f"[{question.messages[1].role}: {place}]\n{question.messages[1].text}\n")
    text = "\n".join(parts)
    if not file.exists():
        file.write_text(text, encoding="utf-8")
        pytest.fail(f"{file} was missing and has been written")
    assert text == file.read_text(encoding="utf-8")


def test_questions_are_sorted_and_leave_out_vehicles_that_are_not_asked_or_have_no_choice():
    questions = ask_small()
    assert [(q.scenario, q.vehicle) for q in questions] == [(1, 0), (1, 2), (0, 0), (0, 1), (0, 2), (2, 1), (2, 2)]
    assert [q.choices for q in questions] == [(1, 2, 3, 4)] * 5 + [(0, 1, 2, 3, 4)] * 2


def test_there_is_a_question_for_every_asked_vehicle_with_an_admissible_action():
    asked, situations, _ = ask_random(6)
    n_without_choice = 0
    for questions, situation in zip(asked, situations, strict=True):
        mask, admissible = situation.detection.mask, situation.admissible
        expected = {
            (s, i): tuple(np.flatnonzero(admissible[:, i, s]))
            for i, s in np.argwhere(mask)
            if admissible[:, i, s].any()
        }
        assert {(q.scenario, q.vehicle): q.choices for q in questions} == expected
        n_without_choice += int(mask.sum()) - len(questions)
        order = [(situation.detection.reference[q.scenario], q.scenario, q.vehicle) for q in questions]
        assert order == sorted(order)
    assert n_without_choice > 10


def test_questions_share_the_text_before_what_differs():
    asked, situations, _ = ask_random(1)
    reference = situations[0].detection.reference
    n_pairs = Counter()
    for one in asked[0]:
        for other in asked[0]:
            assert one.messages[0] == other.messages[0]
            a, b = one.messages[1].text, other.messages[1].text
            same_reference = reference[one.scenario] == reference[other.scenario]
            n_pairs[same_reference, one.scenario == other.scenario] += 1
            assert (a.partition("SCENE")[0] == b.partition("SCENE")[0]) == same_reference
            assert (a.partition("SELF")[0] == b.partition("SELF")[0]) == (one.scenario == other.scenario)
            assert a.partition("REFERENCE")[0] == b.partition("REFERENCE")[0]
            assert one is other or a != b
    assert min(n_pairs[True, True], n_pairs[True, False], n_pairs[False, False]) > 100


def test_shared_blocks_are_rendered_once(monkeypatch):
    rendered, render = Counter(), PromptTemplate.render

    def counting(self, block, *args):
        rendered[block] += 1
        return render(self, block, *args)

    monkeypatch.setattr(PromptTemplate, "render", counting)
    asked, situations, _ = ask_random(1)
    n_scenarios = len({q.scenario for q in asked[0]})
    n_references = len({int(situations[0].detection.reference[q.scenario]) for q in asked[0]})
    assert n_references < n_scenarios < len(asked[0])
    expected = {"system": 1, "road": 1, "reference": n_references, "scene": n_scenarios, "user": len(asked[0])}
    assert rendered == expected


@pytest.mark.parametrize("oob", OutOfBounds)
def test_scene_shows_the_shares_of_the_window(oob):
    asked, situations, table = ask_random(8, oob)
    edges = np.linspace(5, 32, 9)
    compared = 0
    for second, questions in enumerate(asked):
        first = max(second - 4, 0)
        for question in questions:
            reference = int(situations[second].detection.reference[question.scenario])
            window = [each.frame.speed[:, question.scenario] for each in situations[first : second + 1]]
            shares = []
            for speeds in (np.concatenate(window), np.asarray(table.speed)[first : second + 1, :, reference].ravel()):
                speeds = np.clip(speeds, 5, 32) if oob is OutOfBounds.clip else speeds
                counts = np.histogram(speeds, edges)[0]
                shares.append(100 * counts / counts.sum())
            expected = " ".join(f"{simulated:.0f}/{recorded:.0f}" for simulated, recorded in zip(*shares, strict=True))
            assert section(question, "SCENE").startswith(f"SCENE simulated/recorded %: {expected}; mean d ")
            compared += 1
    assert compared > 300


def plain_neighbours(situation, i, s, length):
    """The six places around vehicle i of scenario s, by a plain loop: gap, speed and relative speed of the nearest."""
    frame = situation.frame
    found = []
    for side in (0, -1, 1):
        lane = frame.lane[i, s] + side
        for is_ahead in (True, False):
            best = (None, None, None)
            for j in range(len(frame.x)):
                distance = frame.x[j, s] - frame.x[i, s]
                on_lane = 0 <= lane <= 3 and abs(frame.y[j, s] - 4 * lane) <= 3
                if j == i or not on_lane or (distance >= 0) != is_ahead:
                    continue
                gap = abs(distance) - (length[j, s] + length[i, s]) / 2
                if best[0] is None or gap < best[0]:
                    best = (gap, frame.speed[j, s], frame.speed[j, s] - frame.speed[i, s])
            found.append(best)
    return found


def test_neighbours_are_the_nearest_at_each_place():
    situation = random_situation(0, n_scenarios=30)
    rng = np.random.default_rng(3)
    length = rng.uniform(4, 18, (10, 30)).astype(np.float32)
    vehicle, scenario = np.nonzero(situation.detection.mask)
    around = look_around(situation.frame, length, vehicle, scenario, TrafficModel())
    n_empty = n_beside = 0
    for i, s, found in zip(vehicle, scenario, neighbours_of(around), strict=True):
        assert [other.place for other in found] == list(PLACES)
        expected = plain_neighbours(situation, i, s, length)
        for other, (gap, speed, relative) in zip(found, expected, strict=True):
            n_empty += gap is None
            n_beside += gap is not None and gap < 0
            assert (other.gap, other.speed, other.relative_speed) == (
                (None,) * 3 if gap is None else pytest.approx((gap, speed, relative), abs=1e-4)
            )
    assert n_empty > 100
    assert n_beside > 100


def test_neighbours_are_those_of_the_traffic_model():
    def distances(state, side):
        derived = derive_state(state, model)
        lane = derived.lane + side
        return find_leader(state, derived, lane).distance, find_follower(state, derived, lane).distance

    model = TrafficModel()
    frame = random_situation(1, n_scenarios=30).frame
    state = make_state(frame.x, frame.y, frame.speed, model)
    vehicle, scenario = np.nonzero(np.ones(frame.x.shape, bool))
    around = look_around(frame, 5.0, vehicle, scenario, model)
    n_neighbours = 0
    for number, side in enumerate((0, -1, 1)):
        for place, distance in enumerate(jax.jit(distances)(state, jnp.int32(side)), 2 * number):
            distance = np.asarray(distance)[vehicle, scenario]
            np.testing.assert_allclose(around.gap[place], distance - 5, rtol=1e-6)
            n_neighbours += np.isfinite(distance).sum()
    assert n_neighbours > 500


def test_equal_values_share_the_better_rank():
    values = np.array([[5.0, 1.0], [7.0, 1.0], [5.0, 2.0], [1.0, 0.0]])
    asked = Asked(np.array([0, 1, 2, 3, 0, 2]), np.array([0, 0, 0, 0, 1, 1]))
    assert ranks(values, asked).tolist() == [2, 1, 2, 4, 2, 1]


def test_next_can_be_left_out():
    full, plain = ask_small(), ask_small(next=False)
    assert all("next=keep" in question.messages[1].text for question in full)
    assert "next" in full[0].messages[0].text
    for question, other in zip(plain, full, strict=True):
        assert "next" not in question.messages[0].text + question.messages[1].text
        assert section(question, "R0") == section(other, "R0").partition(" next=")[0]
        assert section(question, "SCENE") == section(other, "SCENE")


def test_scene_can_be_left_out():
    full, plain = ask_small(), ask_small(scene=False)
    assert "SCENE" in full[0].messages[0].text
    for question, other in zip(plain, full, strict=True):
        assert "SCENE" not in question.messages[0].text + question.messages[1].text
        lines = other.messages[1].text.splitlines()
        assert question.messages[1].text.splitlines() == [line for line in lines if not line.startswith("SCENE")]


def test_minus_zero_is_written_as_zero_and_a_missing_limit_as_no_limit():
    situation = make_situation(0, x=[[0.0]], lane=[[0]], acceleration=[[-0.04]])
    table = make_table([[[20.0]]], [[[30.0]]], [[[1]]])
    prompter = Prompter(table, TrafficModel(speed_limit=None), PromptConfig(), DetectionOptions())
    (question,) = prompter.questions(situation, make_thresholds(1))
    assert "acc=0.0" in section(question, "SELF")
    assert "no limit" in section(question, "ROAD")


def test_a_repeated_or_skipped_second_is_an_error():
    prompter = Prompter(small_table(), TrafficModel(), PromptConfig(), DetectionOptions())
    prompter.questions(small_situation(0), make_thresholds(3))
    for wrong in (0, 2):
        with pytest.raises(ValueError, match="second"):
            prompter.questions(small_situation(wrong), make_thresholds(3))


def test_seconds_without_questions_count_for_the_window():
    asked, silent = (Prompter(small_table(), TrafficModel(), PromptConfig(), DetectionOptions()) for _ in range(2))
    no_vehicle = np.zeros((3, 3), bool)
    for second in range(4):
        situation = small_situation(second)
        asked.questions(situation, make_thresholds(3))
        quiet = eqx.tree_at(lambda s: s.detection.mask, situation, no_vehicle)
        assert silent.questions(quiet, make_thresholds(3)) == []
    last = small_situation(4)
    assert silent.questions(last, make_thresholds(3)) == asked.questions(last, make_thresholds(3))


@pytest.mark.thorough
def test_questions_about_situations_of_the_closed_loop():
    """The records that `assess` returns, fetched as they are: their shapes, their window, their permissions."""
    model, options = TrafficModel(meta_follows=True), LoopOptions(DetectionOptions(cues=Cues.always))
    rng = np.random.default_rng(4)
    shape, thresholds = (2, 3, 10), make_thresholds(4)
    table = make_table(rng.uniform(5, 32, shape), rng.uniform(30, 90, shape), rng.integers(0, 5, shape))
    keys = jax.random.split(jax.random.key(0), 4)
    state, drivers = spawn(keys, model, n_vehicles=10, density=3.0)
    show = jax.jit(partial(assess, model=model, options=options))
    traffic = initial_loop_state(state, keys, table, model, options)
    prompter = Prompter(table, model, PromptConfig(), options.detection)
    for _ in range(2):
        traffic, situation = show(traffic, drivers, table, thresholds)
        situation = jax.tree.map(np.asarray, situation)
        questions = prompter.questions(situation, thresholds)
        assert len(questions) == 40
        for question in questions:
            speed = situation.frame.speed[question.vehicle, question.scenario]
            assert f" v={speed:.1f} " in section(question, "SELF")
            assert section(question, "ACTIONS").split()[1:] == [str(choice) for choice in question.choices]
