import pytest

from flyrl.policies import PolicyFileError, load_policy, named_policies, save_bundle
from flyrl.policies.library import policies_folder, policy_name
from flyrl.resources import assets_folder


def test_names_are_those_of_the_files():
    files = {path.stem for path in policies_folder().glob("*.safetensors")}
    assert list(named_policies()) == sorted(files)
    assert policies_folder() == assets_folder() / "policies"


def test_an_unknown_name_lists_what_there_is():
    with pytest.raises(PolicyFileError) as error:
        load_policy("targt-flat")
    assert str(error.value) == (
        "no policy at targt-flat: there is no such file or folder, and no policy of that name; "
        f"names: {', '.join(named_policies()) or 'none'}"
    )


def test_a_file_of_one_s_own_has_no_name(bundle, tmp_path):
    save_bundle(bundle, tmp_path / "mine.safetensors")
    assert policy_name(tmp_path / "mine.safetensors") is None
