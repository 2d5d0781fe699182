from flyrl.evaluation import load_results

OWN_POLICIES = """
from flyrl.policies import ConstantDrive

class Broken:
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        raise ArithmeticError("out of ideas")

class Stopped:
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        raise KeyboardInterrupt

def broken(task):
    return Broken()

def stopped(task):
    return Stopped()
"""
SHORT = ("task.time_limit=0.2", "episodes=3", "videos=false", "close_ups=false", "num_threads=1")


def test_who_crashes_is_told_and_the_rest_are_reported(run_here, tmp_path, own_module):
    own_module("own_policies", OWN_POLICIES)
    # with videos and close-ups of those who are left, which the coarsest physics makes cheaper
    short = [argument for argument in SHORT if not argument.endswith("=false")]
    asked = ("policies=[own_policies:broken]", "controllers=[zero]", "folder=out")
    coarse = ("physics=fast", "physics.timestep=0.002", "film=[0]", "drive_map=false")
    result = run_here("evaluate.py", *asked, *coarse, *short)
    assert result.returncode == 1, result.stderr
    assert (
        "warning: broken crashed on flat and is excluded there: ArithmeticError: out of ideas"
        in result.stderr
    )
    assert load_results(tmp_path / "out").episodes["controller"].tolist() == ["zero"] * 3
    assert not (tmp_path / "out" / "parts").exists()


def test_files_of_the_user_stay_in_the_folder_of_the_results(run_here, tmp_path):
    foreign = ["parts/thesis.txt", "figures/mine.svg", "tables/mine.csv", "tables/mine.tex"]
    for name in foreign:
        file = tmp_path / "out" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("a user's")
    for _ in range(2):
        result = run_here("evaluate.py", "controllers=[zero]", "folder=out", *SHORT)
        assert result.returncode == 0, result.stderr
    assert [(tmp_path / "out" / name).read_text() for name in foreign] == ["a user's"] * 4
    assert (tmp_path / "out" / "figures" / "success.svg").exists()
    (tmp_path / "report.html").write_text("a user's")  # is not written over
    result = run_here("evaluate.py", "controllers=[zero]", "folder=.", *SHORT)
    assert result.returncode == 2
    assert "flyrl did not write this file" in result.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"report.html", "out"}


def test_an_interrupted_evaluation_says_how_to_go_on(run_here, tmp_path, own_module):
    own_module("own_policies", OWN_POLICIES)
    arguments = ("controllers=[zero]", "folder=out", *SHORT)
    result = run_here("evaluate.py", "policies=[own_policies:stopped]", *arguments)
    assert result.returncode == 130
    assert "resume with: folder=out\ninterrupted\n" in result.stderr
    assert not (tmp_path / "out" / "results.json").exists()
