//! Message loop of the Web Worker: dispatches requests to the session and steps it in real time.

use crate::batch::{Batch, Share};
use crate::clock::Clock;
use crate::fetch;
use crate::object_import::{self, LoadedObject};
use crate::protocol::{Cloud, Event, Failure, Frame, Model, Progress, ProgressUnit, Request};
use crate::session::{Session, start_failure};
use crate::worker_scope::{invalid_message, now_ms, post, scope};
use std::cell::RefCell;
use wasm_bindgen::closure::Closure;
use wasm_bindgen::{JsCast, JsValue};

/// Max time that messages wait for a batch (ms).
const BATCH_SLICE_MS: f64 = 30.0;

/// Id of the server's default model.
const DEFAULT_MODEL: &str = "default";

/// Progress text of the start of an attempt.
const PLANNING: &str = "Capturing the depth image and planning";

struct Worker {
    session: Session,
    clock: Clock,
    batch: Option<Batch>,
    /// Whether a timer will call `on_timer`.
    is_timer_set: bool,
    /// Number of the last model request. Downloads of earlier requests are dropped.
    model_request: u32,
}

thread_local! {
    static WORKER: RefCell<Option<Worker>> = const { RefCell::new(None) };
}

/// Sets up the session and posts `ready`.
pub(crate) fn start() {
    std::panic::set_hook(Box::new(|info| {
        let failure = Failure {
            code: "worker_panicked",
            message: format!("The simulation stopped: {info}"),
            hint: "Restart it. If it happens again, copy this message and report it.".into(),
        };
        post(&Event::Failure(failure));
    }));
    if let Err(failure) = init() {
        post(&Event::Failure(failure));
    }
}

/// Executes a request of the page.
pub(crate) fn receive(message: &JsValue) {
    match Request::from_message(message) {
        Ok(message) => with_worker(|worker| worker.receive(message)),
        Err(error) => post(&Event::Failure(invalid_message(&error))),
    }
}

fn init() -> Result<(), Failure> {
    let session = Session::new()?;
    post(&Event::Ready(session.ready_event()?));
    post(&Event::Object(session.object_event()));
    let worker =
        Worker { session, clock: Clock::new(), batch: None, is_timer_set: false, model_request: 0 };
    worker.post_frame();
    WORKER.with(|cell| *cell.borrow_mut() = Some(worker));
    Ok(())
}

async fn fetch_model(id: String, base: String, only_if_idle: bool, request: u32) {
    let is_current = || {
        let mut is_current = false;
        with_worker(|worker| is_current = worker.model_request == request);
        is_current
    };
    let progress = |done, total| {
        if !is_current() {
            return false;
        }
        let label = "Loading the policy".into();
        let finished = done >= total;
        let progress =
            Progress { label, done, total: Some(total), unit: ProgressUnit::Bytes, finished };
        post(&Event::Progress(progress));
        true
    };
    let fetched = fetch::fetch_model(&id, &base, progress).await;
    if !is_current() {
        return;
    }
    let mut is_busy = false;
    with_worker(|worker| is_busy = worker.batch.is_some() || worker.session.is_busy());
    if only_if_idle && is_busy {
        post(&Event::Progress(Progress::complete()));
        // The loaded policy stays.
        return with_worker(|worker| post(&Event::Model(worker.model_event())));
    }
    let loaded = match fetched {
        Ok(Some(files)) => load_model(&id, &files),
        // Without any trained model, the planner is used.
        Ok(None) if id == DEFAULT_MODEL => Ok(()),
        Ok(None) => Err(model_not_found(&id)),
        Err(failure) => Err(failure),
    };
    if let Err(failure) = loaded {
        post(&Event::Failure(failure));
    }
    post(&Event::Progress(Progress::complete()));
    with_worker(|worker| {
        post(&Event::Model(worker.model_event()));
        worker.post_frame();
    });
}

fn load_model(id: &str, files: &fetch::ModelFiles) -> Result<(), Failure> {
    let mut loaded = Ok(());
    with_worker(|worker| {
        worker.end_batch();
        loaded = worker.session.load_model(id, files);
    });
    loaded
}

fn model_not_found(id: &str) -> Failure {
    Failure {
        code: "model_not_found",
        message: format!("Policy \"{id}\" not found."),
        hint: "Choose another policy, or train one.".into(),
    }
}

impl Worker {
    fn receive(&mut self, message: Request) {
        if matches!(message, Request::LoadObject { .. } | Request::Upload { .. }) {
            self.end_batch();
        }
        match message {
            Request::LoadObject { object } => {
                self.show_loaded(object_import::load_built_in(&object))
            }
            Request::Upload { file_name, bytes, .. }
                if file_name.to_ascii_lowercase().ends_with(".json") =>
            {
                self.play_file(&file_name, &bytes);
            }
            Request::Upload { file_name, bytes, mass_kg, orientation } => {
                let report = |text| post(&Event::Progress(Progress::indeterminate(text)));
                let context = &self.session.context;
                self.show_loaded(object_import::import_mesh(
                    &file_name,
                    &bytes,
                    mass_kg,
                    orientation,
                    context,
                    &report,
                ));
                post(&Event::Progress(Progress::complete()));
            }
            Request::LoadModel { id, base, only_if_idle } => {
                self.model_request = self.model_request.wrapping_add(1);
                wasm_bindgen_futures::spawn_local(fetch_model(
                    id,
                    base,
                    only_if_idle,
                    self.model_request,
                ));
            }
            Request::Place { pose } => self.session.place(pose),
            Request::PlaceBySeed { seed } => self.session.place_by_seed(seed),
            Request::Grasp { seed } => self.grasp(seed),
            Request::Pause => self.clock.is_running = false,
            Request::Resume => self.resume(),
            Request::Step => {
                self.clock.is_running = false;
                self.tick(1);
            }
            Request::Seek { tick } => {
                self.clock.is_running = false;
                self.session.seek(tick);
            }
            Request::StreamTelemetry { on } => {
                if let Some(samples) = self.session.stream_telemetry(on) {
                    let samples = samples.into_iter().map(Into::into).collect();
                    post(&Event::Telemetry { samples });
                }
            }
            Request::Drag { drag } => {
                self.session.drag(drag);
                // No backlog accumulated while nothing moved.
                if !self.is_timer_set {
                    self.clock.restart(now_ms());
                }
                self.schedule_tick();
            }
            Request::Batch { seed, attempts, batch_id, workers } => {
                self.end_batch();
                self.batch = Some(Batch::new(batch_id, seed, attempts, workers));
                if workers > 1 {
                    let object = self.session.object_bytes();
                    post(&Event::BatchStarted { batch_id, object });
                }
                self.schedule_tick();
            }
            Request::TakeAttempts { batch_id, worker } => {
                let batch = self.batch.as_mut().filter(|batch| batch.id() == batch_id);
                let Share { seed, attempts } = batch.map(Batch::take).unwrap_or_default();
                return post(&Event::AttemptsTaken { worker, seed, attempts });
            }
            Request::CountAttempt { batch_id, attempt } => {
                let batch = self.batch.as_mut().filter(|batch| batch.id() == batch_id);
                let counted = batch.and_then(|batch| batch.count(attempt, &mut self.session));
                counted.into_iter().for_each(|counted| post(&Event::AttemptFinished(counted)));
                return self.end_finished_batch();
            }
            Request::CancelBatch => self.end_batch(),
            Request::SearchGrasps { is_long } => post(&self.session.start_search(is_long)),
            Request::CancelSearch => self.session.cancel_search(),
            Request::LoadObjectBytes { object } => {
                if let Err(failure) = self.session.load_object_bytes(&object) {
                    post(&Event::Failure(failure));
                }
            }
            Request::RunSearchTask { seed, is_long, index, task } => {
                let result = self.session.run_search_task(seed, is_long, &task);
                let done = result.map(|result| Event::SearchTaskDone { index, result });
                return post_result(done.map(Some));
            }
            Request::CompleteSearchBatch { results } => {
                return post_result(self.session.complete_search_batch(&results));
            }
            Request::PlayGrasps { seed, grasps, object_hash } => {
                post(&Event::Progress(Progress::indeterminate(PLANNING)));
                let started = self.session.start_with_grasps(seed, &grasps, &object_hash);
                self.on_attempt_started(started);
            }
            Request::ExportRecording => {
                if let Some(file) = self.session.recording_file() {
                    post(&Event::File(file));
                }
            }
            Request::Reset => {
                self.session.reset();
                self.clock.is_running = true;
            }
            Request::Panic => panic!("requested by the page"),
            Request::Speed { factor } => {
                if factor.is_finite() && factor > 0.0 {
                    self.clock.speed = factor;
                }
            }
        }
        self.post_frame();
    }

    /// Event about the loaded policy.
    fn model_event(&self) -> Model {
        let (id, hash) = self.session.model().cloned().unzip();
        let text = match &id {
            Some(id) => format!("Loaded: {id}"),
            None => "No policy loaded. The planner is used; it supports only sugar box and bleach."
                .into(),
        };
        Model { id, hash, text, tally: self.session.tally() }
    }

    fn show_loaded(&mut self, loaded: Result<LoadedObject, Failure>) {
        match loaded {
            Ok(loaded) => {
                self.session.load(loaded);
                post(&Event::Object(self.session.object_event()));
            }
            // The current object stays.
            Err(failure) => post(&Event::Failure(failure)),
        }
    }

    fn grasp(&mut self, seed: u32) {
        post(&Event::Progress(Progress::indeterminate(PLANNING)));
        let started = self.session.start_grasp(seed);
        self.on_attempt_started(started);
    }

    /// Replays a demonstration or a recorded attempt with its object.
    fn play_file(&mut self, file_name: &str, bytes: &[u8]) {
        post(&Event::Progress(Progress::indeterminate(format!("Reading {file_name}"))));
        let started = self.session.play_file(file_name, bytes);
        if started.is_ok() {
            post(&Event::Object(self.session.object_event()));
        }
        self.on_attempt_started(started);
    }

    fn on_attempt_started(&mut self, started: Result<Cloud, Failure>) {
        post(&Event::Progress(Progress::complete()));
        match started {
            Ok(cloud) => {
                // The frame with the object pose comes before the cloud at that pose.
                self.post_frame();
                post(&Event::Cloud(cloud));
                self.resume();
                self.post_outcome();
            }
            Err(failure) => post(&Event::Failure(failure)),
        }
    }

    fn resume(&mut self) {
        self.clock.is_running = true;
        self.clock.restart(now_ms());
        self.schedule_tick();
    }

    /// Runs the batch for up to `BATCH_SLICE_MS`.
    fn run_batch_slice(&mut self) {
        let end = now_ms() + BATCH_SLICE_MS;
        while now_ms() < end {
            let Some(batch) = &mut self.batch else { return };
            match batch.advance(&mut self.session) {
                Ok(None) => {}
                Ok(Some(finished)) => post(&Event::AttemptFinished(finished)),
                Err(error) => {
                    post(&Event::Failure(start_failure(&error)));
                    self.end_batch();
                    return;
                }
            }
            if batch.is_idle() {
                return self.end_finished_batch();
            }
        }
    }

    fn end_finished_batch(&mut self) {
        if self.batch.as_ref().is_some_and(Batch::is_finished) {
            self.end_batch();
        }
    }

    /// Whether this worker has attempts of a batch to execute.
    fn has_batch_work(&self) -> bool {
        self.batch.as_ref().is_some_and(|batch| !batch.is_idle())
    }

    fn end_batch(&mut self) {
        if let Some(batch) = self.batch.take() {
            post(&Event::BatchFinished { batch_id: batch.id() });
        }
    }

    /// Runs the due ticks, then schedules the next timer.
    fn on_timer(&mut self) {
        self.is_timer_set = false;
        self.run_batch_slice();
        let ticks = self.clock.ticks_due(now_ms());
        // Without an attempt, a batch does not change the view.
        if ticks > 0 && self.session.is_busy() {
            self.tick(ticks);
            self.post_frame();
        }
        self.schedule_tick();
    }

    fn tick(&mut self, count: usize) {
        for _ in 0..count {
            if !self.session.is_busy() {
                return;
            }
            self.session.tick();
            self.post_outcome();
        }
    }

    fn post_outcome(&mut self) {
        if let Some(outcome) = self.session.take_outcome() {
            self.post_frame();
            post(&Event::Outcome(outcome));
        }
    }

    /// Schedules the next tick while an attempt or a batch is running.
    fn schedule_tick(&mut self) {
        let is_playing = self.clock.is_running && self.session.is_busy();
        if self.is_timer_set || !(is_playing || self.has_batch_work()) {
            return;
        }
        let on_timer = Closure::once_into_js(|| with_worker(Worker::on_timer));
        let wait_ms = if self.has_batch_work() { 0 } else { self.clock.wait_ms() as i32 };
        let timer = scope().set_timeout_with_callback_and_timeout_and_arguments_0(
            on_timer.unchecked_ref(),
            wait_ms,
        );
        self.is_timer_set = timer.is_ok();
    }

    fn post_frame(&self) {
        let is_busy = self.session.is_busy();
        post(&Event::Frame(Frame {
            running: self.clock.is_running,
            speed: self.clock.speed,
            realtime_factor: self.clock.realtime_factor().filter(|_| is_busy),
            ..self.session.frame()
        }));
    }
}

fn post_result(result: Result<Option<Event>, Failure>) {
    match result {
        Ok(event) => event.iter().for_each(post),
        Err(failure) => post(&Event::Failure(failure)),
    }
}

/// Calls `act` with the worker, if it is initialised.
fn with_worker(act: impl FnOnce(&mut Worker)) {
    WORKER.with(|cell| {
        if let Ok(mut worker) = cell.try_borrow_mut()
            && let Some(worker) = worker.as_mut()
        {
            act(worker);
        }
    });
}
