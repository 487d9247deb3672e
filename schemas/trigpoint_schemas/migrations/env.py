"""Alembic's entry: the steps are taken on the connection, and in the transaction, of who asks for them."""

from alembic import context

connection = context.config.attributes["connection"]
context.configure(connection=connection)
with context.begin_transaction():
    context.run_migrations()
