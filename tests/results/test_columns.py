"""The registry of columns: no number of any table is without definition and error."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from study_runs import command

from squealstudy.columns import COLUMNS, column_of, unit_of
from squealstudy.columns.column import DEFINITION, ERROR, LEAVES_OUT
from squealstudy.engine.manifest_file import read_manifest
from squealstudy.engine.result_tables import RENAMED_COLUMNS, with_new_names
from squealstudy.engine.runner import run_study
from squealstudy.engine.store import UNIT, column_units
from squealstudy.face import read_study
from squealstudy.study.kinds import kind_named, kind_names
from squealstudy.wording import OF_THE_ONSET

MODES = "[modes]\nband = [20.0, 1000.0]\n"
STUDIES = {
    "complex_modes": f"""\
[model]
name = "hoffmann"
[parameters]
damping_ratio = 0.01
[[sweep]]
parameter = "friction"
values = [0.5, 0.9]
{MODES}
""",
    "transient": f"""\
[model]
name = "hoffmann"
contact_law = "unilateral"
[parameters]
damping_ratio = 0.01
friction = 1.0
{MODES}
[transient]
duration = 0.2
step = 2e-5
sliding_speed = {{ points = [[0.0, 1.0], [0.2, 0.9]], relative = true }}
""",
    "limit_cycles": f"""\
[model]
name = "hoffmann"
contact_law = "cubic"
[parameters]
"contact.cubic_stiffness" = 2e20
damping_ratio = 0.01
sliding_speed = 0.3
[[sweep]]
parameter = "friction"
values = [0.8, 0.9]
[[sweep]]
parameter = "damping_ratio"
values = [0.01, 0.012]
{MODES}
[limit_cycles]
families = [1]
harmonics = 5
follow = "friction"
borders_over = "damping_ratio"
points = [{{name = "mass", component = "mass", at = 1}}]
""",
    "sensitivity": f"""\
[model]
name = "hoffmann"
[parameters]
damping_ratio = 0.01
{MODES}
[sensitivity]
parameters = ["friction"]
""",
    "design": f"""\
[model]
name = "hoffmann"
[parameters]
damping_ratio = 0.001
[[sweep]]
parameter = "friction"
values = [0.6, 0.8]
[[variable]]
parameter = "damping_ratio"
bounds = [0.0, 0.2]
cost = 1.0
{MODES}
[goal]
margin = {{damping_ratio = 0.002}}
scan = 0
cycles = 0
in_time = 0
[[variant]]
name = "light"
cost = 0.1
description = "half the load"
parameters = {{normal_force = 50.0}}
""",
    "method_stability": """\
[method_stability]
case = "orthonormalisation"
set.held = 10.0
[[knob]]
name = "dependence"
values = [1e-9, 1e-1]
[[knob]]
name = "tolerance"
values = [1e-7, 1e-3]
""",
    "work_precision": """\
[work_precision]
base = "complex_modes.toml"
points = 1
repeats = 1
[reference]
name = "dense"
set.modes.method = "dense"
[[method]]
name = "perturbation"
set.modes.method = "perturbation"
""",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A small study of each kind."""
    made = tmp_path_factory.mktemp("columns")
    for kind, text in STUDIES.items():
        head = f'[study]\nname = "{kind}"\nkind = "{kind}"\n'
        (made / f"{kind}.toml").write_text(head + text, encoding="utf-8")
    return made


@pytest.fixture(scope="module", params=STUDIES)
def solved(request, folder):
    """A kind and the directory of its results."""
    kind = request.param
    run_study(read_study(folder / f"{kind}.toml").plan(), folder / kind, jobs=1)
    return kind, folder / kind


def is_number(kind: pa.DataType) -> bool:
    inner = kind.value_type if pa.types.is_list(kind) else kind
    return pa.types.is_integer(inner) or pa.types.is_floating(inner)


def tables(directory: Path) -> dict[str, pa.Schema]:
    """Schemas of all tables of results, one of their histories."""
    found = {path.stem: pq.read_schema(path) for path in directory.glob("*.parquet")}
    for path in list(directory.glob("histories/*.parquet"))[:1]:
        found["histories"] = pq.read_schema(path)
    return found


def test_every_kind_is_here():
    assert set(kind_names()) == set(STUDIES) == set(COLUMNS)


def test_no_number_is_without_definition_unit_and_error(solved):
    kind, directory = solved
    found = tables(directory)
    assert {Path(name).stem for name in kind_named(kind).tables} <= set(found)
    assert set(COLUMNS[kind]) <= set(found)
    for table, schema in found.items():
        for field in schema:
            told, where = field.metadata or {}, f"{kind} {table} {field.name}"
            if not is_number(field.type):
                continue
            assert told.get(DEFINITION), f"{where}: no definition in squealstudy/columns"
            assert UNIT in told, f"{where}: no unit in UNITS of squealstudy/wording.py"
            assert told.get(ERROR) or told.get(LEAVES_OUT), f"{where}: no error in columns"
            for error in filter(None, told.get(ERROR, b"").decode().split(", ")):
                assert error in schema.names, where


def test_the_registry_has_no_column_that_no_table_has(solved):
    kind, directory = solved
    units = frozenset(read_manifest(directory).get("units", {}))
    for table, columns in COLUMNS[kind].items():
        names = tables(directory)[table].names
        used = {column_of(kind, table, name, units) for name in names}
        unused = [c.name for c in columns if c not in used]
        assert not unused, f"{kind} {table}"


def test_definitions_are_sentences():
    for kind, known in COLUMNS.items():
        for columns in known.values():
            for column in columns:
                for text in filter(None, (column.definition, column.leaves_out)):
                    assert text.endswith("."), (kind, column.name)


def test_units_are_those_of_the_tables():
    assert unit_of("growth_rate") == "1/s"
    assert unit_of("torque_rms") == "N m"
    assert unit_of("torque_line_hz") == "Hz"
    assert unit_of("d_growth_rate") == "1/s per unit of the row"
    assert unit_of("d_frequency_hz") == "Hz per unit of the row"


def test_costs_of_designs_are_no_seconds():
    for table, unit in (("designs.parquet", ""), ("measurements.parquet", "s")):
        assert column_units({}, ["cost"], table) == {"cost": unit}


def test_columns_of_results_of_before_have_the_names_of_today():
    before = pd.DataFrame({"role": ["scan"], "stage": ["modes"], "cost": [1.0]})
    assert list(with_new_names(before, "design")) == ["origin", "analysis", "cost"]
    assert list(with_new_names(before, "steady_sliding")) == ["role", "stage", "cost"]
    both = pd.DataFrame({"role": ["mine"], "origin": ["scan"]})  # never two columns of one name
    assert list(with_new_names(both, "design")) == ["role", "origin"]


def test_the_page_of_words_has_all_columns_that_were_renamed():
    page = (Path(__file__).parents[2] / "docs/reference/words-in-tables.md").read_text("utf-8")
    rows = [
        f"|`{kind}`|`{old}`|`{new}`|"
        for kind, names in RENAMED_COLUMNS.items()
        for old, new in names.items()
    ]
    assert rows
    assert [row for row in rows if row not in page] == []


def test_the_command_tells_the_unit_that_a_table_has(capsys):
    """The error of an onset is in its parameter's unit, the cost of a design is a number."""
    assert unit_of("error_estimate", "modes") == "1/s"
    assert unit_of("error_estimate", "onsets") == OF_THE_ONSET
    for kind, table, column in (
        ("complex_modes", "onsets", "error_estimate"),
        ("design", "designs", "cost"),
    ):
        assert command("columns", kind, table) == 0
        lines = capsys.readouterr().out.splitlines()
        line = next(x for x in lines if x.startswith(column))
        assert line.split()[1] not in ("1/s", "s")
