"""FMUs of the user that do not fit are refused in one sentence before the first step; where their files are."""

import shutil
import zipfile

import pytest
from foreign_drive import H, changed, rig
from foreign_fmus import UNITS

from fmus.vehicles.tables import BadInput
from orchestrator.execution.simulate import simulate
from orchestrator.scene.assembly import assemble
from orchestrator.scene.commented_file import scene_text
from orchestrator.scene.replacement import unfit
from orchestrator.scene.scene import load


def without(*names):
    return lambda each: None if each.name in names else each


def with_unit(name, unit):
    return lambda each: each._replace(unit=unit) if each.name == name else each


def test_what_does_not_fit_is_refused(drive, tmp_path):
    """Scene, key, file and variable are named."""
    whole = {**UNITS, "Nm": UNITS["N.m"]}
    output, out = "sprocket.velocity.x", "output 'sprocket.velocity.x'"
    cases = (
        (without(output), f"it has no {out}, which goes to track.{output}: did you mean 'sprocket.velocity.z'?"),
        (
            lambda each: each._replace(causality="local") if each.name == output else each,
            f"'{output}' is of causality local, but goes to track.{output}: output",
        ),
        (
            lambda each: each._replace(kind="Integer", start=0) if each.name == output else each,
            f"{out} is of type Integer, and a Real is needed",
        ),
        (with_unit("sprocket.torque.y", "N"), "'sprocket.torque.y' has the unit 'N', and 'N.m' is needed"),
        (
            with_unit("sprocket.force.x", "kip"),
            "'sprocket.force.x' has the unit 'kip', which the FMU does not define, and 'N' is needed",
        ),
    )
    for change, sentence in cases:
        fmu = changed(drive, tmp_path / "other.fmu", change, whole)
        with pytest.raises(BadInput) as caught:
            simulate(rig(fmu), tmp_path / "rig.mcap")
        assert str(caught.value).endswith(f": {sentence}")
        assert str(caught.value).startswith("rig.toml: fmu.drive.file = '")
        assert "other.fmu'" in str(caught.value)
        assert not (tmp_path / "rig.mcap").exists()
    scene = rig(changed(drive, tmp_path / "other.fmu", with_unit("sprocket.torque.y", "Nm"), whole))
    assert len(unfit(scene, assemble(scene))) == 1
    scene = rig(changed(drive, tmp_path / "other.fmu", with_unit("sprocket.torque.y", ""), whole))
    assert unfit(scene, assemble(scene))[0] == (
        "drive",
        "the FMU declares no unit of sprocket.torque.y: it is taken to be that of the part",
    )


def test_what_is_no_fmu_for_this_machine_is_refused(drive, tmp_path):
    def packed(name, *files):
        with zipfile.ZipFile(tmp_path / name, "w", zipfile.ZIP_DEFLATED) as archive, zipfile.ZipFile(drive) as source:
            for kept in source.namelist():
                if kept not in dict(files):
                    archive.writestr(kept, source.read(kept))
            for file, content in files:
                if content is not None:
                    archive.writestr(file, content)
        return tmp_path / name

    with zipfile.ZipFile(drive) as source:
        description, (library,) = source.read("modelDescription.xml"), (n for n in source.namelist() if "bin" in n)
    (tmp_path / "text.fmu").write_text("no archive")
    cases = {
        tmp_path / "none.fmu": "there is no FMU ",
        tmp_path / "text.fmu": "is not an FMU: it is not a zip archive",
        packed("3.fmu", ("modelDescription.xml", description.replace(b'"2.0"', b'"3.0"'))): "bad modelDescription.xml",
        packed("bare.fmu", (library, None)): "has no binary for ",
        packed("twice.fmu", ("modelDescription.xml", description.replace(b'"angle"', b'"speed"'))): (
            "has a variable 'speed', and there is another one of that name in its log"
        ),
        packed(
            "deep.fmu", ("a/" * 200 + "x", b"x")
        ): "a file in it has a name of more than 1024 characters or 64 folders",
        packed("up.fmu", ("resources/../../up", b"x")): "it holds a file outside of it, 'resources/../../up'",
        packed(
            "bomb.fmu", *((f"resources/{k}", bytes(1 << 24)) for k in range(4))
        ): "is not unpacked: it unpacks to more",
    }
    for file, sentence in cases.items():
        with pytest.raises(BadInput) as caught:
            simulate(rig(file), tmp_path / "rig.mcap")
        assert str(caught.value).startswith("rig.toml: fmu.drive.file: ")
        assert sentence in str(caught.value)
        assert "\n" not in str(caught.value)
    assert not (tmp_path / "up").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ("--replace", "drve=a.fmu"),
            "fmu.drve: no such part, and no connection names it: did you mean 'drive'?",
        ),
        (
            ("--replace", "x=a.fmu"),
            "fmu.x: no such part, and no connection names it: the parts are track, drive, idler",
        ),
        (("--replace", "drive"), "--replace drive: must be NAME=FMU, the name of a part and a file"),
        (("--set", "fmu.drive.fil=a.fmu"), "rig.toml: unknown key 'fmu.drive.fil': did you mean 'fmu.drive.file'?"),
        (("--replace", "drive=FMU", "--set", "fmu.drive.parameters.torqe=3"), "did you mean 'torque'?"),
        (
            ("--replace", "drive=FMU", "--set", "fmu.drive.parameters.torque='high'"),
            "drive: parameter 'torque' = 'high': must be of type Real",
        ),
        (
            ("--replace", "drive=FMU", "--set", "fmu.drive.parameters.manner=1.5"),
            "drive: parameter 'manner' = 1.5: must be of type Integer",
        ),
        (("--replace", "drive=FMU", "--set", "fmu.drive.parameters.torque=[1]"), "fmu.drive.parameters.torque"),
    ],
)
def test_bad_arguments_are_one_sentence(cotrack, drive, tmp_path, arguments, said):
    shutil.copy(drive, tmp_path / "FMU")
    err = cotrack.refused(
        "run", "rig", "--track", "rigid", "--stop", "2 ms", "--json", "--set", "expect={}", *arguments
    )
    errors = [line for line in err.splitlines() if "cotrack: " in line]
    assert said in errors[-1]
    assert not (tmp_path / "logs").exists()


def test_steps_of_one_length_are_not_varied(drive, tmp_path):
    with zipfile.ZipFile(drive) as source, zipfile.ZipFile(tmp_path / "fixed.fmu", "w") as fixed:
        for name in source.namelist():
            fixed.writestr(name, source.read(name).replace(b'StepSize="true"', b'StepSize="false"'))
    simulate(rig(tmp_path / "fixed.fmu", **{"run.stop": 2 * H}), tmp_path / "rig.mcap")
    variable = {"run.variable": {"tolerance": 1e-3, "estimate": "power"}}
    with pytest.raises(BadInput, match="it takes equal communication steps only"):
        simulate(rig(tmp_path / "fixed.fmu", **variable), tmp_path / "rig.mcap")


# --- files -----------------------------------------------------------------------------------------


def test_a_path_is_relative_to_its_scene_or_to_the_folder(cotrack, drive, tmp_path):
    text = scene_text("rig").replace("# [fmu]", "[fmu]")
    (tmp_path / "far").mkdir()
    assert "# file: text: FMU for co-simulation" in text
    (tmp_path / "far" / "own.toml").write_text(text + '[fmu.drive]\nfile = "MyDrive.fmu"\n')
    assert load(str(tmp_path / "far" / "own.toml")).fmu["drive"].file == str(tmp_path / "far" / "MyDrive.fmu")
    assert load("rig", None, ["fmu.drive.file=MyDrive.fmu"]).fmu["drive"].file == str(tmp_path / "MyDrive.fmu")
    again = scene_text(str(tmp_path / "far" / "own.toml"))
    (tmp_path / "again.toml").write_text(again)
    assert load("again.toml").fmu["drive"].file == str(tmp_path / "far" / "MyDrive.fmu")


def test_show_names_the_fmu(cotrack, drive):
    out = cotrack.done("show", "rig", "--track", "rigid", "--set", f"fmu.drive.file={drive}")
    assert f"  drive        FMU           {drive}; 6 values in, 13 out a step\n" in out
