-- Jobs: the complete record as JSON, and the columns that queries filter and sort by.
-- lease_until: Unix time (ms); token_hash: BLAKE3 of the token of the current worker.
CREATE TABLE IF NOT EXISTS jobs (
    id          TEXT PRIMARY KEY,
    kind        TEXT NOT NULL,
    status      TEXT NOT NULL,
    priority    INTEGER NOT NULL,
    lease_until INTEGER NOT NULL,
    token_hash  BLOB,
    record      TEXT NOT NULL
) STRICT;
CREATE INDEX IF NOT EXISTS jobs_by_status ON jobs (status, priority DESC, id);

-- Event log, totally ordered over all jobs by seq.
CREATE TABLE IF NOT EXISTS events (
    seq        INTEGER PRIMARY KEY AUTOINCREMENT,
    job        TEXT NOT NULL,
    created_at TEXT NOT NULL,
    level      TEXT NOT NULL,
    type       TEXT NOT NULL,
    message    TEXT NOT NULL,
    data       TEXT NOT NULL
) STRICT;
CREATE INDEX IF NOT EXISTS events_by_job ON events (job, seq);
CREATE INDEX IF NOT EXISTS events_by_type ON events (job, type, seq);

-- Artifacts: immutable files by BLAKE3 (hex).
CREATE TABLE IF NOT EXISTS artifacts (
    hash         TEXT PRIMARY KEY,
    bytes        INTEGER NOT NULL,
    content_type TEXT NOT NULL,
    created_at   TEXT NOT NULL
) STRICT;

-- Names of artifacts; the owner is a job or a mesh.
CREATE TABLE IF NOT EXISTS artifact_names (
    owner TEXT NOT NULL,
    name  TEXT NOT NULL,
    hash  TEXT NOT NULL,
    PRIMARY KEY (owner, name)
) STRICT;

-- Datasets, models, evaluations and meshes as JSON.
CREATE TABLE IF NOT EXISTS records (
    seq    INTEGER PRIMARY KEY AUTOINCREMENT,
    id     TEXT NOT NULL UNIQUE,
    kind   TEXT NOT NULL,
    record TEXT NOT NULL
) STRICT;
CREATE INDEX IF NOT EXISTS records_by_kind ON records (kind, seq);

-- Idempotency keys of creation requests; created_at: Unix time (ms).
CREATE TABLE IF NOT EXISTS idempotency_keys (
    key        TEXT PRIMARY KEY,
    body_hash  TEXT NOT NULL,
    job        TEXT NOT NULL,
    created_at INTEGER NOT NULL
) STRICT;
