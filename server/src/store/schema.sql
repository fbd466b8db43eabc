-- Jobs as JSON beside what is asked of them; everything that happened to them, in one order for all.
CREATE TABLE IF NOT EXISTS jobs (
    id          TEXT PRIMARY KEY,
    kind        TEXT NOT NULL,
    status      TEXT NOT NULL,
    priority    INTEGER NOT NULL,
    lease_until INTEGER NOT NULL,
    token       BLOB,
    record      TEXT NOT NULL
) STRICT;
CREATE INDEX IF NOT EXISTS jobs_by_status ON jobs (status, priority DESC, id);

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

CREATE TABLE IF NOT EXISTS artifacts (
    hash         TEXT PRIMARY KEY,
    bytes        INTEGER NOT NULL,
    content_type TEXT NOT NULL,
    created_at   TEXT NOT NULL
) STRICT;

CREATE TABLE IF NOT EXISTS job_artifacts (
    job  TEXT NOT NULL,
    name TEXT NOT NULL,
    hash TEXT NOT NULL,
    PRIMARY KEY (job, name)
) STRICT;

CREATE TABLE IF NOT EXISTS records (
    seq    INTEGER PRIMARY KEY AUTOINCREMENT,
    id     TEXT NOT NULL UNIQUE,
    kind   TEXT NOT NULL,
    record TEXT NOT NULL
) STRICT;
CREATE INDEX IF NOT EXISTS records_by_kind ON records (kind, seq);

CREATE TABLE IF NOT EXISTS answers (
    key        TEXT PRIMARY KEY,
    body       TEXT NOT NULL,
    job        TEXT NOT NULL,
    created_at INTEGER NOT NULL
) STRICT;
