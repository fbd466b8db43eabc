#!/bin/sh
# Starts a dataset job on a running server (`ngf serve --data-dir DIR`), waits for it, and prints its result.
# sh examples/07_jobs.sh [URL]
set -eu
api="${1:-http://127.0.0.1:8787}/api/v1"

# First value of a text member in the JSON on stdin.
text() { grep -o "\"$1\":\"[^\"]*\"" | head -n 1 | cut -d '"' -f 4; }

job=$(curl -fsS -d '{"kind": "dataset.generate", "params": {"preset": "smoke"}}' "$api/jobs" | text id)
echo "started $job"
status=queued
while [ "$status" = queued ] || [ "$status" = running ]; do
    status=$(curl -fsS "$api/jobs/$job?wait=30s" | text status)
    echo "$status"
done
[ "$status" = succeeded ]
curl -fsS "$api/datasets"
