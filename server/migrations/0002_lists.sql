-- Lists read the columns that they filter and sort by from one narrow index; a record has several kilobytes.
CREATE INDEX jobs_by_id ON jobs (id, status, kind);

-- Metadata of jobs, for filters of lists. Kind and status are copies, so that a page is found in this table
-- alone: a lookup of each job takes ten times as long.
CREATE TABLE job_metadata (
    key    TEXT NOT NULL,
    value  TEXT NOT NULL,
    job    TEXT NOT NULL,
    kind   TEXT NOT NULL,
    status TEXT NOT NULL,
    PRIMARY KEY (key, value, job)
) STRICT, WITHOUT ROWID;
CREATE INDEX job_metadata_by_job ON job_metadata (job);
CREATE TRIGGER job_metadata_status AFTER UPDATE OF status ON jobs WHEN OLD.status <> NEW.status BEGIN
    UPDATE job_metadata SET status = NEW.status WHERE job = NEW.id;
END;
INSERT INTO job_metadata
    SELECT entry.key, entry.value, jobs.id, jobs.kind, jobs.status FROM jobs,
        json_each(CASE WHEN json_valid(record) THEN record ELSE '{}' END, '$.metadata') AS entry
    WHERE entry.type = 'text';

-- Evaluations of a model are found by an index. Records that are not JSON have no model.
ALTER TABLE records ADD COLUMN model TEXT AS
    (CASE WHEN json_valid(record) THEN CAST(json_extract(record, '$.model_id') AS TEXT) END) VIRTUAL;
CREATE INDEX records_by_model ON records (kind, model, seq);

-- The sizes of all meshes are added up for each upload: from one index, without parsing the records.
ALTER TABLE records ADD COLUMN bytes INTEGER AS
    (CASE WHEN json_valid(record) THEN CAST(json_extract(record, '$.bytes') AS INTEGER) END) VIRTUAL;
CREATE INDEX records_by_bytes ON records (kind, bytes);

-- The deletion of a file asks for other owners of its contents.
CREATE INDEX artifact_names_by_hash ON artifact_names (hash);
