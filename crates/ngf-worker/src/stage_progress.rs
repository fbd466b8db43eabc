//! Progress of dataset generation: a bar per stage, and a log of their durations.

use crate::progress_bar::Bar;
use progress::Progress;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Progress bar of the current stage. Logs the duration of each stage, and requests a stop at Ctrl-C.
pub(crate) struct StageProgress {
    log: PathBuf,
    stage: Mutex<Option<StageTimer>>,
    is_stopped: AtomicBool,
}

/// Progress and start time of a stage.
struct StageTimer {
    name: String,
    bar: Bar,
    start: Instant,
    /// Items that existed before this run.
    first: usize,
    done: usize,
}

impl StageProgress {
    /// Starts to listen for Ctrl-C, until the process ends.
    pub(crate) fn new(dir: &Path) -> &'static Self {
        let (stage, is_stopped) = (Mutex::new(None), AtomicBool::new(false));
        let progress: &'static Self =
            Box::leak(Box::new(Self { log: dir.join("log.jsonl"), stage, is_stopped }));
        std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
            let interrupted = runtime.map(|runtime| runtime.block_on(tokio::signal::ctrl_c()));
            if matches!(interrupted, Ok(Ok(()))) {
                progress.is_stopped.store(true, Ordering::Relaxed);
            }
        });
        progress
    }

    /// Finishes the last stage.
    pub(crate) fn finish(&self) {
        if let Ok(mut stage) = self.stage.lock() {
            self.close(stage.take());
        }
    }

    fn close(&self, stage: Option<StageTimer>) {
        let Some(stage) = stage else { return };
        stage.bar.clear();
        let seconds = stage.start.elapsed().as_secs_f64();
        let count = stage.done - stage.first;
        if count == 0 {
            return;
        }
        println!("{}: {count} in {seconds:.1} s, {:.1}/s", stage.name, count as f64 / seconds);
        let line = serde_json::json!({
            "stage": stage.name, "count": count, "seconds": seconds,
            "threads": rayon::current_num_threads(),
        });
        let log = std::fs::OpenOptions::new().create(true).append(true).open(&self.log);
        // The log is informational; the dataset is complete without it.
        log.and_then(|mut log| writeln!(log, "{line}")).ok();
    }
}

impl Progress for StageProgress {
    fn update(&self, name: &str, done: usize, total: usize) {
        let Ok(mut stage) = self.stage.lock() else { return };
        if stage.as_ref().is_none_or(|stage| stage.name != name) {
            self.close(stage.take());
            let (bar, start) = (Bar::resume_from(name, done, total), Instant::now());
            *stage = Some(StageTimer { name: name.to_owned(), bar, start, first: done, done });
        }
        if let Some(stage) = stage.as_mut() {
            stage.done = stage.done.max(done);
            stage.bar.set(stage.done);
        }
    }

    fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::Relaxed)
    }
}
