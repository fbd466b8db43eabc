-- Metrics of a job as columns of numbers, in chunks of consecutive events: copies of the events up to
-- `last_seq`. Reading them takes milliseconds where the events take seconds.
CREATE TABLE metric_chunks (
    job       TEXT NOT NULL,
    last_seq  INTEGER NOT NULL,
    content   BLOB NOT NULL,
    PRIMARY KEY (job, last_seq)
) STRICT;
