//! What is counted, for Prometheus. No label has more values than the program has words.

use crate::job::{Job, Kind, Status};
use prometheus_client::encoding::{EncodeLabelSet, text};
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::{Histogram, exponential_buckets};
use prometheus_client::metrics::info::Info;
use prometheus_client::registry::{Registry, Unit};
use std::sync::atomic::AtomicU64;

/// Counters, and who can write them down.
#[derive(Debug)]
pub(crate) struct Metrics {
    registry: Registry,
    /// Seconds until the answer began, of each route.
    pub(crate) requests: Family<RequestLabels, Histogram>,
    /// Bytes of meshes.
    pub(crate) uploaded: Counter,
    /// Streams that are open.
    pub(crate) streams: Gauge,
    /// Seconds from the first process to the end.
    durations: Family<OutcomeLabels, Histogram>,
    /// Seconds from the question to the first process.
    waits: Family<KindLabels, Histogram>,
    /// Steps, attempts and the like that were done.
    done: Family<UnitLabels, Counter<f64, AtomicU64>>,
    /// Attempts of evaluations, by how they ended.
    attempts: Family<AttemptLabels, Counter>,
    jobs: Family<JobLabels, Gauge>,
}

/// One kind of request and answer.
#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub(crate) struct RequestLabels {
    pub(crate) method: &'static str,
    pub(crate) route: String,
    pub(crate) status: u16,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct JobLabels {
    kind: String,
    status: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct OutcomeLabels {
    kind: &'static str,
    outcome: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct AttemptLabels {
    outcome: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct KindLabels {
    kind: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct UnitLabels {
    kind: &'static str,
    unit: String,
}

/// From half a millisecond to half a minute.
fn of_a_request() -> Histogram {
    Histogram::new(exponential_buckets(0.0005, 2.0, 17))
}

/// From a second to nine days.
fn of_a_job() -> Histogram {
    Histogram::new(exponential_buckets(1.0, 3.0, 13))
}

impl Metrics {
    /// All at zero.
    pub(crate) fn new() -> Self {
        let mut registry = Registry::with_prefix("ngf");
        let build = Info::new([("version", env!("CARGO_PKG_VERSION"))]);
        registry.register("build", "Which program this is", build);
        let metrics = Self {
            requests: Family::new_with_constructor(of_a_request),
            uploaded: Counter::default(),
            streams: Gauge::default(),
            durations: Family::new_with_constructor(of_a_job),
            waits: Family::new_with_constructor(of_a_job),
            done: Family::default(),
            attempts: Family::default(),
            jobs: Family::default(),
            registry: Registry::default(),
        };
        registry.register_with_unit(
            "http_request_duration",
            "Until the answer began",
            Unit::Seconds,
            metrics.requests.clone(),
        );
        let uploaded = metrics.uploaded.clone();
        registry.register_with_unit("upload", "Meshes that were taken", Unit::Bytes, uploaded);
        registry.register("sse_clients", "Streams that are open", metrics.streams.clone());
        registry.register_with_unit(
            "job_duration",
            "From the first process to the end",
            Unit::Seconds,
            metrics.durations.clone(),
        );
        registry.register_with_unit(
            "job_queue_wait",
            "From the question to the first process",
            Unit::Seconds,
            metrics.waits.clone(),
        );
        registry.register("job_progress", "Steps, attempts and the like", metrics.done.clone());
        registry.register(
            "grasp_attempts",
            "Attempts of evaluations, by how they ended",
            metrics.attempts.clone(),
        );
        registry.register("jobs", "Jobs by kind and status", metrics.jobs.clone());
        Self { registry, ..metrics }
    }

    /// Notes that a job has a process for the first time.
    pub(crate) fn begun(&self, job: &Job) {
        if let Some(wait) = job.started_at.filter(|_| job.attempt == 1) {
            let labels = KindLabels { kind: job.kind.name() };
            let waited = (wait - job.created_at).as_seconds_f64();
            self.waits.get_or_create(&labels).observe(waited);
        }
    }

    /// Notes that a job has ended, if it has.
    pub(crate) fn ended(&self, job: &Job) {
        if let (Some(began), Some(ended)) = (job.started_at, job.finished_at) {
            let labels = OutcomeLabels { kind: job.kind.name(), outcome: job.status.name() };
            self.durations.get_or_create(&labels).observe((ended - began).as_seconds_f64());
        }
    }

    /// Notes that a job came further.
    pub(crate) fn came_further(&self, kind: Kind, unit: &str, by: f64) {
        if by > 0.0 {
            let labels = UnitLabels { kind: kind.name(), unit: unit.to_owned() };
            self.done.get_or_create(&labels).inc_by(by);
        }
    }

    /// Notes how attempts of an evaluation ended.
    pub(crate) fn attempted(&self, outcome: &str, count: u64) {
        self.attempts.get_or_create(&AttemptLabels { outcome: outcome.into() }).inc_by(count);
    }

    /// Everything as text, with the jobs that there are.
    pub(crate) fn written(&self, jobs: Vec<(String, String, i64)>) -> String {
        self.jobs.clear();
        for kind in Kind::ALL {
            for status in Status::ALL {
                let labels = JobLabels { kind: kind.name().into(), status: status.name().into() };
                self.jobs.get_or_create(&labels).set(0);
            }
        }
        for (kind, status, count) in jobs {
            self.jobs.get_or_create(&JobLabels { kind, status }).set(count);
        }
        let mut out = String::new();
        // Writing to a text does not fail.
        text::encode(&mut out, &self.registry).ok();
        out
    }
}

/// A stream that is open as long as this lives.
#[derive(Debug)]
pub(crate) struct OpenStream(Gauge);

impl OpenStream {
    pub(crate) fn new(metrics: &Metrics) -> Self {
        metrics.streams.inc();
        Self(metrics.streams.clone())
    }
}

impl Drop for OpenStream {
    fn drop(&mut self) {
        self.0.dec();
    }
}
