"""Runs the pipeline with a Python client that openapi-python-client generated: no request is written by hand.

Run as `python generated_client.py URL DIR`, with the generated package `ngf_grasp_client` on the path. URL is the
address of a server with an empty data folder. DIR receives the dataset that the server generated.
"""

import importlib
import json
import sys
import tarfile
import tempfile
from pathlib import Path
from shutil import rmtree

from ngf_grasp_client import Client
from ngf_grasp_client.api.artifacts import artifacts_get
from ngf_grasp_client.api.datasets import datasets_archive, datasets_delete, datasets_file, datasets_files
from ngf_grasp_client.api.datasets import datasets_get, datasets_import
from ngf_grasp_client.api.jobs import jobs_artifacts, jobs_create, jobs_get, jobs_logs
from ngf_grasp_client.api.models import models_archive, models_get, models_import
from ngf_grasp_client.api.system import system_openapi
from ngf_grasp_client.models import (
    DatasetParams,
    DatasetParamsPreset,
    EncoderParams,
    EvaluatePolicy,
    EvaluatePolicyKind,
    EvaluationParams,
    GenerateDataset,
    GenerateDatasetKind,
    Job,
    PolicyParams,
    Status,
    TrainEncoder,
    TrainEncoderKind,
    TrainingParamsPreset,
    TrainPolicy,
    TrainPolicyKind,
)
from ngf_grasp_client.types import File

WAIT = "30s"


def run(client: Client, request: GenerateDataset | TrainEncoder | TrainPolicy | EvaluatePolicy) -> Job:
    """Creates a job and waits for its end."""
    job = jobs_create.sync(client=client, body=request)
    assert isinstance(job, Job), job
    while job.status not in (Status.SUCCEEDED, Status.FAILED, Status.CANCELLED):
        job = jobs_get.sync(job.id, client=client, wait=WAIT)
        assert isinstance(job, Job), job
    assert job.status == Status.SUCCEEDED, job
    print(f"{job.kind}: {job.status}")
    return job


def check_operations(client: Client) -> None:
    """Every operation of the description has a function in the client."""
    description = json.loads(system_openapi.sync_detailed(client=client).content)
    operations = [operation for item in description["paths"].values() for operation in item.values()]
    for operation in operations:
        importlib.import_module(f"ngf_grasp_client.api.{operation['tags'][0]}.{operation['operationId']}")
    print(f"{len(operations)} operations")


def fetch_dataset(client: Client, dataset_id: str, folder: Path) -> None:
    """Downloads a dataset as an archive, imports it after its deletion, and unpacks it."""
    archive = datasets_archive.sync(dataset_id, client=client)
    assert isinstance(archive, File)
    with tempfile.TemporaryFile() as file:
        file.write(archive.payload.read())
        assert datasets_delete.sync_detailed(dataset_id, client=client).status_code == 204
        file.seek(0)
        imported = datasets_import.sync(client=client, body=File(payload=file))
        assert imported.id == dataset_id, imported
        rmtree(folder, ignore_errors=True)
        file.seek(0)
        with tempfile.TemporaryDirectory(dir=folder.parent) as unpacked, tarfile.open(fileobj=file) as tar:
            tar.extractall(unpacked, filter="data")
            (Path(unpacked) / dataset_id).rename(folder)
    for entry in datasets_files.sync(dataset_id, client=client).data:
        assert (folder / entry.path).stat().st_size == entry.bytes_, entry.path
    info = datasets_file.sync(dataset_id, "meta/info.json", client=client)
    assert info.payload.read() == (folder / "meta/info.json").read_bytes()


def main() -> None:
    url, folder = sys.argv[1], Path(sys.argv[2])
    client = Client(base_url=url, timeout=120, raise_on_unexpected_status=True)
    check_operations(client)
    smoke = TrainingParamsPreset.SMOKE

    params = DatasetParams(preset=DatasetParamsPreset.SMOKE, seed=1)
    job = run(client, GenerateDataset(kind=GenerateDatasetKind.DATASET_GENERATE, params=params))
    dataset = job.outputs.dataset_id
    assert datasets_get.sync(dataset, client=client).job == job.id

    training = EncoderParams(dataset_id=dataset, preset=smoke)
    encoder = run(client, TrainEncoder(kind=TrainEncoderKind.ENCODER_TRAIN, params=training)).outputs.model_id

    training = PolicyParams(dataset_id=dataset, encoder_id=encoder, preset=smoke)
    policy = run(client, TrainPolicy(kind=TrainPolicyKind.POLICY_TRAIN, params=training)).outputs.model_id

    evaluation = EvaluationParams(model_id=policy, object_="sugar_box", attempts=2)
    job = run(client, EvaluatePolicy(kind=EvaluatePolicyKind.POLICY_EVALUATE, params=evaluation))
    assert "policy" in jobs_logs.sync(job.id, client=client)
    for artifact in jobs_artifacts.sync(job.id, client=client).data:
        content = artifacts_get.sync(artifact.hash_, client=client)
        assert len(content.payload.read()) == artifact.bytes_, artifact.name
    reports = models_get.sync(policy, client=client).evaluations[0].reports
    assert reports[0].attempts == 2, reports

    archive = models_archive.sync(policy, client=client)
    assert models_import.sync(client=client, body=archive).id == policy
    fetch_dataset(client, dataset, folder)
    print("the pipeline ran with the generated client")


if __name__ == "__main__":
    main()
