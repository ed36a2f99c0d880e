"""The coarse array inside the folder of a render: written, read, removed."""

from dataclasses import replace

from filelock import FileLock
from support import handmade

from framearray_cli.array.coarsearray import COARSE_FOLDER, coarse_folder, read_coarse, remove_left_coarse, write_coarse

PLACES = {"light": [0, 3]}


def test_it_is_there_while_the_block_lasts(tmp_path):
    (tmp_path / "other").write_text("stays")
    with coarse_folder(tmp_path) as folder:
        assert folder == tmp_path / COARSE_FOLDER and read_coarse(tmp_path, "sha256:1") is None
        manifest = handmade.plain(folder, n_c=2, n_l=2, layers=False)
        found = write_coarse(folder, manifest, PLACES)
        assert read_coarse(tmp_path, "sha256:1") == found and found.places == PLACES
        assert read_coarse(tmp_path, "sha256:2") is None, "of another job"
        with coarse_folder(tmp_path) as second:
            assert second is None, "another run has one"
        remove_left_coarse(tmp_path)
        assert read_coarse(tmp_path, "sha256:1") == found, "a run that goes on keeps its own"
        (folder / "sub").mkdir()
        (folder / "sub" / "file").write_text("")
    assert [path.name for path in tmp_path.iterdir()] == ["other"]


def test_what_a_killed_run_left_is_removed(tmp_path):
    folder = tmp_path / COARSE_FOLDER
    manifest = handmade.plain(folder, n_c=2, n_l=2, layers=False)
    write_coarse(folder, manifest, PLACES)
    (folder / "lock").touch()
    assert read_coarse(tmp_path, "sha256:1"), "until then a page may show it"
    with FileLock(folder / "lock"):
        remove_left_coarse(tmp_path)
    assert folder.is_dir()
    remove_left_coarse(tmp_path)
    assert list(tmp_path.iterdir()) == []
    remove_left_coarse(tmp_path)


def test_a_link_is_not_followed(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "file").write_text("stays")
    (tmp_path / COARSE_FOLDER).symlink_to(tmp_path / "elsewhere")
    remove_left_coarse(tmp_path)
    assert (tmp_path / "elsewhere" / "file").read_text() == "stays"


def test_a_damaged_one_is_none(tmp_path):
    folder = tmp_path / COARSE_FOLDER
    manifest = handmade.plain(folder, n_c=2, n_l=2, layers=False)
    for places in ({"light": [0]}, {"lamp": [0, 1]}, {}):
        write_coarse(folder, replace(manifest, summary={}), places)
        assert read_coarse(tmp_path, "sha256:1") is None
    (folder / "manifest.toml").write_text("= nothing")
    assert read_coarse(tmp_path, "sha256:1") is None
