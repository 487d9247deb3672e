"""The schema on a PostGIS server: made step by step, equal to the one the program works with, never guessed."""

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import Table, create_engine, text

from landmark_databases.cluster import Cluster
from landmark_maps.examples import change, checkpoint, landmark, version_row
from trigpoint.errors import DatabaseUnavailable, InputError
from trigpoint.landmarks import tables
from trigpoint.landmarks.geopackage_query import Validity
from trigpoint.landmarks.postgis_query import landmark_statement
from trigpoint.landmarks.postgis_store import PostgisStore
from trigpoint.landmarks.queries import Disc, LandmarkQuery, box_around

pytestmark = pytest.mark.postgis


@pytest.fixture
def made(postgis_url: str) -> str:
    """A database with the schema in it."""
    PostgisStore(postgis_url).close()
    return postgis_url


def executed(url: str, statement: str) -> None:
    engine = create_engine(url)
    with engine.begin() as connection:
        connection.execute(text(statement))
    engine.dispose()


def scalars(url: str, statement: str) -> list[object]:
    engine = create_engine(url)
    with engine.connect() as connection:
        found = list(connection.scalars(text(statement)))
    engine.dispose()
    return found


def test_the_steps_lead_to_the_tables_the_program_works_with(made: str) -> None:
    engine = create_engine(made)
    ours = set(tables.metadata.tables)
    with engine.connect() as connection:
        context = MigrationContext.configure(
            connection,
            opts={
                "compare_type": True,
                "include_name": lambda name, kind, _: kind != "table" or name in ours,
                "include_object": lambda item, name, kind, *_: kind != "index",
            },
        )
        difference = compare_metadata(context, tables.metadata)
    engine.dispose()
    assert difference == []


def test_no_number_has_less_than_64_bits(made: str) -> None:
    kinds = scalars(
        made,
        "SELECT DISTINCT data_type FROM information_schema.columns WHERE table_schema = 'public' AND table_name IN "
        "('landmarks', 'landmark_history', 'trajectories', 'anchors', 'image_offsets', 'label_gains', 'map_versions')",
    )
    assert set(kinds) == {"USER-DEFINED", "bigint", "boolean", "double precision", "text"}


def test_opened_again_nothing_changes(made: str) -> None:
    with_one = PostgisStore(made)
    with_one.apply(change(1, opened=[landmark("A", 0.0, 0.0)]), checkpoint(1))
    with_one.close()
    again = PostgisStore(made)
    assert [row.landmark for row in again.landmarks(LandmarkQuery())] == ["A"]
    again.close()


def test_a_newer_schema_is_refused_with_both_versions(made: str) -> None:
    executed(made, "UPDATE alembic_version SET version_num = '9999'")
    with pytest.raises(InputError, match="schema 9999 is newer than 0003"):
        PostgisStore(made)


def test_a_newer_schema_is_refused_for_reading_too(made: str) -> None:
    executed(made, "UPDATE alembic_version SET version_num = '9999'")
    with pytest.raises(InputError, match="schema 9999 is newer than 0003"):
        PostgisStore(made, read_only=True)


def test_a_database_without_a_map_is_not_made_one_by_reading(postgis_url: str) -> None:
    with pytest.raises(InputError, match="no landmark database at postgresql"):
        PostgisStore(postgis_url, read_only=True)
    assert scalars(postgis_url, "SELECT count(*) FROM pg_tables WHERE tablename = 'landmarks'") == [0]


def test_only_one_process_writes(made: str) -> None:
    first = PostgisStore(made)
    with pytest.raises(DatabaseUnavailable, match="another process writes it"):
        PostgisStore(made)
    first.close()
    PostgisStore(made).close()


def test_readers_come_in_beside_the_writer(made: str) -> None:
    writer = PostgisStore(made)
    reader = PostgisStore(made, read_only=True)
    writer.apply(change(1, opened=[landmark("A", 0.0, 0.0)]), checkpoint(1))
    assert [row.landmark for row in reader.landmarks(LandmarkQuery())] == ["A"]
    reader.close()
    writer.close()


def test_geometries_are_in_the_crs_of_the_map(made: str) -> None:
    store = PostgisStore(made)
    store.apply(change(1, opened=[landmark("A", 1.5, 2.5)]), checkpoint(1))
    store.close()
    assert scalars(made, "SELECT ST_AsEWKT(geom) FROM landmarks") == ["SRID=32756;POINT(332001.5 6248002.5)"]
    assert set(scalars(made, "SELECT srid FROM geometry_columns WHERE f_table_schema = 'public'")) == {32756}


def test_indexes_put_off_are_made_when_they_are_wanted(made: str) -> None:
    spatial = "SELECT indexname FROM pg_indexes WHERE indexdef LIKE '%gist%' AND schemaname = 'public' ORDER BY 1"
    store = PostgisStore(made)
    before = scalars(made, spatial)
    store.defer_indexes()
    assert len(before) - len(scalars(made, spatial)) == 3
    store.restore_indexes()
    assert scalars(made, spatial) == before
    store.close()


@pytest.mark.parametrize(
    ("table", "validity", "index"),
    [
        ("landmarks", Validity(valid_at=9, opened_after=8), "landmarks_opened"),
        ("landmark_history", Validity(valid_at=9, opened_after=8), "landmark_history_opened"),
        ("landmark_history", Validity(valid_at=8, ended_by=9), "landmark_history_ended"),
    ],
)
def test_what_changed_since_a_version_is_looked_up_by_index(
    made: str, table: str, validity: Validity, index: str
) -> None:
    statement = landmark_statement(
        tables.metadata.tables[table], LandmarkQuery(), version=version_row(), validity=validity
    )
    engine = create_engine(made)
    asked = statement.compile(engine, compile_kwargs={"literal_binds": True})
    with engine.connect() as connection:
        connection.execute(text("SET enable_seqscan = off"))
        plan = list(connection.scalars(text(f"EXPLAIN {asked}")))
    engine.dispose()
    assert any(index in line for line in plan)


def test_a_reader_in_the_way_leaves_the_indexes_as_they_are(made: str) -> None:
    engine, store = create_engine(made), PostgisStore(made)
    with engine.connect() as reader:
        reader.execute(text("SELECT count(*) FROM landmarks"))
        store.defer_indexes()
    engine.dispose()
    assert scalars(made, "SELECT count(*) FROM pg_indexes WHERE indexname = 'landmarks_geom'") == [1]
    assert store.map_versions() == ()
    store.close()


def plan_of(url: str, source: Table, query: LandmarkQuery) -> str:
    """How the server would look a query up, were the table too large to be read through."""
    statement = landmark_statement(source, query, version=version_row())
    engine = create_engine(url)
    with engine.connect() as connection:
        connection.execute(text("SET enable_seqscan = off"))
        sql = str(statement.compile(engine, compile_kwargs={"literal_binds": True}))
        plan = "\n".join(connection.scalars(text(f"EXPLAIN {sql}")))
    engine.dispose()
    return plan


@pytest.mark.parametrize(
    ("source", "area", "index"),
    [
        (tables.landmarks, "near", "landmarks_place"),
        (tables.landmarks, "bbox", "landmarks_geom"),
        (tables.landmark_history, "near", "landmark_history_geom"),
        (tables.landmark_history, "bbox", "landmark_history_geom"),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_an_area_is_looked_up_in_an_index(made: str, source: Table, area: str, index: str) -> None:
    store = PostgisStore(made)
    store.apply(change(1, opened=[landmark("A", 0.0, 0.0)]), checkpoint(1))
    store.close()
    near = Disc(lat_deg=-33.895, lon_deg=151.183, radius_m=20.0)
    query = LandmarkQuery(near=near) if area == "near" else LandmarkQuery(bbox=box_around(near))
    assert f"Index Scan using {index}" in plan_of(made, source, query)


def test_a_server_that_is_not_there_is_named_without_its_password(postgis: Cluster) -> None:
    url = f"postgresql+psycopg://somebody:hidden@127.0.0.1:1/{postgis.created()}"
    with pytest.raises(DatabaseUnavailable) as caught:
        PostgisStore(url)
    assert "somebody:***@127.0.0.1:1" in str(caught.value)
    assert "hidden" not in str(caught.value)


def test_a_password_comes_from_its_file(postgis: Cluster) -> None:
    store = PostgisStore(postgis.url(postgis.created()), password_file=postgis.password_file)
    assert store.map_versions() == ()
    store.close()


@pytest.mark.parametrize(
    "url",
    ["postgresql+psycopg://u:se@cret@host:port/map", "postgresql+psycopg://u:secret@host", "mysql://u:secret@h/m"],
)
def test_a_url_that_cannot_be_read_is_refused_without_its_password(url: str) -> None:
    with pytest.raises(InputError) as caught:
        PostgisStore(url)
    assert "cret" not in str(caught.value)
