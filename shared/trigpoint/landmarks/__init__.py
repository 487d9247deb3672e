"""The landmark database: a projection of solved map versions, with its model and its stores."""
