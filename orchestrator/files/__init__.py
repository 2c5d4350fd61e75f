"""Files of others: limits of readers, lines and columns of tables."""
