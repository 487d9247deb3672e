"""Rows by the versions they begin and end with: what changed since a version is found without reading the whole map."""

from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

INDEXES = {
    "landmarks_opened": "landmarks (valid_from_version)",
    "landmark_history_opened": "landmark_history (valid_from_version, valid_to_version)",
    "landmark_history_ended": "landmark_history (valid_to_version, valid_from_version)",
}


def upgrade() -> None:
    """One index for each way a row can differ between two versions."""
    for name, place in INDEXES.items():
        op.execute(f"CREATE INDEX {name} ON {place}")


def downgrade() -> None:
    """Without them, as before."""
    op.execute(f"DROP INDEX {', '.join(INDEXES)}")
