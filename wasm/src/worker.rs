//! The message loop: what the page asks, the stage does, as fast as the clock says.

use crate::batch::Batch;
use crate::clock::Clock;
use crate::fetch;
use crate::protocol::{Amount, Cloud, Failure, Frame, FromWorker, Model, Progress, ToWorker};
use crate::stage::{Stage, cannot_begin};
use crate::upload::{self, Loaded};
use geometry::brought::Told;
use serde::Serialize;
use serde_wasm_bindgen::Serializer;
use std::cell::RefCell;
use wasm_bindgen::JsCast;
use wasm_bindgen::closure::Closure;
use web_sys::{DedicatedWorkerGlobalScope, MessageEvent};

/// The page's messages wait at most so long for a batch (ms).
const SLICE_MS: f64 = 30.0;

/// The model that stands for whichever was chosen.
const DEFAULT: &str = "default";

struct Worker {
    stage: Stage,
    clock: Clock,
    batch: Option<Batch>,
    /// Whether a timer will call `wake`.
    is_awaited: bool,
    /// How many times a model was asked for: what comes of earlier ones is not wanted any more.
    wanted: u32,
}

thread_local! {
    static WORKER: RefCell<Option<Worker>> = const { RefCell::new(None) };
}

/// Sets the scene and listens.
pub(crate) fn start() {
    std::panic::set_hook(Box::new(|info| {
        let failure = Failure {
            code: "engine_panicked",
            cause: format!("The simulation stopped: {info}"),
            cure: "Restart it. If it happens again, copy this and report it.".into(),
        };
        post(&FromWorker::Failure(failure));
    }));
    if let Err(failure) = begin() {
        post(&FromWorker::Failure(failure));
        return;
    }
    let listen = Closure::<dyn FnMut(MessageEvent)>::new(|event: MessageEvent| {
        match serde_wasm_bindgen::from_value(event.data()) {
            Ok(message) => with_worker(|worker| worker.receive(message)),
            Err(error) => post(&FromWorker::Failure(misunderstood(&error))),
        }
    });
    scope().set_onmessage(Some(listen.into_js_value().unchecked_ref()));
}

fn begin() -> Result<(), Failure> {
    let stage = Stage::new()?;
    post(&FromWorker::Ready(stage.ready()?));
    post(&FromWorker::Object(stage.object()));
    let worker = Worker { stage, clock: Clock::new(), batch: None, is_awaited: false, wanted: 0 };
    worker.show();
    WORKER.with(|cell| *cell.borrow_mut() = Some(worker));
    Ok(())
}

async fn fetch_model(id: String, base: String, gently: bool, request: u32) {
    let is_wanted = || {
        let mut is_wanted = false;
        with_worker(|worker| is_wanted = worker.wanted == request);
        is_wanted
    };
    let progress = |done, total| {
        if !is_wanted() {
            return false;
        }
        let label = "Fetching the policy".into();
        let finished = done >= total;
        let progress = Progress { label, done, total: Some(total), unit: Amount::Bytes, finished };
        post(&FromWorker::Progress(progress));
        true
    };
    let fetched = fetch::model(&id, &base, progress).await;
    if !is_wanted() {
        return;
    }
    let mut is_busy = false;
    with_worker(|worker| is_busy = worker.batch.is_some() || worker.stage.is_busy());
    if gently && is_busy {
        post(&FromWorker::Progress(Progress::end()));
        // Who acts still does.
        return with_worker(|worker| post(&FromWorker::Model(worker.model())));
    }
    let loaded = match fetched {
        Ok(Some(files)) => load_model(&id, &files),
        // Before anything has been trained there is none, and the planner acts.
        Ok(None) if id == DEFAULT => Ok(()),
        Ok(None) => Err(no_model(&id)),
        Err(failure) => Err(failure),
    };
    if let Err(failure) = loaded {
        post(&FromWorker::Failure(failure));
    }
    post(&FromWorker::Progress(Progress::end()));
    with_worker(|worker| {
        post(&FromWorker::Model(worker.model()));
        worker.show();
    });
}

fn load_model(id: &str, files: &fetch::ModelFiles) -> Result<(), Failure> {
    let mut loaded = Ok(());
    with_worker(|worker| {
        worker.end_batch();
        loaded = worker.stage.load_model(id, files);
    });
    loaded
}

fn no_model(id: &str) -> Failure {
    Failure {
        code: "model_missing",
        cause: format!("There is no policy \"{id}\" here."),
        cure: "Choose another one, or train one.".into(),
    }
}

impl Worker {
    fn receive(&mut self, message: ToWorker) {
        if matches!(message, ToWorker::Load { .. } | ToWorker::Upload { .. }) {
            self.end_batch();
        }
        match message {
            ToWorker::Load { object } => self.load(upload::built_in(&object)),
            ToWorker::Upload { file_name, bytes, .. }
                if file_name.to_ascii_lowercase().ends_with(".json") =>
            {
                self.play(&file_name, &bytes);
            }
            ToWorker::Upload { file_name, bytes, unit, mass_kg, stands } => {
                let told = Told { unit, mass: mass_kg, stands };
                let say = |words| post(&FromWorker::Progress(Progress::begin(words)));
                self.load(upload::read(&file_name, &bytes, told, &self.stage.workcell, &say));
                post(&FromWorker::Progress(Progress::end()));
            }
            ToWorker::Model { id, base, gently } => {
                self.wanted = self.wanted.wrapping_add(1);
                wasm_bindgen_futures::spawn_local(fetch_model(id, base, gently, self.wanted));
            }
            ToWorker::Place { pose } => self.stage.place(pose),
            ToWorker::RandomPose { seed } => self.stage.place_by_seed(seed),
            ToWorker::Grasp { seed } => self.grasp(seed),
            ToWorker::Pause => self.clock.is_running = false,
            ToWorker::Resume => self.resume(),
            ToWorker::Step => {
                self.clock.is_running = false;
                self.tick(1);
            }
            ToWorker::Seek { tick } => {
                self.clock.is_running = false;
                self.stage.seek(tick);
            }
            ToWorker::Watch { on } => {
                if let Some(moments) = self.stage.watch(on) {
                    post(&FromWorker::Course { moments });
                }
            }
            ToWorker::Pull { pull } => {
                self.stage.pull(pull);
                // While nothing moved, no time was owed.
                if !self.is_awaited {
                    self.clock.restart(now_ms());
                }
                self.await_tick();
            }
            ToWorker::Batch { seed, attempts, run } => {
                self.end_batch();
                self.batch = Some(Batch::new(run, seed, attempts));
                self.await_tick();
            }
            ToWorker::Cancel => self.end_batch(),
            ToWorker::Search { seed } => self.search(seed),
            ToWorker::Follow { seed, grasps, object } => {
                post(&FromWorker::Progress(Progress::begin("Looking and planning")));
                let begun = self.stage.follow(seed, &grasps, &object);
                self.set_off(begun);
            }
            ToWorker::Export => {
                if let Some(file) = self.stage.episode() {
                    post(&FromWorker::File(file));
                }
            }
            ToWorker::Reset => {
                self.stage.reset();
                self.clock.is_running = true;
            }
            ToWorker::Panic => panic!("the page asked for it"),
            ToWorker::Speed { factor } => {
                if factor.is_finite() && factor > 0.0 {
                    self.clock.factor = factor;
                }
            }
        }
        self.show();
    }

    /// Who acts.
    fn model(&self) -> Model {
        let (id, hash) = self.stage.model().cloned().unzip();
        let words = match &id {
            Some(id) => format!("Policy \"{id}\" acts."),
            None => "No policy acts, but the planner, which knows sugar box and bleach.".into(),
        };
        Model { id, hash, words, tally: self.stage.tally() }
    }

    fn load(&mut self, loaded: Result<Loaded, Failure>) {
        match loaded {
            Ok(loaded) => {
                self.stage.load(loaded);
                post(&FromWorker::Object(self.stage.object()));
            }
            // What stood there still does.
            Err(failure) => post(&FromWorker::Failure(failure)),
        }
    }

    fn grasp(&mut self, seed: u32) {
        post(&FromWorker::Progress(Progress::begin("Looking and planning")));
        let begun = self.stage.begin(seed);
        self.set_off(begun);
    }

    fn search(&self, seed: u32) {
        let progress = |share: f32| {
            let (label, unit) = ("Searching a grasp".into(), Amount::Steps);
            let (done, total) = (f64::from(share * 100.0).round(), Some(100.0));
            let progress = Progress { label, done, total, unit, finished: false };
            post(&FromWorker::Progress(progress));
        };
        let found = self.stage.search(seed, progress);
        post(&FromWorker::Progress(Progress::end()));
        match found {
            Ok(found) => post(&FromWorker::Found(found)),
            Err(failure) => post(&FromWorker::Failure(failure)),
        }
    }

    /// Plays a demonstration or a recorded attempt with the object that it was made for.
    fn play(&mut self, file_name: &str, bytes: &[u8]) {
        post(&FromWorker::Progress(Progress::begin(format!("Reading {file_name}"))));
        let begun = self.stage.play(file_name, bytes);
        if begun.is_ok() {
            post(&FromWorker::Object(self.stage.object()));
        }
        self.set_off(begun);
    }

    fn set_off(&mut self, begun: Result<Cloud, Failure>) {
        post(&FromWorker::Progress(Progress::end()));
        match begun {
            Ok(cloud) => {
                // Where the object stands that is in the cloud.
                self.show();
                post(&FromWorker::Cloud(cloud));
                self.resume();
                self.tell_verdict();
            }
            Err(failure) => post(&FromWorker::Failure(failure)),
        }
    }

    fn resume(&mut self) {
        self.clock.is_running = true;
        self.clock.restart(now_ms());
        self.await_tick();
    }

    /// Ticks of the batch for as long as messages may wait.
    fn work_off(&mut self) {
        let end = now_ms() + SLICE_MS;
        while now_ms() < end {
            let Some(batch) = &mut self.batch else { return };
            match batch.advance(&mut self.stage) {
                Ok(None) => {}
                Ok(Some(attempted)) => post(&FromWorker::Attempted(attempted)),
                Err(error) => {
                    post(&FromWorker::Failure(cannot_begin(&error)));
                    self.end_batch();
                    return;
                }
            }
            if batch.is_over() {
                self.end_batch();
            }
        }
    }

    fn end_batch(&mut self) {
        if let Some(batch) = self.batch.take() {
            post(&FromWorker::BatchOver { run: batch.run() });
        }
    }

    /// Ticks that are due, then the next timer.
    fn wake(&mut self) {
        self.is_awaited = false;
        self.work_off();
        let due = self.clock.due(now_ms());
        self.tick(due);
        if due > 0 {
            self.show();
        }
        self.await_tick();
    }

    fn tick(&mut self, count: usize) {
        for _ in 0..count {
            if !self.stage.is_busy() {
                return;
            }
            self.stage.tick();
            self.tell_verdict();
        }
    }

    fn tell_verdict(&mut self) {
        if let Some(verdict) = self.stage.count_verdict() {
            self.show();
            post(&FromWorker::Verdict(verdict));
        }
    }

    /// A timer for the next tick, while there is something to do.
    fn await_tick(&mut self) {
        let is_playing = self.clock.is_running && self.stage.is_busy();
        if self.is_awaited || !(is_playing || self.batch.is_some()) {
            return;
        }
        let wake = Closure::once_into_js(|| with_worker(Worker::wake));
        let wait_ms = if self.batch.is_some() { 0 } else { self.clock.wait_ms() as i32 };
        let timer = scope()
            .set_timeout_with_callback_and_timeout_and_arguments_0(wake.unchecked_ref(), wait_ms);
        self.is_awaited = timer.is_ok();
    }

    fn show(&self) {
        let is_busy = self.stage.is_busy();
        post(&FromWorker::Frame(Frame {
            running: self.clock.is_running,
            factor: self.clock.factor,
            measured: self.clock.measured().filter(|_| is_busy),
            ..self.stage.frame()
        }));
    }
}

/// Does something with the worker, once it is there.
fn with_worker(act: impl FnOnce(&mut Worker)) {
    WORKER.with(|cell| {
        if let Ok(mut worker) = cell.try_borrow_mut()
            && let Some(worker) = worker.as_mut()
        {
            act(worker);
        }
    });
}

fn post(message: &FromWorker) {
    let serializer = Serializer::new().serialize_missing_as_null(true);
    // A message that cannot be written or sent has nobody left to be told.
    if let Ok(message) = message.serialize(&serializer) {
        scope().post_message(&message).ok();
    }
}

fn misunderstood(error: &serde_wasm_bindgen::Error) -> Failure {
    Failure {
        code: "message_misunderstood",
        cause: format!("The page asked for something unknown: {error}."),
        cure: "Reload the page: it may be older than its worker.".into(),
    }
}

fn scope() -> DedicatedWorkerGlobalScope {
    js_sys::global().unchecked_into()
}

fn now_ms() -> f64 {
    scope().performance().map_or_else(js_sys::Date::now, |performance| performance.now())
}
