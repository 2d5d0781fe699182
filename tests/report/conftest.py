"""A report with all that one can have, made once, and what it is looked at with."""

import functools
from html.parser import HTMLParser
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from flyrl.evaluation.drive_map import DriveMap, Steering
from flyrl.report import Video, write_report
from flyrl.report.captions import jpeg
from flyrl.report.style import svg_text
from flyrl.report.video import HOLD_FRAMES, encode
from flyrl.rollouts import Gait
from tests.report.hostile import hostile_results
from tests.synthetic import make_record, make_results

NAMES = ("target-ppo", "cpg", "hybrid")
TERRAINS = ("flat", "gapped")
FILMED = 20
"""Pictures of an episode's film, before its end stands still."""

DARKEST, BRIGHTER = 40, 8
VOID = {"meta", "link", "br", "hr", "img", "input", "source"}
EVALUATIONS = [
    {"decisions": 100.0, "success_rate": 0.25, "mean_return": -1.0},
    {"decisions": 200.0, "success_rate": 0.75, "mean_return": 2.0},
    {"decisions": 300.0, "success_rate": 0.5, "mean_return": 3.0},
]


class Page(HTMLParser):
    """Collects what a test asks for, and checks that every tag is closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.texts = [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)

    def of(self, tag):
        """Attributes of every element of a kind."""
        return [attrs for name, attrs in self.tags if name == tag]

    @property
    def words(self):
        return " ".join(" ".join(self.texts).split())


def texts(drawn):
    """Texts of an SVG, or of a figure as one, which is well-formed."""
    svg = drawn if isinstance(drawn, str) else svg_text(drawn)
    return [
        "".join(node.itertext()).strip()
        for node in ET.fromstring(svg).iter()
        if node.tag.endswith("}text")
    ]


def gaited(controller, way=10):
    """An episode of 1 s and `way` mm with strides of 100 ms, of which legs stand for 60."""
    stance = np.repeat(((np.arange(1000) // 10) % 10 < 6)[:, np.newaxis], 6, axis=1)
    none = np.zeros_like(stance)
    return make_record(
        [(0, 0), (way, 0)],
        controller=controller,
        interval_s=1.0,
        gait=Gait(1e-3, stance, stance, none, none.copy(), 0.0, np.zeros(6)),
    )


@functools.cache
def brightening():
    """A video whose pictures get brighter one by one, until its end, and its poster."""
    levels = DARKEST + BRIGHTER * np.minimum(np.arange(FILMED + HOLD_FRAMES), FILMED - 1)
    pictures = [np.full((48, 64, 3), level, np.uint8) for level in levels]
    return encode(pictures), jpeg(pictures[-1])


def film(name, terrain="flat"):
    return Video(name, terrain, 0, "left_arena", FILMED + HOLD_FRAMES, 0.01, *brightening())


def drive_map():
    drives = np.linspace(-0.5, 1.5, 5)
    left, right = np.meshgrid(drives, drives, indexing="ij")
    speed = 10 * (left + right) / 2
    speed[0, 4] = np.nan
    return DriveMap("flat", drives, speed, 100 * (right - left), 8, 0 * left, 0 * left)


def steering():
    return Steering(np.array([-90.0, 0.0, 90.0]), {"target-ppo": np.ones((4, 3, 2))})


@pytest.fixture(scope="session")
def results():
    """Results of a learned policy and two fixed controllers on two terrains."""
    results = make_results(NAMES, TERRAINS, episodes=8)
    results.protocol["entrants"][0] |= {
        "policy": "learned with ppo",
        "trained_in": {"terrain": {"name": "gapped"}},
        "training": {
            **{"algo": "ppo", "decisions": 102400, "seed": 7},
            "settings": {
                "algo": {"name": "ppo", "learning_rate": 0.0006, "hidden_layers": [64, 64]},
                "training": {"num_envs": 32},
            },
        },
    }
    results.protocol["body"] = {"muscles": {}}
    for row in results.summaries:
        row["metrics"]["work_nj_per_mm"].update(n=2, mean=12.5, q1=11.0, q3=14.0)
    return results


@pytest.fixture(scope="session")
def report(results, tmp_path_factory):
    return write_report(
        results,
        tmp_path_factory.mktemp("report"),
        videos=[film(name) for name in NAMES],
        examples=[gaited("cpg"), gaited("hybrid", way=1)],
        drive_map=drive_map(),
        steering=steering(),
        curves={"target-ppo": EVALUATIONS},
    )


@pytest.fixture(scope="session")
def hostile_report(tmp_path_factory):
    return write_report(hostile_results(), tmp_path_factory.mktemp("hostile") / "report")


@pytest.fixture(scope="session")
def text(report):
    return report.read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def page(text):
    return Page(text)
