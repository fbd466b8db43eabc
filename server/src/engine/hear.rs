//! Hearing what the process of a job says.

use super::{Answer, Command, Ended, Engine, LEASE, LONG_LEASE, Note, Report, soon};
use crate::job::{Failure, Job, Wish};
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
        let Report { number, worker, phase, progress, notes, ended } = report;
        let mut further = Vec::new();
        let told = |job: &mut Job, news: &mut Vec<News>| {
            if !job.status.has_process() {
                return Err(Problem::not_its_turn());
            }
            if number != 0 && number <= job.heard {
                return Ok(job.wish);
            }
            job.heard = number;
            if worker.is_some() {
                job.worker = worker;
            }
            let is_new = phase.is_some() && phase != job.phase;
            if is_new {
                job.phase = phase;
            }
            if let Some(now) = &progress
                && (is_new || progress != job.progress)
            {
                let phase = job.phase.clone().unwrap_or_default();
                let furthest = job.furthest.entry(phase).or_default();
                if now.completed > *furthest {
                    (*furthest, job.lost) = (now.completed, 0);
                }
                let before = job.progress.as_ref().filter(|_| !is_new);
                let by = now.completed - before.map_or(0.0, |before| before.completed);
                further.push((job.kind, now.unit.clone(), by));
                job.progress = progress;
                let data = json!({ "phase": job.phase, "progress": job.progress });
                news.push(News::new(Type::Progress, job.phase.clone().unwrap_or_default(), data));
            }
            news.extend(notes.into_iter().filter_map(|note| match note {
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
            Ok::<_, Problem>(job.wish)
        };
        let changed = self.store.change(id, told).await?;
        let (job, wish) = changed.ok_or_else(|| Problem::no_job(id))??;
        for (kind, unit, by) in further {
            self.metrics.came_further(kind, &unit, by);
        }
        if has_checkpoints {
            self.take_checkpoints(&job).await?;
        }
        match ended {
            None => {}
            Some(Ended::Done) => {
                let found = self.settle(&job).await.map_err(|error| Failure {
                    code: "output_unusable".into(),
                    message: error.to_string(),
                    param: None,
                    hint: Some("look at its log".into()),
                });
                self.end(id, job.attempt, found).await?;
            }
            Some(Ended::Failed(message)) => {
                let hint = Some("look at its log; a retry goes on from where it was".into());
                let failure = Failure { code: "job_failed".into(), message, param: None, hint };
                self.end(id, job.attempt, Err(failure)).await?;
            }
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

    /// Whether a token is that of the process whose turn it is.
    pub(crate) async fn is_its_turn(&self, id: &str, token: &str) -> Result<bool, Problem> {
        Ok(self.store.is_its_turn(id, blake3::hash(token.as_bytes()).as_bytes()).await?)
    }
}
