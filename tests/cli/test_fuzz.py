"""Whatever is typed, and whatever a file holds: a documented status, and no traceback."""

import json
import os
import shutil

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flyrl.cli.arguments import composed
from flyrl.training.learn import train as train_here
from flyrl.training.runs import flat
from tests.tiny import TINY, TINY_ARGUMENTS

STATUSES = {0, 1, 2}
LONGEST_MESSAGE = 1_500
QUICK = settings(
    max_examples=int(os.environ.get("FLYRL_FUZZ_EXAMPLES", "12")),
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)

WORDS = """
null true 5 -1 0 1.5 1e9 1e400 1e-12 nan -inf '' abc [] [null] [5] [[]] {} {a:1} [flat] flat,blocks
${seed} ${nowhere} ${oc.env:NOWHERE} é ' no:where 999999999999 a:b:c target-flat [hybrid,hybrid]
cuda = rule_based 1_0 / .. [nan] [1e400,1] {mass:[1]} * !a
"""
VALUES = st.one_of(
    st.sampled_from(WORDS.split()),
    st.sampled_from(["a" * 300, "[" * 300, "{" * 200, "(1, 2)", " ", "\ud800"]),
    st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=8),
)
WHOLE_VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=5),
    st.sampled_from([10**9, 10**400, [], [[]], {}, {"a": None}, [None], "mine:make", -1, 1e-12]),
)


def keys(program):
    """Every dotted key of a command's settings, and some that do not exist."""
    known = [*flat(composed(program.removesuffix(".py"))), "task", "terrain", "algo", "body"]
    return st.sampled_from([*known, "terain", "hydra.run.dir", "~seed", "+new", "", "a b", "+"])


def overrides(program):
    """Some arguments, most of them wrong."""
    signs = st.sampled_from(["=", "=", "=", "=", "", "+="])
    names = st.deferred(lambda: keys(program))  # not yet when the tests are collected
    one = st.tuples(names, signs, VALUES).map("".join)
    return st.lists(one, min_size=1, max_size=2)


@pytest.fixture
def check(run_here):
    """Run a command: a documented status; and a short message where that is one of an error."""

    def check(program, arguments):
        result = run_here(program, *arguments)
        assert result.returncode in STATUSES, result
        assert "Traceback" not in result.stderr, result.stderr
        if result.returncode == 2:
            message = result.stderr[result.stderr.rindex("error: ") :]
            assert len(message) < LONGEST_MESSAGE, message
        return result.returncode

    return check


@QUICK
@given(overrides("train.py"))
def test_whatever_is_typed_after_train(check, arguments):
    # the last is refused after all else was checked, so that nothing is trained
    stop = ["evaluate_after=true", "evaluation.folder=/dev/null/x"]
    assert check("train.py", [*TINY_ARGUMENTS, *arguments, *stop]) == 2


@QUICK
@given(overrides("evaluate.py"))
def test_whatever_is_typed_after_evaluate(check, arguments):
    assert check("evaluate.py", [*arguments, "folder=/dev/null/x"]) == 2


def damaged(data, text):
    """A file's text after something happened to it."""
    kind = data.draw(st.sampled_from(["cut", "bytes", "other", "value"]))
    if kind == "cut":
        return text[: data.draw(st.integers(0, len(text)))]
    if kind == "bytes":
        place = data.draw(st.integers(0, len(text)))
        return text[:place] + data.draw(st.binary(max_size=6)) + text[place + 3 :]
    if kind == "other":
        return data.draw(st.sampled_from([b"", b"{", b"[]", b"{}", b"3", b"a word", b"\xff\xfe"]))
    return None


def with_another_value(data, tree):
    """Settings of which one, at some depth, is another."""
    if isinstance(tree, dict) and tree and data.draw(st.integers(0, 9)):
        key = data.draw(st.sampled_from(sorted(tree)))
        return {**tree, key: with_another_value(data, tree[key])}
    return data.draw(WHOLE_VALUES)


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    """Folder of a run that was interrupted."""
    folder = train_here(TINY, tmp_path_factory.mktemp("runs")).folder
    status = json.loads((folder / "status.json").read_text())
    (folder / "status.json").write_text(json.dumps({**status, "interrupted_by": "SIGTERM"}))
    return folder


@QUICK
@given(st.data())
def test_whatever_the_files_of_a_run_hold(check, run_folder, tmp_path, data):
    folder = tmp_path / "run"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(run_folder, folder)
    files = [file for file in folder.rglob("*") if file.is_file() and ".lock" not in file.name]
    file = data.draw(st.sampled_from(sorted(files)))
    text = damaged(data, file.read_bytes())
    if text is None:
        file = folder / "config.yaml"
        settings_of_run = with_another_value(data, yaml.safe_load(file.read_text()))
        text = yaml.safe_dump(settings_of_run).encode("utf-8", "surrogatepass")
    file.write_bytes(text)
    commands = {
        "train.py": ["resume=run", "video_after=false"],
        "flyrl": ["runs", "."],
        "evaluate.py": ["policies=[run]", "folder=/dev/null/x"],
    }
    program = data.draw(st.sampled_from(["train.py", "train.py", "flyrl", "evaluate.py"]))
    check(program, commands[program])


@QUICK
@given(st.data())
def test_whatever_a_report_holds(check, report, tmp_path, data):
    before, start, rest = report.read_text().partition(
        '<script type="application/json" id="origin">'
    )
    origin, end, after = rest.partition("</script>")
    changed = damaged(data, origin.encode())
    if changed is None:
        changed = json.dumps(with_another_value(data, json.loads(origin))).encode()
    path = tmp_path / "report.html"
    path.write_bytes((before + start).encode() + changed + (end + after).encode())
    check("flyrl", ["reproduce", str(path)])
