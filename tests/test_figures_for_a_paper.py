import re
import struct
import zlib
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

import screwgauge
from support.errors import OutputError

pytestmark = pytest.mark.slow
WIDTH = 8.5 / 2.54 * 72.0  # [pt]


@pytest.fixture(scope="module")
def results() -> screwgauge.Results:
    scene = screwgauge.load_scene("3ups-upu-s").at(np.linspace(0.0, 5.0, 40))
    chosen = tuple(each for each in scene.figures if each.quantity in ("actuator_force", "joint_position"))
    return screwgauge.run(replace(scene, figures=chosen), ["screw", "pinocchio"], ["actuator_force", "joint_position"])


@pytest.mark.parametrize("name", ["actuator_force", "condition", "mechanism"])
def test_files_have_the_width_that_is_asked_for(name, results, tmp_path):
    figure = results.figure(name)
    pdf = figure.save(tmp_path / "f.pdf", width="8.5cm", font="Times", size=8).read_bytes()
    (box,) = re.findall(rb"/MediaBox ?\[0 0 ([\d.]+) ", pdf)
    assert float(box) == pytest.approx(WIDTH, abs=0.01)
    assert b"/BaseFont" in pdf
    png = figure.save(tmp_path / "f.png", width="85mm", dpi=300).read_bytes()
    assert abs(struct.unpack(">I", png[16:20])[0] - 8.5 / 2.54 * 300) <= 1.0
    svg = ElementTree.parse(figure.save(tmp_path / "f.svg", width=f"{8.5 / 2.54:.6f}in")).getroot()
    assert float(svg.get("width").removesuffix("pt")) == pytest.approx(WIDTH, abs=0.01)


def test_a_chart_fits_its_width_with_letters_of_the_size_and_font_of_the_text(results, tmp_path):
    for picture in results.plot()[1:]:
        picture.save(file := tmp_path / f"{picture.name}.svg", width="8.5cm", font="Times", size=9.0)
        svg = ElementTree.parse(file).getroot()
        texts = [node for node in svg.iter() if node.tag.endswith("text")]
        assert {node.get("font-family").split(",")[0] for node in texts} == {"Times"}
        assert {node.get("font-size") for node in texts} == {"9px"}
        box = [float(number) for number in svg.get("viewBox").split()]
        assert box[2] == pytest.approx(WIDTH, abs=3.0)  # so that nothing is scaled


def test_curves_stand_alone(results, tmp_path):
    (picture,) = results.figure("actuator_force")
    svg = ElementTree.parse(picture.save(tmp_path / "f.svg")).getroot()
    said = {"".join(node.itertext()) for node in svg.iter() if node.tag.endswith("text")}
    assert {*results.components("actuator_force"), "t [s]", "actuator force [N]"} <= said
    whole = picture.svg
    for other in (picture.title, "pinocchio", "tolerance", "difference"):
        assert other in whole
        assert not any(other in text for text in said)
    marks = "mark-symbol role-mark"
    assert marks in whole
    assert not [node for node in svg.iter() if marks in node.get("class", "")]


def test_it_shows_itself_in_a_line(results):
    for picture in results.plot():
        assert len(repr(picture)) < 200
        assert picture.title in repr(picture)


def test_several_figures_are_no_file(results, tmp_path):
    figures = results.figure("joint_position")
    assert len(figures) > 1
    with pytest.raises(screwgauge.ScrewgaugeError, match=re.escape(f"figure('{figures[1].name}')")):
        figures.save(tmp_path / "f.pdf")
    figures[1].save(tmp_path / "f.pdf")


@pytest.mark.parametrize(
    ("style", "said"),
    [
        ({"width": "8.5"}, "'8.5' is not a width"),
        ({"width": "9km"}, "'9km' is not a width"),
        ({"width": 8}, "8 is not a width"),
        ({"width": "900cm"}, "is not a width"),
        ({"font": "No Such Font"}, "'No Such Font' is not installed"),
        ({"font": 'a"/><script/>'}, "is not installed"),
        ({"size": 0.0}, "font size 0.0 pt"),
        ({"dpi": 10**9}, "1000000000 dpi"),
    ],
)
def test_what_cannot_be_drawn_is_refused(style, said, results, tmp_path):
    with pytest.raises(screwgauge.ScrewgaugeError, match=re.escape(said)):
        results.figure("actuator_force").save(tmp_path / "f.pdf", **style)
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize("ending", ["pdf", "png", "svg"])
def test_a_figure_that_nobody_changed_is_saved_again(ending, results, tmp_path):
    figure = results.figure("mechanism")
    first = figure.save(file := tmp_path / f"f.{ending}").read_bytes()
    assert figure.save(file, width="10cm").read_bytes() != first
    for other in (first.replace(first[40:44], b"abcd", 1), first + b"\n", first[:-1]):
        file.write_bytes(other)
        with pytest.raises(OutputError, match="force=True"):
            figure.save(file)
        assert file.read_bytes() == other
    assert [*tmp_path.iterdir()] == [file]


def test_a_png_stays_a_png(results, tmp_path):
    data = results.figure("mechanism").save(tmp_path / "f.png").read_bytes()
    kinds, at = list[bytes](), 8
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        chunk, (checksum,) = (
            data[at + 4 : at + 8 + length],
            struct.unpack(">I", data[at + 8 + length : at + 12 + length]),
        )
        assert zlib.crc32(chunk) == checksum
        kinds.append(chunk[:4])
        at += 12 + length
    assert kinds[-2:] == [b"tEXt", b"IEND"]


def test_a_file_of_one_s_own_stays(results, tmp_path):
    figure = results.figure("actuator_force")
    with pytest.raises(screwgauge.ScrewgaugeError, match=r"f\.jpg"):
        figure.save(tmp_path / "f.jpg")
    figure.save(tmp_path / "f.svg")
    figure.save(tmp_path / "f.svg", width="10cm")  # as it was written here
    (mine := tmp_path / "mine.svg").write_text("<svg/>", encoding="utf-8")
    with pytest.raises(OutputError, match="already exists"):
        figure.save(mine)
    figure.save(mine, force=True)
