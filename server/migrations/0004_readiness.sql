-- One row, which the readiness probe writes: reading alone succeeds on a full disk.
CREATE TABLE readiness (
    id         INTEGER PRIMARY KEY CHECK (id = 1),
    checked_at INTEGER NOT NULL
) STRICT;
