import pytest

from volery.core.errors import DataFileError
from volery.runtime.construction.fleet import add_bodies
from volery.runtime.construction.placement import StartPose
from volery.sensors.imu import ImuModel
from volery.sensors.lidar.beam_file import read_beams
from volery.sensors.lidar.lidar_model import load_lidar
from volery.vehicle.airframe import load_airframe
from volery.vehicle.identified import load_identified


@pytest.fixture
def write(tmp_path):
    def write(name, text):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        return path

    return write


def refusal(path, load=load_lidar):
    with pytest.raises(DataFileError) as caught:
        load(path)
    return str(caught.value)


def test_a_file_changes_only_what_it_says(write):
    path = write(
        "near.toml",
        'base = "vlp_16"\n[range]\nmax_m = 40.0\n[scan]\n'
        "elevation_deg = [-5, 5]\nfiring_offset_s = [0.0, 4e-6]\n",
    )
    shipped, near = load_lidar("vlp_16"), load_lidar(path)
    assert near.range == shipped.range.model_copy(update={"max_m": 40.0})
    assert near.scan.elevation_deg == (-5.0, 5.0)
    assert near.scan.columns == shipped.scan.columns
    assert near.noise == shipped.noise
    assert near.name == "Velodyne VLP-16, changed in near.toml"


def test_files_may_begin_with_a_byte_order_mark(write, tmp_path):
    head = "azimuth_deg,elevation_deg,time_s\n"
    (tmp_path / "beams.csv").write_text(head + "0,0,0\n1,0,0.01\n", encoding="utf-8-sig")
    path = write("table.toml", "")
    text = 'base = "vlp_16"\n[scan]\nkind = "table"\nrate_hz = 10.0\nfile = "beams.csv"\n'
    path.write_text(text, encoding="utf-8-sig")
    assert load_lidar(path).scan.kind == "table"
    assert len(read_beams(tmp_path / "beams.csv", 0.1, 10).ring) == 2


def test_a_table_of_another_kind_replaces_the_whole_table(write):
    planar = (
        'base = "vlp_16"\nname = "Flat"\n[scan]\nkind = "planar"\nbeams = 3\nangle_min_rad = -1.0\n'
        "angle_max_rad = 1.0\nrate_hz = 10.0\nsweep_duration_s = 0.05\n"
    )
    model = load_lidar(write("flat.toml", planar))
    assert (model.name, model.beams) == ("Flat", 3)


def test_bases_may_have_bases(write):
    write("mid.toml", 'base = "vlp_16"\nname = "Mid"\n[range]\nmax_m = 50.0\nmin_m = 0.2\n')
    model = load_lidar(write("top.toml", 'base = "mid.toml"\n[range]\nmax_m = 60.0\n'))
    assert (model.range.min_m, model.range.max_m) == (0.2, 60.0)
    assert model.name == "Mid, changed in top.toml"


def test_airframes_identified_models_and_other_sensors_have_bases_too(write):
    heavy = load_airframe(write("Heavy-lift.toml", 'base = "f450"\n[body]\nmass_kg = 2.4\n'))
    f450 = load_airframe("f450")
    assert heavy.body == f450.body.model_copy(update={"mass_kg": 2.4})
    assert heavy.rotors == f450.rotors
    assert (heavy.name, heavy.title) == (
        "heavy_lift",
        "DJI F450 (OpenUAV), changed in Heavy-lift.toml",
    )
    slow = load_identified(str(write("slow.toml", 'base = "f450"\ndrag_1_s = [0.5, 0.5, 0.5]\n')))
    assert slow.drag_1_s == (0.5, 0.5, 0.5)
    assert slow.source.endswith(", changed in slow.toml")
    imu = ImuModel.load(str(write("imu.toml", 'base = "adis16448"\n')))
    same = ImuModel.load("adis16448").model_dump(exclude={"name"})
    assert imu.model_dump(exclude={"name"}) == same


def test_airframes_of_one_name_keep_their_own_bodies(write):
    big = load_airframe(
        write("big.toml", 'base = "f450"\nname = "f450"\n[body]\nsize_m = [0.5, 0.5, 0.3]\n')
    )

    class Scene:
        def set_bodies(self, shapes, index, *, num_envs):
            self.bodies = [shapes[k] for k in index]

    scene = Scene()
    starts = [
        StartPose(f"uav{k}", "t", airframe, (0, 0, 0), (0, 0, 0, 1), True, False)
        for k, airframe in enumerate((load_airframe("f450"), big, load_airframe("f450")))
    ]
    add_bodies(scene, starts)
    assert scene.bodies[0] is scene.bodies[2]
    assert scene.bodies[0] is not scene.bodies[1]


def test_wrong_keys_are_reported_with_the_files_that_they_may_be_in(write):
    write("mid.toml", 'base = "vlp_16"\n[range]\nmax_m = 50.0\n')
    path = write("top.toml", 'base = "mid.toml"\n[range]\nmaximum_m = 60.0\n')
    assert refusal(path).startswith(
        f"{path} (base 'mid.toml', 'vlp_16.toml'): unknown key 'range.maximum_m'; did you mean"
    )


def test_circles_of_bases_are_refused(write):
    write("a.toml", 'base = "b.toml"\n')
    path = write("b.toml", 'base = "a.toml"\n')
    assert refusal(path).endswith(
        "a.toml: key 'base': the bases form a circle: b.toml -> a.toml -> b.toml"
    )
    itself = write("itself.toml", 'base = "itself.toml"\n')
    assert "form a circle: itself.toml -> itself.toml" in refusal(itself)


def test_long_chains_of_bases_are_refused(write):
    for k in range(20):
        path = write(f"f{k}.toml", f'base = "f{k - 1}.toml"\n' if k else 'base = "vlp_16"\n')
    assert "at most 10 files in a chain" in refusal(path)


@pytest.mark.parametrize(
    ("base", "message"),
    [
        ('"vlp_61"', "no shipped 'vlp_61'; did you mean 'vlp_16'? Allowed: adis16448, "),
        ('"none.toml"', "key 'base': there is no file 'none.toml' in "),
        ("7", "key 'base': a name is needed: adis16448, "),
        ('"inner/mine.toml"', "key 'base': 'inner/mine.toml' lies in another folder"),
        ('"../outside.toml"', "key 'base': '../outside.toml' lies in another folder"),
        ('"/etc/hostname.toml"', "key 'base': '/etc/hostname.toml' lies in another folder"),
        ('"link.toml"', "key 'base': there is no file 'link.toml' in "),
        ('"nul\\u0000.toml"', "key 'base': there is no file"),
        (f'"{"x" * 5000}.toml"', "key 'base': there is no file"),
    ],
)
def test_unknown_bases_and_those_elsewhere_are_refused(write, base, message):
    write("inner/mine.toml", 'base = "vlp_16"\n')
    outside = write("outside.toml", 'base = "vlp_16"\n')
    (outside.parent / "own").mkdir()
    path = write("own/it.toml", f"base = {base}\n")
    (path.parent / "link.toml").symlink_to(outside)
    text = refusal(path)
    assert text.startswith(f"{path}: ")
    assert message in text


def test_files_that_are_no_parts_have_no_base(write):
    from volery.scenario.data_files import load_data_file
    from volery.world.trees import Species

    path = write("tree.toml", 'base = "broadleaf"\n')
    assert "unknown key 'base'" in refusal(path, lambda path: load_data_file(path, Species))
