"""Shapes of results: found again, refused where they are not; pictures, pages, files."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from base64 import b64decode
from dataclasses import replace

import meshio
import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
import pyuff
from conftest import COARSE
from study_runs import command, solved
from study_texts import study_text

from squealstudy.engine import mode_shapes as engine_shapes
from squealstudy.engine.cache import is_whole, prepared_path
from squealstudy.engine.journal import JOURNAL
from squealstudy.engine.manifest_file import read_manifest
from squealstudy.engine.mode_names import track_names
from squealstudy.engine.result_names import MANIFEST
from squealstudy.engine.results import Results
from squealstudy.engine.track_names import FILE, keep_track_names
from squealstudy.errors import ModelError, ResultsError
from squealstudy.kernels.raster import corner_normals, draw_triangles
from squealstudy.shapes.files import write_uff, write_vtu
from squealstudy.shapes.names import name_of
from squealstudy.shapes.page import page
from squealstudy.shapes.picture import draw, exploded_shifts, title
from squealstudy.shapes.surface import Camera

pytestmark = pytest.mark.usefixtures("tiny_brake", "assembled_once")
STUDY = f"""
[study]
name = "shown"
kind = "complex_modes"
[model]
name = "disc_brake"
mesh = "{COARSE["mesh"]}"
contact_points = {COARSE["contact_points"]}
[[sweep]]
parameter = "friction"
values = [0.1, 0.6]
[[sweep]]
parameter = "caliper.modes[7].frequency_scale"
values = [1.0, 1.1]
[modes]
band = [500.0, 4000.0]
reference_points = 0
[reduction]
enrichment = false
"""
MINIMAL = (
    study_text("minimal", "complex_modes", "hulten")
    + """\
[[sweep]]
parameter = "friction"
values = [0.1, 0.5]
"""
)
CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), ""
)


@pytest.fixture(scope="module")
def results(tmp_path_factory, tiny_brake, assembled_once):
    return solved(STUDY, tmp_path_factory.mktemp("shown") / "results")


@pytest.fixture(scope="module")
def shape(results):
    return results.shape()


# -- of results ---------------------------------------------------------------------------------
def test_shape_is_that_of_the_table(results):
    for row in (0, len(results.points) - 1):  # neither and both of the parameters changed
        point_id = results.points["point_id"].iloc[row]
        own = results.modes[results.modes["point_id"] == point_id]
        for _, mode in own[~own["overdamped"]].iloc[::40].iterrows():
            shape = results.shape(row, int(mode["mode"]))
            assert shape.label.point_id == point_id
            assert shape.label.values["friction"] == results.points["friction"].iloc[row]  # noqa: PD011
            assert shape.frequency_hz == pytest.approx(mode["frequency_hz"], rel=1e-9)
            assert shape.growth_rate == pytest.approx(mode["growth_rate"], abs=1e-5)
            for name, share in shape.energies.items():
                assert share == pytest.approx(mode[f"energy_{name}"], abs=1e-6)


def test_by_default_it_is_the_mode_that_grows_fastest(results, shape):
    worst = results.modes.loc[results.modes["growth_rate"].idxmax()]
    assert (shape.label.point_id, shape.label.mode) == (worst["point_id"], worst["mode"])
    assert shape.label.track == worst["track"]
    again = results.shape(track=int(worst["track"]))
    assert again.label == shape.label
    first, beside = title(shape)[:2]
    assert f", T{worst['track']}: " in first
    assert f"mode {worst['mode']} of this point" in beside
    assert "grows fastest" not in beside  # it does so here


def test_energy_of_a_changed_component_mode_has_no_place_in_its_cells(results):
    """What the change of its frequency adds stands in the component's share alone."""
    scale = "caliper.modes[7].frequency_scale"
    rows = results.points.index[(results.points[scale] == 1.1)]
    shape = results.shape(int(rows[-1]))
    caliper = next(part for part in shape.parts if part.name == "caliper")
    assert caliper.cell_energy.sum() < shape.energies["caliper"] * (1 - 1e-5)
    disc = shape.parts[0]
    assert disc.cell_energy.sum() == pytest.approx(shape.energies["disc"], rel=1e-6)


@pytest.mark.full_size  # by default: test_store.py
def test_what_the_cache_has_lost_is_made_again(results, shape, tmp_path, monkeypatch):
    """The reduced model and the basis together: coordinates of two reductions may differ."""
    key = engine_shapes.plan_of(results).tasks[0].structure
    assert is_whole(prepared_path(key) / engine_shapes.EXPANSION)
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path))  # others read the session's
    assert not prepared_path(key).exists()
    monkeypatch.setattr(engine_shapes, "_last", {})
    told = []
    engine_shapes.expansion(
        engine_shapes.plan_of(results), 0, lambda stage, done, total: told.append(stage)
    )
    found = results.shape(shape.label.row, shape.label.mode).displacement
    assert np.abs(found - shape.displacement).max() < 1e-6
    assert set(told) == {"reduction for shapes: the cache holds none of this version"}


def with_modes(results, **changes):
    return results.with_tables(modes=results.modes.assign(**changes))


def test_modes_that_are_not_found_again_are_refused(results, shape, monkeypatch):
    monkeypatch.setattr(engine_shapes, "_last", {})
    other = with_modes(results, frequency_hz=results.modes["frequency_hz"] * 1.0001)
    with pytest.raises(ResultsError, match="run the study again"):
        other.shape(shape.label.row, shape.label.mode)
    monkeypatch.setattr(engine_shapes, "_last", {})
    rough = with_modes(other, error_rung=np.abs(results.modes["frequency_hz"]) * 1e-3)
    found = rough.shape(shape.label.row, shape.label.mode)
    assert found.frequency_hz == pytest.approx(shape.frequency_hz)
    monkeypatch.setattr(engine_shapes, "_last", {})


@pytest.mark.parametrize(
    ("asked", "text"),
    [
        ({"mode": 3}, "name it beside the mode"),
        ({"point": 9}, "no design point 9"),
        ({"point": "no"}, "no design point 'no'"),
        ({"point": 0, "mode": 999}, "has no mode 999"),
        ({"point": 0, "track": 999}, "no mode of track 999"),
    ],
)
def test_what_is_not_there(results, asked, text):
    with pytest.raises(ResultsError, match=text):
        results.shape(**asked)


def test_points_that_failed_and_overdamped_modes(results):
    first = results.points["point_id"].iloc[0]
    points = results.points.assign(
        status=["failed", "ok", "ok", "ok"], message=["no equilibrium", "", "", ""]
    )
    gone = results.modes[results.modes["point_id"] != first]
    with pytest.raises(ResultsError, match=r"has no modes: failed: no equilibrium"):
        results.with_tables(points=points, modes=gone).shape(0)
    with pytest.raises(ResultsError, match="mode 2 of design point 0 is overdamped"):
        with_modes(results, overdamped=results.modes["mode"] == 2).shape(0, 2)
    with pytest.raises(ResultsError, match="design point 0 has nothing that oscillates"):
        with_modes(results, overdamped=results.modes["point_id"] == first).shape(0)
    own = results.modes[results.modes["point_id"] == first].set_index("mode")["track"]
    other = next(track for track in own if track not in (own[1], -1))
    with pytest.raises(ResultsError, match=f"mode 1 of design point 0 is not of track {other}"):
        results.shape(0, 1, other)  # it was told to be overdamped


def test_results_without_a_mesh(tmp_path):
    minimal = solved(MINIMAL, tmp_path / "results")
    with pytest.raises(ResultsError, match="hulten has no mesh"):
        minimal.shape(0)


def test_results_of_another_kind(results):
    other = Results(results.directory, results.manifest | {"kind": "method_stability"})
    with pytest.raises(ResultsError, match="of kind method_stability"):
        other.shape(0)


# -- pictures -----------------------------------------------------------------------------------
def raster(corners, rows=20, columns=20, lines=False):
    """A picture of triangles whose value is their number."""
    corners = np.array(corners, dtype=float)
    n = len(corners)
    values = np.repeat(np.arange(n, dtype=float)[:, None], 3, axis=1)
    depth = np.full((rows, columns), np.inf)
    value, light = (np.full((rows, columns), np.nan) for _ in range(2))
    edges = np.full((n, 3), lines)
    draw_triangles(corners, values, np.ones((n, 3)), edges, 0.6, depth, value, light)
    return depth, value, light


def test_triangles_cover_the_pixels_whose_centres_they_hold():
    depth, value, light = raster([[(0, 0, 1), (10, 0, 1), (0, 10, 1)]])
    x, y = np.meshgrid(np.arange(20) + 0.5, np.arange(20) + 0.5)
    inside = x + y <= 10
    assert (np.isfinite(value) == inside).all()
    assert depth[inside] == pytest.approx(1.0)
    assert light[inside] == pytest.approx(1.0)


def test_the_nearer_triangle_is_seen_whatever_the_order():
    near = [(0, 0, 1), (20, 0, 1), (0, 20, 1)]
    tilted = [(0, 0, 0.01), (20, 0, 2), (0, 20, 2)]
    _, first, _ = raster([near, tilted])
    _, second, _ = raster([tilted, near])
    seen = np.isfinite(first)
    assert first[seen] == pytest.approx(1 - second[seen], abs=1e-12)
    assert set(np.round(first[seen], 9)) == {0.0, 1.0}


def test_lines_and_what_is_beyond_the_picture():
    _, value, light = raster([[(-30, -30, 1), (50, -30, 1), (-30, 50, 1)]], lines=True)
    assert np.isfinite(value[:9, :9]).all()
    assert (light[:9, :9] > 0).all()  # its edges are outside
    assert (raster([[(2, 2, 1), (18, 2, 1), (2, 18, 1)]], lines=True)[2][2, 3:16] < 0).all()
    for degenerate in ([(0, 0, 1), (5, 5, 1), (10, 10, 1)], [(np.nan, 0, 1), (9, 0, 1), (0, 9, 1)]):
        assert not np.isfinite(raster([degenerate])[1]).any()


def test_normals_are_smooth_but_not_over_edges():
    n = 40
    angle = 2 * np.pi * np.arange(n) / n
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.vstack([np.column_stack([ring, np.full(n, z)]) for z in (0.0, 1.0)] + [[(0, 0, 1)]])
    i, j = np.arange(n), np.roll(np.arange(n), -1)
    side = np.vstack([np.column_stack([i, j, j + n]), np.column_stack([i, j + n, i + n])])
    lid = np.column_stack([i + n, j + n, np.full(n, 2 * n)])
    nodes = np.vstack([side, lid])
    a, b, c = (points[nodes[:, k]] for k in range(3))
    users = np.argsort(nodes.ravel(), kind="stable") // 3
    starts = np.append(0, np.cumsum(np.bincount(nodes.ravel())))
    found = corner_normals(nodes, np.cross(b - a, c - a), starts, users, np.cos(np.radians(40)))
    radial = points[side] * [1, 1, 0]
    assert np.abs(found[: 2 * n] - radial).max() < 0.06
    assert found[2 * n :] == pytest.approx(np.broadcast_to([0, 0, 1], (n, 3, 3)))


def test_camera_looks_from_where_it_is():
    camera = Camera.at(30.0, 20.0)
    assert camera.seen(camera.back) == pytest.approx([0, 0, 1])
    axes = np.stack([camera.right, camera.up, camera.back])
    assert axes @ axes.T == pytest.approx(np.eye(3))
    assert camera.up[2] > 0
    assert np.cross(camera.right, camera.up) == pytest.approx(camera.back)


def test_picture_shows_the_mode(shape, tmp_path):
    figure = draw(shape)
    text = figure.get_suptitle()
    assert f"{shape.frequency_hz:.1f} Hz" in text
    assert "friction at inner pad" in text
    renders = [
        a.images[0].get_array() for a in figure.findobj(lambda a: bool(getattr(a, "images", 0)))
    ]
    assert len(renders) == 2
    for image in renders:
        covered = image[..., 3] > 0.5
        assert 0.15 < covered.mean() < 0.9
        assert np.ptp(image[covered][:, :3], axis=0).min() > 0.2
    labels = {axes.get_xlabel() for axes in figure.findobj(lambda a: hasattr(a, "get_xlabel"))}
    assert {"pressure amplitude [MPa/um]", "slip amplitude [um/um]"} <= labels


def test_parts_that_are_drawn_apart_do_not_touch(shape):
    shift = exploded_shifts(shape)
    boxes = [(shape.coordinates[p.nodes] + s) for p, s in zip(shape.parts, shift, strict=True)]
    low, high = (np.array([f(b, axis=0) for b in boxes]) for f in (np.min, np.max))
    names = [p.name for p in shape.parts]
    disc, inner, outer, caliper = (
        names.index(n) for n in ("disc", "inner_pad", "outer_pad", "caliper")
    )
    assert low[outer, 2] > high[disc, 2]
    assert high[inner, 2] < low[outer, 2]
    assert low[caliper, 0] > high[outer, 0]


def test_shapes_without_cells_are_not_drawn(shape, tmp_path):
    bare = replace(
        shape, parts=tuple(replace(p, facets=p.facets[:0], blocks=()) for p in shape.parts)
    )
    for write in (draw, lambda s: page([s]), lambda s: write_uff(s, tmp_path / "a.uff")):
        with pytest.raises(ModelError, match="no component of this model has cells"):
            write(bare)


# -- the page -----------------------------------------------------------------------------------
def content(text):
    return json.loads(
        re.search(r'<script id="data" type="application/json">(.*?)</script>', text)[1]
    )


def array(text, kind, width):
    return np.frombuffer(b64decode(text), dtype=kind).reshape(-1, width)


def test_page_holds_the_modes(results, shape):
    row = shape.label.row
    others = [results.shape(row, n) for n in (2, 5)]
    text = page([shape, *others])
    assert len(text) < 1e6
    assert not re.search(r"https?:|src=|@import|<link", text)
    data = content(text)
    places = array(data["places"], "<i2", 3) * data["grain"]
    nodes = array(data["triangles"], "<u4", 3)
    assert nodes.max() == len(places) - 1
    total = 0.0
    for part in data["parts"]:
        start, count = part["triangles"]
        own = nodes[start // 3 : (start + count) // 3]
        a, b, c = (places[own[:, k]] for k in range(3))
        total += np.einsum("ij,ij->", np.cross(a, b), c) / 6
    assert total == pytest.approx(sum(p.volumes.sum() for p in shape.parts), rel=1e-2)
    assert [m["name"].split(":")[0] for m in data["modes"]] == [
        f"T{s.label.track}" for s in (shape, *others)
    ]
    facets = np.concatenate([p.facets for p in shape.parts])
    used = np.unique(facets[facets >= 0])
    for mode, made in zip(data["modes"], (shape, *others), strict=True):
        u = (array(mode["real"], "<i2", 3) + 1j * array(mode["imag"], "<i2", 3)) / 32767
        assert np.abs(u[: len(used)] - made.displacement[used]).max() < 1e-4
        assert len(b64decode(mode["energy"])) == len(u)


def test_page_holds_one_design_point_and_no_markup_of_names(results, shape):
    label = replace(shape.label, study="</script><b>x</b>")
    assert "</script><b>" not in page([replace(shape, label=label)])
    with pytest.raises(ModelError, match="one design point"):
        page([shape, replace(shape, label=replace(shape.label, point_id="other"))])


@pytest.mark.skipif(not CHROMIUM, reason="THE PAGE IS NOT DRAWN: no Chromium here")
def test_page_draws_in_a_browser(shape, tmp_path):
    path = tmp_path / "page.html"
    path.write_text(page([shape]), encoding="utf-8")
    options = (
        "--headless --no-sandbox --use-gl=angle --use-angle=swiftshader "
        "--enable-unsafe-swiftshader --window-size=900,700 --dump-dom"
    )
    for budget in (2_000, 20_000):  # of virtual time, which may end before a busy core has drawn
        profile = f"--user-data-dir={tmp_path / f'profile_{budget}'}"
        limits = [profile, f"--virtual-time-budget={budget}"]
        done = subprocess.run(
            [CHROMIUM, *options.split(), *limits, f"{path.as_uri()}#count"],
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        found = re.search(r'<body data-drawn="(\d+)" data-fault="(\d+)"', done.stdout)
        if found:
            break
    assert found, done.stderr[-2000:]
    assert int(found[1]) > 20_000
    assert found[2] == "0"


# -- files --------------------------------------------------------------------------------------
def test_vtu_is_read_back(shape, tmp_path):
    still, contact, collection = write_vtu(shape, tmp_path / "a.vtu")
    mesh = meshio.read(still)
    assert mesh.points == pytest.approx(shape.coordinates)
    u = mesh.point_data["real"] + 1j * mesh.point_data["imag"]
    assert np.abs(u - shape.displacement).max() < 1e-12
    assert sum(np.sum(x) for x in mesh.cell_data["share_of_elastic_energy"]) == pytest.approx(
        1 - shape.energies["interfaces"], abs=1e-4
    )
    assert {block.type for block in mesh.cells} == {"hexahedron20"}
    points = meshio.read(contact)
    assert points.point_data["static_pressure"] == pytest.approx(shape.contact.static_pressure)
    names = re.findall(r'timestep="([\d.]+)" file="([^"]+)"', collection.read_text())
    assert len(names) == 24
    time, name = names[6]
    moved = meshio.read(tmp_path / name).point_data["displacement"]
    assert moved == pytest.approx(shape.at(2 * np.pi * float(time)), abs=1e-12)


def test_uff_is_read_back(shape, tmp_path):
    (path,) = write_uff(shape, tmp_path / "a.uff")
    write_uff(shape, path)  # writes anew
    nodes, elements, mode = pyuff.UFF(str(path)).read_sets()
    assert (nodes["type"], elements["type"], mode["type"]) == (15, 2412, 55)
    used = np.array(nodes["node_nums"], dtype=int) - 1
    places = np.column_stack([nodes["x"], nodes["y"], nodes["z"]])
    assert places == pytest.approx(shape.coordinates[used], abs=1e-6)
    assert mode["eig"] == pytest.approx(shape.lam, rel=1e-5)
    u = np.column_stack([mode["r1"], mode["r2"], mode["r3"]])
    assert np.abs(u - shape.displacement[used]).max() < 1e-5
    assert len(elements[94]) == sum(len(p.facets) for p in shape.parts)  # thin shells


# -- the command --------------------------------------------------------------------------------
def test_command_writes_what_is_asked_for(results, capsys, tmp_path):
    out = str(tmp_path / "out")
    assert command("shape", str(results.directory), "--no-picture", "-o", out, "--uff") == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "Hz, growth +" in told
    assert "by friction at outer pad" in told
    kinds = sorted(path.suffix for path in (tmp_path / "out").iterdir())
    assert kinds == [".html", ".uff"]
    point = str(results.points["point_id"].iloc[1])
    arguments = ("--point", point, "--mode", "4,2", "--no-picture", "-o", out)
    assert command("shape", str(results.directory), *arguments) == 0
    own = results.modes[results.modes["point_id"] == point].set_index("mode")["track"]
    assert [
        m["name"].split()[0]
        for m in content((tmp_path / "out" / f"modes_{point}.html").read_text())["modes"]
    ] == [f"T{own[4]}:", f"T{own[2]}:"]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--mode", "3"), "name it beside the mode"),
        (("--point", "0", "--mode", "x"), "expected --mode as numbers"),
        (("--point", "0", "--mode", "3", "--track", "2"), "got both"),
        (("--point", "17"), "no design point 17"),
        (("--point", "nowhere"), "no design point 'nowhere'"),
        (("--point", "0", "--mode", "unstable"), "no unstable mode"),
    ],
)
def test_command_refuses_in_one_sentence(results, capsys, arguments, text):
    assert command("shape", str(results.directory), *arguments) == 2
    said = capsys.readouterr().err.strip()
    assert text in said
    assert len(said.splitlines()) == 1


def test_command_names_ranked_modes(results, capsys):
    ranking = results.rank()
    assert command("rank", str(results.directory), "--names") == 0
    told = " ".join(capsys.readouterr().out.split())
    for track in ranking["track"]:
        shape = results.shape(track=int(track))
        assert f"T{track} " in told
        hz = f"{shape.frequency_hz:.0f}"
        assert f"design point {shape.label.row}, {hz} Hz: {name_of(shape).text}; kinetic" in told
    assert "% out of plane" in told
    named = Results.open(results.directory).track_names
    assert set(named) == set(ranking["track"])
    figure = Results.open(results.directory).plot.ranking()
    rows = [t.get_text().replace("\n", " ") for t in figure.axes[0].get_yticklabels()]
    for track, (text, _) in named.items():
        assert any(text in row and row.endswith(f"(T{track})") for row in rows)
    legend = Results.open(results.directory).plot.evolution(along="friction").legends[0]
    texts = [t.get_text() for t in legend.get_texts()]
    assert any(f"(T{track})" in t for t in texts for track in named)
    capsys.readouterr()
    assert command("rank", str(results.directory)) == 0
    told = capsys.readouterr().out
    assert all(f"\nT{track}: {text}" in told for track, (text, no) in named.items() if not no)


def test_labels_of_one_design_point_have_names_that_change_nowhere(results):
    modes = results.modes
    row = modes.loc[modes["growth_rate"].idxmax()]
    for changes, seen, one in (
        (False, "4 ND", "4 ND"),
        (True, "4 ND (changes)", f"T{row['track']}"),
    ):
        opened = results.with_tables()
        opened.__dict__["track_names"] = {int(row["track"]): ("4 ND", changes)}
        for point_id, start in ((None, seen), (row["point_id"], one)):
            axes = opened.plot.stability_diagram(point_id=point_id).axes[0]
            labels = [t.get_text() for t in axes.texts if f"T{row['track']}" in t.get_text()]
            assert [t.startswith(start) for t in labels] == [True]


def test_names_are_those_of_points_and_modes(results):
    names = results.names()
    assert len(names) == results.modes["unstable"].sum()
    joined = results.modes.merge(names, on=["point_id", "mode"], suffixes=("", "_named"))
    assert (joined["track"] == joined["track_named"]).all()
    assert joined["unstable"].all()
    for row in names.itertuples():
        shape = results.shape(row.point_id, int(row.mode))
        assert row.name == name_of(shape).text
        assert row.n_diameters == name_of(shape).waves.diameters
        first = row.first_real_mode_hz, row.first_real_mode_share
        assert (first, row.real_modes_phase) == (shape.pair[0], shape.pair_phase)
        assert 0 <= row.real_modes_phase <= 90
        assert 0 < row.second_real_mode_share <= row.first_real_mode_share
    few = results.names(most=1)
    fastest = results.modes.loc[
        results.modes[results.modes["unstable"]].groupby("track")["growth_rate"].idxmax()
    ]
    assert sorted(few["point_id"]) == sorted(fastest["point_id"])
    with pytest.raises(ResultsError, match="no mode of track 999"):
        results.names([999])


def test_a_track_has_the_name_where_it_grows_fastest():
    text = ["a + b", "b + a", "b + a", "c", "d", "d"]
    names = pd.DataFrame(
        {"point_id": list("uvwxyz"), "mode": 1, "track": [5] * 4 + [7] * 2, "name": text}
    )
    growth = pd.DataFrame({"point_id": list("uvwxyz"), "mode": 1, "growth_rate": range(6)})
    found = track_names(names, growth)
    assert found.loc[5].to_dict() == {
        "name": "c",
        "n_points": 4,
        "n_named": 1,
        "changes": True,
        "others": "b + a at 3",
    }
    assert (found.loc[7, "name"], found.loc[7, "changes"]) == ("d", False)


def test_names_of_other_tables_are_not_used(results, tmp_path):
    """A damaged file, and one beside tables whose tracks have other numbers."""
    other = tmp_path / "other"
    shutil.copytree(results.directory, other)
    opened = Results.open(other)
    keep_track_names(opened.store, track_names(opened.names(most=1), opened.modes))
    kept = (other / FILE).read_text()
    assert Results.open(other).track_names
    journal = (other / JOURNAL).read_bytes()
    manifest = (other / MANIFEST).read_bytes()
    (other / JOURNAL).unlink()  # as results of earlier versions, which have no seal either
    (other / MANIFEST).write_text(json.dumps(read_manifest(other)))
    assert Results.open(other).track_names
    (other / JOURNAL).write_bytes(journal)
    (other / MANIFEST).write_bytes(manifest)
    (other / FILE).write_text(kept.replace("false", "true", 1) + " ")
    assert not Results.open(other).track_names
    (other / FILE).write_text(kept)
    opened.store.write_table("modes.parquet", pa.Table.from_pandas(opened.modes.iloc[1:]))
    assert not Results.open(other).track_names


def test_command_names_no_modes_of_other_kinds(tmp_path, capsys):
    minimal = solved(MINIMAL, tmp_path / "results")
    assert command("rank", str(minimal.directory), "--names") == 2
    assert "hulten has no mesh" in capsys.readouterr().err
