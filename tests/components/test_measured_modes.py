"""Measured modes of a free component beside its computed ones."""

from __future__ import annotations

import re

import numpy as np
import pytest
import pyuff
from own_blocks import block, write_blocks
from study_runs import command

from squealstudy.errors import ModelError
from squealstudy.linalg.real_modes import real_modes
from squealstudy.models.components.inp_writer import write_inp
from squealstudy.shapes.measured import correlated, read_measured
from squealstudy.study.components import free_component, read_model

UPRIGHT = (
    "translate = [1.5, 0.5, 2.0]",
    "translate = [1.5, 0.5, 2.0]\nrotate = {axis = [0, 0, 1], angle = 90, point = [2.5, 1.0, 0.0]}",
)


@pytest.fixture
def plate(tmp_path):
    """The plate of the blocks: model file, its body, its elastic modes (hz, shapes (m, n, 3))."""
    return part(tmp_path, "plate")


def part(folder, name, *changes):
    path = write_blocks(folder, *changes).parent / "blocks.toml"
    body, (K, M), placement = free_component(read_model(path), name)
    omega, phi = real_modes(M, K, 4e5)
    shapes = phi[:, 6:].T.reshape(len(omega) - 6, -1, 3)
    return path, body, omega[6:] / (2 * np.pi), shapes, (K, M, body.expansion.E, placement)


def written(path, numbers, points, hz, shapes, *, zeta=0.01, his=0.0, kind=3, more=()):
    """A universal file of modes; real ones as normal modes."""
    common = {"id1": "a", "id2": "b", "id3": "NONE", "id4": "NONE", "id5": "NONE"}
    common |= {"model_type": 1, "data_ch": 2, "spec_data_type": 8, "n_data_per_node": 3}
    x, y, z = points.T
    sets = [*more, pyuff.prepare_15(node_nums=list(numbers), x=x, y=y, z=z)]
    for k, (f, u) in enumerate(zip(hz, shapes, strict=True), 1):
        omega = 2 * np.pi * f
        own = {"r1": u[:, 0], "r2": u[:, 1], "r3": u[:, 2], "node_nums": list(numbers)}
        own |= {"load_case": 1, "mode_n": k, "analysis_type": kind, "data_type": 2}
        if kind == 3:
            own |= {"eig": omega * (-zeta + 1j * np.sqrt(1 - zeta**2)), "data_type": 5}
        else:
            own |= {"freq": f, "modal_m": 1.0, "modal_damp_vis": zeta, "modal_damp_his": his}
        sets.append(pyuff.prepare_55(**common, **own))
    path.unlink(missing_ok=True)
    pyuff.UFF(str(path)).write_sets(sets, "add")
    return path


def test_measured_modes_find_their_partners(plate, tmp_path):
    """Every third node, in another order, mm, complex, frequencies 2 % higher, one absent."""
    _, body, hz, shapes, (K, M, E, placement) = plate
    rng = np.random.default_rng(2)
    some = rng.permutation(len(body.nodes))[: len(body.nodes) // 3]
    chosen = [0, 1, 3, 4]
    phases = np.exp(1j * rng.uniform(0, 6, len(chosen)))[:, None, None]
    noise = 0.02 * np.abs(shapes[chosen][:, some]).max() * rng.standard_normal((4, len(some), 3))
    path = written(
        tmp_path / "a.uff",
        900 + some,
        1e3 * body.nodes[some],
        1.02 * hz[chosen],
        (shapes[chosen][:, some] + noise) * phases,
    )
    measured = read_measured(path, 1e-3)
    found = correlated(measured, K, M, body.nodes, E, placement, 1e-5)
    assert found.used.all()
    np.testing.assert_allclose(measured.frequency_hz, 1.02 * hz[chosen], rtol=1e-5)
    np.testing.assert_allclose(measured.damping_ratio, 0.01, rtol=1e-4)
    assert [found.groups[g] for _, g in found.pairs] == [(7 + k,) for k in chosen]
    assert min(found.mac[i, j] for i, j in found.pairs) > 0.97
    for i, j in found.pairs:  # as the definition says
        u, order = measured.shapes[i].ravel(), np.argsort(some)
        v = shapes[chosen[i]][some[order]].ravel()
        mac = np.abs(np.vdot(v, u)) ** 2 / (np.vdot(u, u).real * (v @ v))
        assert found.mac[i, j] == pytest.approx(mac, rel=1e-9)


def test_directions_that_were_not_measured_do_not_count(plate, tmp_path):
    _, body, hz, shapes, (K, M, E, placement) = plate
    flat = shapes[:3] * [0.0, 0.0, 1.0]
    size = (shapes[:3] ** 2).sum(axis=(1, 2))
    bending = [k for k in range(3) if (flat[k] ** 2).sum() > 0.5 * size[k]]
    assert len(bending) > 1
    path = written(
        tmp_path / "a.uff",
        1 + np.arange(len(body.nodes)),
        body.nodes,
        hz[bending],
        flat[bending],
        kind=2,
    )
    measured = read_measured(path)
    assert not measured.measured_directions[:, :2].any()
    found = correlated(measured, K, M, body.nodes, E, placement, 1e-6)
    assert [found.mac[i, j] for i, j in found.pairs] == pytest.approx(
        [1.0] * len(bending), abs=1e-9
    )


def test_hysteretic_damping_is_told_beside(plate, tmp_path, capsys):
    """It has a column of its own, where a file has some."""
    model, body, hz, shapes, _ = plate
    points = 1 + np.arange(len(body.nodes)), body.nodes, hz[:3], shapes[:3]
    for his, column in ((0.0, False), (0.0124, True)):
        path = written(tmp_path / "a.uff", *points, zeta=0.0, his=his, kind=2)
        command("inspect", str(model), "--measured", str(path), "--component", "plate")
        out = capsys.readouterr().out
        assert ("hysteretic %" in out) == column
        assert out.count("1.240") == (3 if column else 0)
    measured = read_measured(path)
    assert np.isnan(measured.damping_ratio).all()
    np.testing.assert_allclose(measured.hysteretic, 0.0124, rtol=1e-4)


@pytest.mark.parametrize("placed", [True, False])
def test_points_of_the_mesh_or_of_the_assembly(tmp_path, placed):
    """A slider that was turned and moved: its file's coordinates, or those of the assembly."""
    _, body, hz, shapes, (K, M, E, placement) = part(tmp_path, "slider", UPRIGHT)
    turn, shift = placement
    points, u = body.nodes, shapes[:4]
    if not placed:
        points, u = (points - shift) @ turn, u @ turn
    path = written(tmp_path / "a.uff", 1 + np.arange(len(points)), points, hz[:4], u)
    found = correlated(read_measured(path), K, M, body.nodes, E, placement, 1e-6)
    assert found.in_assembly is placed
    assert [found.mac[i, j] for i, j in found.pairs] == pytest.approx([1.0] * 4, abs=1e-8)


def test_a_pair_of_one_frequency_is_compared_as_a_plane(tmp_path):
    """A square bar bends in any direction: turned by 0.5 rad, MAC of each mode with one is .77."""
    write_blocks(tmp_path)
    write_inp(block("plate", (4, 2, 2), (8.0, 2.0, 2.0), "STEEL"), tmp_path / "bar.inp")
    text = (tmp_path / "blocks.toml").read_text().replace('"plate.inp"', '"bar.inp"')
    (tmp_path / "blocks.toml").write_text(text)
    body, (K, M), placement = free_component(read_model(tmp_path / "blocks.toml"), "plate")
    E = body.expansion.E
    omega, phi = real_modes(M, K, 4e5)
    assert omega[7] == pytest.approx(omega[6], rel=1e-6)
    c, s = np.cos(0.5), np.sin(0.5)
    pair = phi[:, 6:8] @ np.array([[c, -s], [s, c]])
    hz = omega[6] / (2 * np.pi) * np.array([0.99, 1.01])
    shapes = pair.T.reshape(2, -1, 3)
    path = written(tmp_path / "a.uff", 1 + np.arange(len(body.nodes)), body.nodes, hz, shapes)
    found = correlated(read_measured(path), K, M, body.nodes, E, placement, 1e-6)
    assert found.groups[0] == (7, 8)
    assert found.pairs == ((0, 0), (1, 0))
    assert found.mac[:, 0] == pytest.approx(1.0, abs=1e-9)


def test_modes_at_rest_at_the_points_have_no_mac(tmp_path):
    """Sensors on a bar's axis measure z: its torsion and stretching are at rest there, as is half
    of each bending pair. Their round-off once had MAC up to 0.99 with the second bending."""
    write_blocks(tmp_path)
    write_inp(block("plate", (8, 2, 2), (8.0, 2.0, 2.0), "STEEL"), tmp_path / "bar.inp")
    text = (tmp_path / "blocks.toml").read_text().replace('"plate.inp"', '"bar.inp"')
    (tmp_path / "blocks.toml").write_text(text)
    body, (K, M), placement = free_component(read_model(tmp_path / "blocks.toml"), "plate")
    E = body.expansion.E
    omega, phi = real_modes(M, K, 1e6)
    middle = body.nodes.mean(axis=0)
    axis = np.flatnonzero(np.abs(body.nodes - middle)[:, 1:].max(axis=1) < 1e-9)
    assert len(axis) == 17
    along_z = (E @ phi).T.reshape(len(omega), -1, 3)[:, axis] * [0.0, 0.0, 1.0]
    size = np.abs(along_z).max(axis=(1, 2))
    bending = [6 + int(size[7] > size[6]), 10 + int(size[11] > size[10])]
    hz = omega / (2 * np.pi)
    path = written(tmp_path / "a.uff", 1 + axis, body.nodes[axis], hz[bending], along_z[bending])
    found = correlated(read_measured(path), K, M, body.nodes, E, placement, 1e-6)
    assert found.groups[:4] == ((7, 8), (9,), (10, 11), (12,))
    np.testing.assert_allclose(found.mac[:, :4], [[1, 0, 0, 0], [0, 0, 1, 0]], atol=1e-6)
    assert found.pairs == ((0, 0), (1, 2))
    assert not found.alike


def test_command_tells_pairs_and_what_has_none(plate, tmp_path, capsys):
    path, body, hz, shapes, _ = plate
    odd = np.random.default_rng(1).standard_normal((1, *shapes[0].shape))
    measured = np.concatenate([shapes[[1, 0]], odd])
    points = body.nodes.copy()
    points[3] += 1.0
    file = written(
        tmp_path / "a.uff", 1 + np.arange(len(points)), points, [*hz[[1, 0]], 2e4], measured
    )
    picture = tmp_path / "mac.png"
    asked = ("inspect", str(path), "--measured", str(file), "--component", "plate")
    assert command(*asked, "-p", str(picture)) == 1
    out, err = capsys.readouterr()
    rows = [line.split() for line in out.splitlines()]
    pairs = {
        r[0]: (r[3], float(r[5]), float(r[6]))
        for r in rows
        if re.fullmatch(r"[12]", r[0] if r else "")
    }
    assert pairs == {"1": ("8", 0.0, 1.0), "2": ("7", 0.0, 1.0)}
    assert f"{len(points) - 1} of {len(points)} points have a node" in " ".join(out.split())
    said = " ".join(err.split())
    assert "has a MAC of 0.5 with measured 3:" in said
    assert "measured points without a node: 4" in said
    assert picture.stat().st_size > 5000


def test_what_cannot_be_compared(plate, tmp_path, capsys):
    path, body, hz, shapes, _ = plate
    nodes = 1 + np.arange(len(body.nodes))
    good = written(tmp_path / "a.uff", nodes, body.nodes, hz[:2], shapes[:2])
    empty, still = tmp_path / "none.uff", tmp_path / "still.uff"
    empty.write_text("nothing")
    written(still, nodes, body.nodes, hz[:2], 0 * shapes[:2])
    axes = pyuff.prepare_15(node_nums=[1], disp_cs=[7], x=[0.0], y=[0.0], z=[0.0])
    local = written(tmp_path / "local.uff", nodes, body.nodes, hz[:1], shapes[:1], more=[axes])
    for arguments, code, text in (
        ((str(tmp_path / "b.uff"), "plate"), 1, "there is no such file"),
        ((str(empty), "plate"), 1, "none.uff"),
        ((str(still), "plate"), 1, "mode shape 1 of the file is zero everywhere"),
        ((str(local), "plate"), 1, "several axes of displacement"),
        ((str(good), "plates"), 2, "no component 'plates'; did you mean 'plate'?"),
        ((str(good), "plate", "--unit", "mm"), 1, "measured points lie within"),
        ((str(good), "plate", "--tolerance", "3 kg"), 1, "--tolerance"),
        ((str(good), "plate", "--tolerance", "-3 mm"), 1, "expected a positive length"),
    ):
        file, component, *more = arguments
        got = command("inspect", str(path), "--measured", file, "--component", component, *more)
        err = " ".join(capsys.readouterr().err.split())
        assert text in err, err
        assert got in (code, 1, 2)
    assert command("inspect", str(path), "--measured", str(good)) == 2


def test_strains_of_a_mode_are_no_shape(plate, tmp_path):
    """Of each mode its shape and six strains: these were taken for displacements of other modes."""
    _, body, hz, shapes, _ = plate
    numbers = list(1 + np.arange(len(body.nodes)))
    strains = {f"r{k}": np.full(len(numbers), float(k)) for k in range(1, 7)}
    strains |= {"model_type": 1, "analysis_type": 2, "data_ch": 4, "spec_data_type": 3}
    strains |= {"data_type": 2, "n_data_per_node": 6, "load_case": 1, "mode_n": 1, "freq": hz[0]}
    strains |= {"modal_m": 1.0, "modal_damp_vis": 0.01, "modal_damp_his": 0.0}
    strains |= {f"id{k}": "NONE" for k in range(1, 6)} | {"node_nums": numbers}
    own = pyuff.prepare_55(**strains)
    path = written(tmp_path / "a.uff", numbers, body.nodes, hz[:2], shapes[:2], kind=2, more=[own])
    measured = read_measured(path)
    np.testing.assert_allclose(measured.frequency_hz, hz[:2], rtol=1e-5)
    assert measured.left_out == 1


@pytest.mark.parametrize(
    ("kind", "turn", "refused"), [(0, 0.0, False), (0, 0.3, True), (1, 0.0, True)]
)
def test_axes_of_displacement_are_global(plate, tmp_path, kind, turn, refused):
    """One system for all nodes: Cartesian as the global one, turned, cylindrical."""
    _, body, hz, shapes, _ = plate
    c, s = np.cos(turn), np.sin(turn)
    rows = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0], [0.1, 0.2, 0.3]])
    numbers = list(1 + np.arange(len(body.nodes)))
    origin = rows[3]
    by_rows = {"type": 2420, "Part_UID": 1, "Part_Name": "p", "CS_sys_labels": [5]}
    by_rows |= {"CS_types": [kind], "CS_colors": [8], "CS_names": ["own"], "CS_matrices": [rows]}
    by_points = pyuff.prepare_18(
        cs_num=[5],
        cs_type=[kind],
        ref_cs_num=[0],
        cs_name=["own"],
        ref_o=[origin],
        x_point=[origin + rows[0]],
        xz_point=[origin + rows[0] + rows[2]],
    )
    x, y, z = body.nodes.T
    nodes = pyuff.prepare_15(node_nums=numbers, disp_cs=[5] * len(numbers), x=x, y=y, z=z)
    for systems in (by_rows, by_points):
        path = written(tmp_path / "a.uff", numbers, body.nodes, hz[:2], shapes[:2])
        modes = [s for s in pyuff.UFF(str(path)).read_sets() if s["type"] == 55]
        path.unlink()
        pyuff.UFF(str(path)).write_sets([systems, nodes, *modes], "add")
        if refused:
            with pytest.raises(ModelError, match="in the coordinate system 5, whose axes are not"):
                read_measured(path)
        else:
            np.testing.assert_allclose(read_measured(path).frequency_hz, hz[:2], rtol=1e-5)


def test_all_modes_are_measured_at_the_same_nodes(plate, tmp_path):
    """A second mode at half of the points was compared as zero at the others."""
    _, body, hz, shapes, _ = plate
    numbers = 1 + np.arange(len(body.nodes))
    path = written(tmp_path / "a.uff", numbers, body.nodes, hz[:2], shapes[:2])
    half = written(tmp_path / "b.uff", numbers[::2], body.nodes[::2], hz[1:2], shapes[1:2, ::2])
    twice = np.append(numbers, numbers[4])
    double = written(
        tmp_path / "c.uff",
        twice,
        body.nodes[twice - 1],
        hz[:1],
        shapes[:1, twice - 1],
    )
    sets = pyuff.UFF(str(path)).read_sets()[:-1] + pyuff.UFF(str(half)).read_sets()[1:]
    path.unlink()
    pyuff.UFF(str(path)).write_sets(sets, "add")
    with pytest.raises(ModelError, match="mode shape 2 has no value at node 2, where others"):
        read_measured(path)
    with pytest.raises(ModelError, match="mode shape 1 has node 5 twice"):
        read_measured(double)
