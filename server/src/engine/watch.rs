//! What nobody would notice by looking at a status: a job whose process reports and comes no further, and a disk that
//! fills up.

use super::Engine;
use crate::job::{Job, Status};
use crate::store::{Filter, Level, News, StoreError, Type};
use serde_json::json;
use std::collections::HashMap;
use std::time::{Duration, Instant};

/// Time between two looks.
const PACE: Duration = Duration::from_secs(15);

/// A process that comes no further for so long is stuck, or does what takes that long without telling.
const STILL: Duration = Duration::from_secs(600);

/// How far a job has come: its attempt, its phase, and what is done of that.
type Place = (u64, Option<String>, Option<f64>);

/// What is known of the jobs that run.
#[derive(Debug, Default)]
pub(super) struct Watch {
    looked: Option<Instant>,
    seen: HashMap<String, Seen>,
}

/// What is known of one.
#[derive(Debug)]
struct Seen {
    place: Place,
    since: Instant,
    /// Whether it was told in this place that it stands still.
    told_still: bool,
    /// Whether it was told in this attempt that the disk fills up.
    told_disk: bool,
}

impl Watch {
    /// What somebody should look at now, with so many bytes of the disk free.
    fn alerts(&mut self, job: &Job, free: Option<u64>, least: u64, now: Instant) -> Vec<News> {
        let completed = job.progress.as_ref().map(|progress| progress.completed);
        let place = (job.attempt, job.phase.clone(), completed);
        let new =
            |told_disk| Seen { place: place.clone(), since: now, told_still: false, told_disk };
        let seen = self.seen.entry(job.id.clone()).or_insert_with(|| new(false));
        if seen.place != place {
            let same_attempt = seen.place.0 == place.0;
            *seen = new(same_attempt && seen.told_disk);
        }
        let mut news = Vec::new();
        if !seen.told_still && now - seen.since >= STILL {
            seen.told_still = true;
            let minutes = STILL.as_secs() / 60;
            let message = format!("it has come no further for {minutes} minutes: look at its log");
            news.push(alert(message, json!({ "code": "no_progress", "minutes": minutes })));
        }
        if let Some(free) = free.filter(|free| *free < least)
            && !seen.told_disk
        {
            seen.told_disk = true;
            let gigabytes = free as f64 / 1e9;
            let message = format!(
                "the disk has {gigabytes:.1} GB left: delete datasets, models or jobs before it is full"
            );
            news.push(alert(message, json!({ "code": "disk_low", "free_bytes": free })));
        }
        news
    }
}

fn alert(message: String, data: serde_json::Value) -> News {
    News { level: Level::Warn, ..News::new(Type::Alert, message, data) }
}

impl Engine {
    /// Looks at the jobs that run, every so often.
    pub(super) async fn watch(&self, watch: &mut Watch) -> Result<(), StoreError> {
        let now = Instant::now();
        if watch.looked.is_some_and(|looked| now - looked < PACE) {
            return Ok(());
        }
        watch.looked = Some(now);
        let filter = Filter { status: vec![Status::Running], limit: i64::MAX, ..Filter::default() };
        let running = self.store.jobs(&filter).await?;
        watch.seen.retain(|id, _| running.iter().any(|job| job.id == *id));
        let free = fs4::available_space(self.data()).ok();
        for job in running {
            let alerts = watch.alerts(&job, free, self.config.free_bytes, now);
            if alerts.is_empty() {
                continue;
            }
            // It may have ended meanwhile.
            let tell = |now: &mut Job, news: &mut Vec<News>| {
                if now.status != Status::Running || now.attempt != job.attempt {
                    return Err(());
                }
                news.extend(alerts);
                Ok(())
            };
            if let Err(error) = self.store.change(&job.id, tell).await {
                tracing::warn!(job = job.id, %error, "an alert is not kept");
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{Inputs, Kind, MeshParams, Params, Progress};

    /// A job that runs, in its first attempt.
    fn job() -> Job {
        let params = Params::Mesh(MeshParams { mesh_id: "msh_1".into() });
        let mut job = Job::new(Kind::MeshPrepare, params, Inputs::default());
        (job.status, job.attempt) = (Status::Running, 1);
        job
    }

    fn at(completed: f64) -> Option<Progress> {
        let unit = "attempts".into();
        Some(Progress { completed, total: 100.0, unit, rate_per_second: None })
    }

    fn codes(news: &[News]) -> Vec<&str> {
        assert!(news.iter().all(|one| one.kind == Type::Alert && one.level == Level::Warn));
        news.iter().map(|one| one.data["code"].as_str().unwrap()).collect()
    }

    #[test]
    fn what_stands_still_is_told_once_until_it_goes_on() {
        let (mut watch, mut job, begin) = (Watch::default(), job(), Instant::now());
        let mut look = |job: &Job, minute: u64| {
            let now = begin + Duration::from_secs(60 * minute);
            codes(&watch.alerts(job, None, 0, now)).len()
        };
        job.progress = at(1.0);
        assert_eq!([0, 9, 10, 11, 30].map(|minute| look(&job, minute)), [0, 0, 1, 0, 0]);
        job.progress = at(2.0);
        assert_eq!([31, 40, 41, 42].map(|minute| look(&job, minute)), [0, 0, 1, 0]);
        // Another phase or process begins anew.
        job.phase = Some("counting".into());
        assert_eq!([43, 52].map(|minute| look(&job, minute)), [0, 0]);
        job.attempt = 2;
        assert_eq!([53, 62, 63].map(|minute| look(&job, minute)), [0, 0, 1]);
    }

    #[test]
    fn a_disk_that_fills_up_is_told_once_an_attempt() {
        let (mut watch, mut job, now) = (Watch::default(), job(), Instant::now());
        let mut look = |job: &Job, free| codes(&watch.alerts(job, Some(free), 1000, now)).concat();
        assert_eq!([1000, 999, 500].map(|free| look(&job, free)), ["", "disk_low", ""]);
        job.progress = at(1.0);
        assert_eq!(look(&job, 10), "");
        job.attempt = 2;
        assert_eq!(look(&job, 10), "disk_low");
    }
}
