"""What one more label would tell of a map version that was solved whole."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """A table of its own; versions from before have no rows in it."""
    op.create_table(
        "label_gains",
        sa.Column("fid", sa.BigInteger, primary_key=True),
        sa.Column("map_version", sa.BigInteger, nullable=False),
        *(sa.Column(name, sa.Text, nullable=False) for name in ("image", "landmarks_json", "terms_json")),
        sa.UniqueConstraint("map_version", "image"),
    )


def downgrade() -> None:
    """The log still has it."""
    op.drop_table("label_gains")
