//! Prometheus metrics. The values of all labels are bounded; none contains client-supplied text.

use crate::jobs::{Job, Kind, Status};
use prometheus_client::encoding::{EncodeLabelSet, text};
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::{Histogram, exponential_buckets};
use prometheus_client::metrics::info::Info;
use prometheus_client::registry::{Registry, Unit};
use std::sync::atomic::AtomicU64;

/// All metrics of the server, and their registry.
#[derive(Debug)]
pub(crate) struct Metrics {
    registry: Registry,
    /// Time to the start of the response (s), by route.
    pub(crate) request_duration: Family<RequestLabels, Histogram>,
    /// Size of uploaded meshes (bytes); repeated uploads of a mesh count once.
    pub(crate) uploaded_bytes: Counter,
    /// Open event streams.
    pub(crate) open_streams: Gauge,
    /// Time from the first worker to the end of a job (s).
    job_durations: Family<OutcomeLabels, Histogram>,
    /// Time from the request to the first worker of a job (s).
    queue_waits: Family<KindLabels, Histogram>,
    /// Completed units of work, such as steps and attempts.
    progress: Family<UnitLabels, Counter<f64, AtomicU64>>,
    /// Evaluation attempts, by outcome.
    grasp_attempts: Family<AttemptLabels, Counter>,
    /// Jobs, by kind and status.
    jobs: Family<JobLabels, Gauge>,
}

/// Labels of the request duration.
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

/// Histogram of request durations: 0.5 ms to 33 s.
fn request_histogram() -> Histogram {
    Histogram::new(exponential_buckets(0.0005, 2.0, 17))
}

/// Histogram of job durations: 1 s to 6 days.
fn job_histogram() -> Histogram {
    Histogram::new(exponential_buckets(1.0, 3.0, 13))
}

impl Metrics {
    /// Registers all metrics, with value 0.
    pub(crate) fn new() -> Self {
        let mut registry = Registry::with_prefix("ngf");
        let build = Info::new([("version", env!("CARGO_PKG_VERSION"))]);
        registry.register("build", "Version of the server", build);
        let metrics = Self {
            request_duration: Family::new_with_constructor(request_histogram),
            uploaded_bytes: Counter::default(),
            open_streams: Gauge::default(),
            job_durations: Family::new_with_constructor(job_histogram),
            queue_waits: Family::new_with_constructor(job_histogram),
            progress: Family::default(),
            grasp_attempts: Family::default(),
            jobs: Family::default(),
            registry: Registry::default(),
        };
        registry.register_with_unit(
            "http_request_duration",
            "Time to the start of the response",
            Unit::Seconds,
            metrics.request_duration.clone(),
        );
        let uploaded = metrics.uploaded_bytes.clone();
        registry.register_with_unit("upload", "Size of uploaded meshes", Unit::Bytes, uploaded);
        registry.register("sse_clients", "Open event streams", metrics.open_streams.clone());
        registry.register_with_unit(
            "job_duration",
            "Time from the first worker to the end of a job",
            Unit::Seconds,
            metrics.job_durations.clone(),
        );
        registry.register_with_unit(
            "job_queue_wait",
            "Time from the request to the first worker of a job",
            Unit::Seconds,
            metrics.queue_waits.clone(),
        );
        registry.register(
            "job_progress",
            "Completed units of work, such as steps and attempts",
            metrics.progress.clone(),
        );
        registry.register(
            "grasp_attempts",
            "Evaluation attempts, by outcome",
            metrics.grasp_attempts.clone(),
        );
        registry.register("jobs", "Jobs by kind and status", metrics.jobs.clone());
        Self { registry, ..metrics }
    }

    /// Records the queue wait of a job when its first worker starts.
    pub(crate) fn job_started(&self, job: &Job) {
        if let Some(started) = job.started_at.filter(|_| job.attempt == 1) {
            let labels = KindLabels { kind: job.kind().name() };
            let waited = (started - job.created_at).as_seconds_f64();
            self.queue_waits.get_or_create(&labels).observe(waited);
        }
    }

    /// Records the duration of a job if it has finished.
    pub(crate) fn job_finished(&self, job: &Job) {
        if let (Some(started), Some(finished)) = (job.started_at, job.finished_at) {
            let labels = OutcomeLabels { kind: job.kind().name(), outcome: job.status.name() };
            self.job_durations
                .get_or_create(&labels)
                .observe((finished - started).as_seconds_f64());
        }
    }

    /// Adds completed units of a job.
    pub(crate) fn add_progress(&self, kind: Kind, unit: &str, amount: f64) {
        if amount > 0.0 {
            let labels = UnitLabels { kind: kind.name(), unit: unit.to_owned() };
            self.progress.get_or_create(&labels).inc_by(amount);
        }
    }

    /// Counts evaluation attempts with this outcome.
    pub(crate) fn count_attempts(&self, outcome: &str, count: u64) {
        self.grasp_attempts.get_or_create(&AttemptLabels { outcome: outcome.into() }).inc_by(count);
    }

    /// Renders all metrics as OpenMetrics text. `jobs`: kind, status and number of jobs.
    pub(crate) fn render(&self, jobs: Vec<(String, String, i64)>) -> String {
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
        // Writing to a `String` does not fail.
        text::encode(&mut out, &self.registry).ok();
        out
    }
}

/// Guard that counts an open event stream.
#[derive(Debug)]
pub(crate) struct OpenStream(Gauge);

impl OpenStream {
    pub(crate) fn new(metrics: &Metrics) -> Self {
        metrics.open_streams.inc();
        Self(metrics.open_streams.clone())
    }
}

impl Drop for OpenStream {
    fn drop(&mut self) {
        self.0.dec();
    }
}
