#!/bin/sh
# From an empty server to an evaluated policy, with curl alone, at toy size (about a minute on two cores).
#
#     cargo build --bin ngf --bin ngf-worker && target/debug/ngf serve --data-dir DIR &
#     docs/end_to_end.sh http://127.0.0.1:8787 OUT   # writes the files of the model to OUT
set -eu
api=${1:?missing server URL}/api/v1
out=${2:?missing output folder for the model}

# Prints the first string member of this name in the JSON on stdin.
text() { grep -o "\"$1\":\"[^\"]*\"" | head -n 1 | cut -d '"' -f 4; }

# Creates a job, waits for its end and prints it; a failed or cancelled job ends the script.
job() {
    id=$(curl -fsS -H 'Content-Type: application/json' -d "$1" "$api/jobs" | text id)
    while :; do
        now=$(curl -fsS "$api/jobs/$id?wait=30s")
        case $(echo "$now" | text status) in
            succeeded) echo "$now"; return ;;
            failed | cancelled) echo "$now" >&2; exit 1 ;;
        esac
    done
}

dataset=$(job '{"kind": "dataset.generate", "params": {"preset": "smoke"}}' | text dataset_id)
echo "dataset $dataset"

encoder=$(job "{\"kind\": \"encoder.train\", \"params\": {\"dataset_id\": \"$dataset\", \"preset\": \"smoke\"}}" | text model_id)
echo "encoder $encoder"

policy=$(job "{\"kind\": \"policy.train\",
    \"params\": {\"dataset_id\": \"$dataset\", \"encoder_id\": \"$encoder\", \"preset\": \"smoke\"}}" | text model_id)
echo "policy $policy"

adapted=$(job "{\"kind\": \"dataset.adapt\",
    \"params\": {\"dataset_id\": \"$dataset\", \"model_id\": \"$policy\"}}" | text dataset_id)
echo "adapted dataset $adapted"

evaluation=$(job "{\"kind\": \"policy.evaluate\",
    \"params\": {\"model_id\": \"$policy\", \"object\": \"sugar_box\", \"attempts\": 2}}" | text id)
curl -fsS "$api/jobs/$evaluation/logs?tail=1"

mkdir -p "$out"
curl -fsS -o "$out/weights.safetensors" "$api/models/$policy/weights"
curl -fsS -o "$out/start_configurations.safetensors" "$api/models/$policy/start_configurations"
curl -fsS -o "$out/config.json" "$api/models/$policy/config"
