//! Hearing what the process of a job says.

use super::{Answer, Command, Ended, Engine, LEASE, LONG_LEASE, Note, Report, soon};
use crate::job::{Failure, Job, Progress, Wish};
use crate::problem::Problem;
use crate::store::{Level, News, Type};
use serde_json::json;

impl Engine {
    /// Hears a report of a job's process.
    pub(crate) async fn hear(
        &self,
        id: &str,
        token: &str,
        report: Report,
    ) -> Result<Answer, Problem> {
        let hash = blake3::hash(token.as_bytes());
        // Files are being kept while nothing else is heard of the process.
        let keeps = |note: &Note| matches!(note, Note::Checkpoint { .. });
        let has_checkpoints = report.notes.iter().any(keeps);
        let is_long = report.ended.is_some() || has_checkpoints;
        let until = soon(if is_long { LONG_LEASE } else { LEASE });
        if !self.store.renew(id, hash.as_bytes(), until).await? {
            return Err(Problem::not_its_turn());
        }
        let (ended, number) = (report.ended.clone(), report.number);
        let mut further = None;
        let told = |job: &mut Job, news: &mut Vec<News>| {
            if !job.status.has_process() {
                return Err(Problem::not_its_turn());
            }
            // A report that is sent again says nothing new.
            if number == 0 || number > job.heard {
                further = note(job, report, news);
            }
            Ok::<_, Problem>(job.wish)
        };
        let changed = self.store.change(id, told).await?;
        let (job, wish) = changed.ok_or_else(|| Problem::no_job(id))??;
        if let Some((unit, by)) = further {
            self.metrics.came_further(job.kind, &unit, by);
        }
        if has_checkpoints {
            self.take_checkpoints(&job).await?;
        }
        if let Some(ended) = ended {
            self.ended(&job, ended).await?;
        }
        if wish != Wish::Run {
            // It ends at once; one that another server started has nobody else who would settle it.
            self.vanished(id, Some(job.attempt)).await?;
            return Ok(Answer { command: Command::Stop });
        }
        if has_checkpoints {
            self.store.renew(id, hash.as_bytes(), soon(LEASE)).await?;
        }
        Ok(Answer { command: Command::Go })
    }

    /// The process of a job has done its work, or could not.
    async fn ended(&self, job: &Job, ended: Ended) -> Result<(), Problem> {
        let found = match ended {
            Ended::Done => self.settle(job).await.map_err(|error| Failure {
                code: "output_unusable".into(),
                message: error.to_string(),
                param: None,
                hint: Some("look at its log".into()),
            }),
            Ended::Failed(message) => {
                let hint = Some("look at its log; a retry goes on from where it was".into());
                Err(Failure { code: "job_failed".into(), message, param: None, hint })
            }
        };
        self.end(&job.id, job.attempt, found).await?;
        Ok(())
    }

    /// Whether a token is that of the process whose turn it is.
    pub(crate) async fn is_its_turn(&self, id: &str, token: &str) -> Result<bool, Problem> {
        Ok(self.store.is_its_turn(id, blake3::hash(token.as_bytes()).as_bytes()).await?)
    }
}

/// Notes down what a report says of its job; gives how much further it has come, and in which unit.
fn note(job: &mut Job, report: Report, news: &mut Vec<News>) -> Option<(String, f64)> {
    job.heard = report.number;
    if report.worker.is_some() {
        job.worker = report.worker;
    }
    let is_new = report.phase.is_some() && report.phase != job.phase;
    if is_new {
        job.phase = report.phase;
    }
    let further = report.progress.and_then(|now| progressed(job, now, is_new, news));
    news.extend(report.notes.into_iter().filter_map(|note| match note {
        Note::Log(text) => Some(News::new(Type::Log, text, json!({}))),
        Note::Warning(text) => {
            Some(News { level: Level::Warn, ..News::new(Type::Log, text, json!({})) })
        }
        Note::Metric(values) => {
            let data = json!(values);
            job.latest_metrics.extend(values);
            Some(News::new(Type::Metric, "", data))
        }
        Note::Checkpoint { .. } => None,
    }));
    further
}

/// The same of its progress, which begins anew with a phase.
fn progressed(
    job: &mut Job,
    now: Progress,
    is_new: bool,
    news: &mut Vec<News>,
) -> Option<(String, f64)> {
    if !is_new && job.progress.as_ref() == Some(&now) {
        return None;
    }
    let phase = job.phase.clone().unwrap_or_default();
    let furthest = job.furthest.entry(phase.clone()).or_default();
    if now.completed > *furthest {
        (*furthest, job.lost) = (now.completed, 0);
    }
    let before = job.progress.as_ref().filter(|_| !is_new);
    let by = now.completed - before.map_or(0.0, |before| before.completed);
    let unit = now.unit.clone();
    job.progress = Some(now);
    let data = json!({ "phase": job.phase, "progress": job.progress });
    news.push(News::new(Type::Progress, phase, data));
    Some((unit, by))
}
