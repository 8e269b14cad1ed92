# SPDX-License-Identifier: Apache-2.0
"""Wrong words after every verb: one line that names what was typed, a status, nothing written."""

import re
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow
WITHOUT_OUT = ("bench", "config", "live", "render", "report")

WRONG = [
    ("--foo", "No such option: --foo. What there is: mobilia --help"),
    ("nosuch", "No such command 'nosuch'. What there is: mobilia --help"),
    ("demo --scene ofice", "Did you mean 'office'"),
    ("demo --dynamism 2", "dynamism must be a number from 0 to 1, got 2.0"),
    ("demo --seconds -3", "--seconds must be > 0 and finite, got -3.0"),
    ("demo --scan-height 9", "--scan-height must be a number from"),
    ("demo --seed -1", "--seed must be a whole number >= 0, got -1"),
    ("demo --plan --seconds -1", "--seconds must be > 0 and finite, got -1.0"),
    ("run odometry --scene arena --laser utm30", "--scanner says which scanner. Did you mean 'utm"),
    ("run odometry --scene arena --seed=1.5", "--seed must be a whole number, got '1.5'"),
    ("run shunting --scene arena --set matching.reward=x", "--set: reward must be a number, got"),
    ("run odometry --log .", ".: is a folder, not a regular file"),
    ("run", "Missing argument 'SLAM...'. What there is: mobilia run --help"),
    ("run shunting", "exactly one of --log, --scene and --recipe"),
    ("run shunting --log missing.log", "missing.log: no such file"),
    ("run shunting --log '[red]gone[/red].log'", "[red]gone[/red].log: no such file"),
    ("run shuntin --scene arena", "Did you mean 'shunting'"),
    ("run no_module:Slam --scene arena", "cannot import 'no_module'"),
    ("run odometry --oracle shuntin --scene arena", "Did you mean 'shunting'"),
    ("run odometry --oracle ekf,often --scene arena", "movable or moving"),
    ("run odometry --scene arena --strict", "are about a --log"),
    ("run odometry --scene arena --format rover.toml", "are about a --log"),
    ("run shunting --scene arena --map-out m.npz", "--map-in, --map-out and --at are about"),
    ("generate office --seconds -3", "--seconds must be a number > 0 and <= 86400, got -3.0"),
    ("generate office --episodes 0", "--episodes must be a whole number from 1"),
    ("generate arena --jobs 0", "--jobs must be 1"),
    ("generate arena --dynamism 0:1:0", "step > 0"),
    ("generate arena --dynamism 1.5", "dynamism must be a number from"),
    ("generate arena --split train", "--split must be names with numbers"),
    ("generate arena --split train:1,train:2", "--split must be names with numbers"),
    ("generate arena --split train:1 --episodes 3", "leave --episodes out"),
    ("generate arena --split train:2 --sessions 2", "--sessions are of one building"),
    ("generate arena arena", "scene must be different"),
    ("generate arena --also-at 0,0,400", "--also-at[0].yaw_deg must be a number from -180 to 180"),
    ("generate arenas", "Did you mean 'arena'"),
    ("generate arena --scanner lidar", "Did you mean 'rplidar_a1'"),
    ("generate arena --dynamism 0 1 --motion 0.2 --change 0.1", "all levels are the same"),
    ("compare --slam odometry --seconds -3", "--seconds must be a number > 0"),
    ("compare --slam odometry odometry", "--slam must be one or more, each once"),
    ("compare --slam odometry --every 0", "--every must be 1 to 1000, got 0"),
    ("compare --slam odometry --scan-limit -3", "--scan-limit must be a finite number > 0"),
    ("compare --slam odometry --sessions 3", "--sessions needs a share of things"),
    ("compare --slam odometry --change 0.3 --sessions 1", "--sessions must be 2 to 50, got 1"),
    ("compare --slam odometry --first-seed -5", "--first-seed must be a whole number >= 0, got -5"),
    ("compare --slam shuntin", "Did you mean 'shunting'"),
    ("compare --slam odometry --scanner rplidar_a2", "Did you mean 'rplidar_a1'"),
    ("compare --slam odometry --dynamism 2", "from 0 to 1, got 2.0"),
    ("compare --slam odometry --people 81", "--people must be"),
    ("compare --slam odometry --motion 0 1 --change 0 1", "--motion and --change"),
    ("compare --slam odometry --dynamism 0.5 --motion 0 1", "--dynamism sets both"),
    ("compare --slam odometry --seconds 0.1", "needs 2 scans a run"),
    ("benchmark --slam odometry --days --seconds 40000", "--seconds must be at most 28800"),
    ("benchmark --tracks nowhere", "no track is called 'nowhere'"),
    ("benchmark --seeds 21", "--seeds must be 1 to 20"),
    ("benchmark --slam odometri", "Did you mean 'odometry'?"),
    ("benchmark --submit a/b", "up to 40 letters"),
    ("benchmark --slam ekf --submit karto", "the name of another SLAM"),
    ("benchmark --merge nothing.json", "nothing.json: no such file"),
    ("drive arena --slam odometry --seconds -3", "--seconds must lie in [1e-06, 10000.0]"),
    ("drive arena --slam odometry --seeds many", "--seeds must be"),
    ("drive arena --slam odometry --goals 0", "--goals must be"),
    ("drive arena --slam odometry --goals cellar table", "no goal 'cellar'"),
    ("drive arena --slam ,", "--slam must"),
    ("tune karto --track tour-guide", "Missing option '--space'"),
    ("tune karto --space no.toml --track tour-gide", "Did you mean 'tour-guide'?"),
    ("tune karto --space no.toml --track tour-guide", "no.toml: no such file"),
    ("blame", "name exactly one of RUN and --scene"),
    ("blame nowhere", "nowhere: no such folder"),
    ("run odometry --recipe nowhere", "nowhere: no such folder"),
    ("run odometry --recipe . --seconds 3", "--recipe says which tour it is"),
    ("shrink", "Missing argument 'RUN'"),
    ("shrink nowhere", "nowhere: no such folder"),
    ("blame --scene arena --threshold -3", "--threshold must be a finite number > 0"),
    ("blame --scene arena --every 0", "--every must be a whole number >= 1"),
    ("blame --scene arena --horizon -1", "--horizon must be > 0 s"),
    ("blame --scene arena --top -1", "--top must be a whole number >= 0"),
    ("blame --scene arena --option walls", "--option must be NAME=VALUE"),
    ("blame --scene arena --option wall=no", "cannot take these options"),
    ("blame --scene arena --seconds 1 --at 7", "--at must lie in"),
    ("lifelong", "name exactly one of FOLDER and --scene"),
    ("lifelong no-such", "no-such: no such folder"),
    ("lifelong .", "holds no sessions"),
    ("lifelong --scene arena --slam ,", "--slam must name at least one SLAM"),
    ("lifelong --scene arena --sessions 1", "--sessions must be 2 to 50, got 1"),
    ("lifelong --scene arena --first-seconds 0", "--first-seconds must be > 0 and at most"),
    ("live", "name exactly one of a scene, --log and --bag"),
    ("live arena --log x.log", "name exactly one of a scene, --log and --bag"),
    ("live arena --port 70000", "--port must lie in 0..65535, got 70000"),
    ("live arena --port 99999999", "--port must lie in 0..65535, got 99999999"),
    ("live --scene arena", "No such option: --scene"),
    ("live arena --speed 1000", "--speed must lie in [0.05, 20], got 1000"),
    ("export none.mcap --to minari", "mobilia generate SCENE --format minari"),
    ("export none.mcap --to hdf5", "--to must be one of mcap, db3, parquet, npz, carmen, tum,"),
    ("generate arena --format hdf5", "--format must be one of mcap, db3, parquet, npz, carmen,"),
    ("bench --against --page nosuch/x.md", "nosuch/x.md: no such file: it must have the place"),
    ("bench --json .", "--json must be a file, got folder ."),
    ("export none.mcap --to carmen --out .", "--out must be a file, got folder ."),
    ("render absent", "absent: no such file"),
    ("report no", "no such folder: mobilia compare"),
    ("sensor-card --scanner full", "a whole model, one of lms221, "),
    ("sensor-card --scanner scanner", "'scanner' has no data sheet"),
    ("sensor-card --scanner tim562", "Did you mean 'tim561'"),
    ("config yag-slam", "'yag-slam' has no numbers to set. These have: ekf, "),
    ("config shuntin", "no numbers to set. Did you mean 'shunting'"),
    ("config shunting matchin.local", "Did you mean 'matching.local'"),
    ("config shunting{rewrad=7}", "Did you mean 'reward'"),
]


@pytest.mark.parametrize(("line", "says"), WRONG)
def test_wrong_words_are_one_line_that_names_them(tmp_path: Path, monkeypatch, called, line, says):
    monkeypatch.chdir(tmp_path)
    verb, *words = re.sub(r"'(.*)'", lambda quoted: quoted[1].replace(" ", "\0"), line).split()
    out = () if verb in WITHOUT_OUT or "--out" in words else ("--out", tmp_path / "out")
    done = called(verb, *(word.replace("\0", " ") for word in words), *out)
    assert done.returncode == (1 if line.endswith(("lifelong .", "--log .")) else 2)  # is there
    assert "Ahead" not in done.stdout
    assert says in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not re.search(r"\b[A-Z]\w+\.[a-z]", done.stderr)  # no field of ours
    assert list(tmp_path.iterdir()) == []


def test_a_file_here_is_found_before_a_name_like_it(tmp_path: Path, monkeypatch, called):
    monkeypatch.chdir(tmp_path)
    slam = "class MySlam:\n    def update(self, frame): ...\n"
    (tmp_path / "my_slam.py").write_text(f"1 / 0\n{slam}class Other(EkfSlam): ...\nclass No: ...\n")
    meant = "Did you mean 'my_slam:MySlam' or 'my_slam:Other'?"
    for name in ("my_slam", "my_slam.py", "./my_slam.py", "my_slam.MySlam"):
        assert meant in called("run", name, "--scene", "arena").stderr
    (tmp_path / "my_slam.py").write_text(slam)
    for name in ("my_slam:MySlm", "my_slam.py:MySlam"):
        done = called("run", name, "--scene", "arena", "--plan")
        assert "Did you mean 'my_slam:MySlam'?" in done.stderr


def test_an_earlier_run_is_told_before_what_is_ahead(tmp_path: Path, monkeypatch, called):
    monkeypatch.chdir(tmp_path)
    ours, file = tmp_path / "mine", tmp_path / "notes.txt"
    ours.mkdir()
    (ours / "recipe.json").write_text('{"command": "run", "settings": {}}')
    (ours / "trajectory_ekf.tum").touch()
    file.write_text("hi")
    for line in ("compare --slam odometry", "drive arena --slam odometry", "generate arena",
                 "benchmark --slam odometry", "lifelong --scene arena", "demo"):  # fmt: skip
        for out, says in ((ours, "choose another --out"), (file, "is a file; --out needs a fol")):
            done = called(*line.split(), "--plan", "--out", out)
            assert (done.returncode, done.stdout) == (1, "")
            assert says in done.stderr
    for line in ("export mine --to tum", "run ekf --log mine"):
        assert "has its poses as TUM: trajectory_ekf.tum." in called(*line.split()).stderr
    said = called("export", "nosuch", "--to", "tum", "--out", "notes.txt/x").stderr
    assert "cannot write notes.txt/x: " in said
    assert "notes.txt is no folder" in said
