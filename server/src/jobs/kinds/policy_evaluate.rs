//! Job kind `policy.evaluate`: evaluates a policy with grasp attempts by the protocol.

use super::command_line::{InputPaths, OUT_DIR, args, option_args, path_arg};
use super::object_params::ObjectParams;
use super::param_checks::{Invalid, check_range};
use super::{Cost, JobKind};
use crate::jobs::Inputs;
use crate::jobs::scheduler::OutputCollector;
use crate::store::{RecordKind, StoreError};
use chrono::Utc;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use utoipa::ToSchema;

/// Maximum number of attempts of an evaluation.
const MAX_ATTEMPTS: u64 = 100_000;

/// Model id of the planner, which has no model.
const PLANNER: &str = "planner";

/// Report file, in [`OUT_DIR`].
const REPORT_FILE: &str = "report.json";

/// Parameters of an evaluation: grasp attempts by the protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct EvaluationParams {
    /// Model id, or `planner`.
    pub(crate) model_id: String,
    /// Object to grasp.
    #[serde(flatten)]
    pub(crate) object_params: ObjectParams,
    /// Number of attempts.
    #[serde(default = "default_attempts")]
    pub(crate) attempts: u64,
    /// Random seed of the first attempt; later attempts count up from it.
    #[serde(default)]
    pub(crate) seed: u64,
    /// Also evaluate the control conditions.
    #[serde(default)]
    pub(crate) controls: bool,
}

fn default_attempts() -> u64 {
    100
}

/// Reference run time of an attempt (s). 300 attempts: 95 to 115 s.
const SECONDS_PER_ATTEMPT: f64 = 0.35;
/// Reference disk space of an attempt (bytes).
const BYTES_PER_ATTEMPT: f64 = 200.0;
/// Number of conditions with the control conditions.
const NUM_CONDITIONS: f64 = 5.0;

impl JobKind for EvaluationParams {
    fn resolve(self) -> Result<Self, Invalid> {
        self.object_params.validate(true)?;
        check_range("attempts", self.attempts, 1, MAX_ATTEMPTS)?;
        check_range("seed", self.seed, 0, u64::MAX - self.attempts)?;
        Ok(self)
    }

    fn resolve_aliases(&mut self, resolve: impl Fn(&str) -> String) {
        self.model_id = resolve(&self.model_id);
    }

    fn seed(&self) -> u64 {
        self.seed
    }

    fn has_mesh_size(&self) -> bool {
        self.object_params.has_mesh_size()
    }

    fn inputs(&self) -> Inputs {
        Inputs {
            mesh_id: self.object_params.mesh_id.clone(),
            model_id: Some(self.model_id.clone()).filter(|id| id != PLANNER),
            ..Inputs::default()
        }
    }

    fn argv(&self, inputs: &InputPaths) -> Vec<String> {
        let model = match self.model_id.as_str() {
            PLANNER => PLANNER.to_owned(),
            _ => path_arg(inputs.model),
        };
        [
            args(["evaluate", "--model", &model]),
            self.object_params.argv(inputs.mesh),
            option_args("attempts", Some(self.attempts)),
            option_args("seed", Some(self.seed)),
            args(["--json", &format!("{OUT_DIR}/{REPORT_FILE}")]),
            if self.controls { args(["--controls"]) } else { Vec::new() },
        ]
        .concat()
    }

    /// Adds the reports as a record of the model, and counts the attempts.
    async fn collect(&self, outputs: &mut OutputCollector<'_>) -> Result<(), StoreError> {
        outputs.store_files().await?;
        let (scheduler, job) = (outputs.scheduler, outputs.job);
        let mut reports: Value =
            serde_json::from_slice(&tokio::fs::read(outputs.folder.join(REPORT_FILE)).await?)?;
        for report in reports.as_array_mut().into_iter().flatten() {
            let failures = report["failures"].as_object().into_iter().flatten();
            let outcomes = failures.map(|(reason, count)| (reason.as_str(), count));
            for (outcome, count) in outcomes.chain([("lifted", &report["lifted"])]) {
                scheduler.metrics.count_attempts(outcome, count.as_u64().unwrap_or_default());
            }
            // The record omits the single attempts; the artifact contains them.
            report.as_object_mut().map(|report| report.remove("rows"));
        }
        // The planner has no model record.
        let Some(model) = &job.inputs.model_id else { return Ok(()) };
        let id = format!("evl_{}", job.id.trim_start_matches("job_"));
        let record = json!({
            "id": id, "object": "evaluation", "model_id": model, "job": job.id,
            "created_at": Utc::now(), "reports": reports,
        });
        scheduler.store.add_record(RecordKind::Evaluation, &id, &record).await
    }

    fn cost(&self) -> Cost {
        let conditions = if self.controls { NUM_CONDITIONS } else { 1.0 };
        let attempts = conditions * self.attempts as f64;
        Cost { seconds: SECONDS_PER_ATTEMPT * attempts, bytes: BYTES_PER_ATTEMPT * attempts }
    }
}
