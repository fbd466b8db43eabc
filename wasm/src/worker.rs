//! The message loop: what the page asks, the stage does, as fast as the clock says.

use crate::clock::Clock;
use crate::fetch;
use crate::protocol::{Amount, Cloud, Failure, Frame, FromWorker, Model, Progress, ToWorker};
use crate::stage::Stage;
use crate::upload::{self, Loaded};
use serde::Serialize;
use serde_wasm_bindgen::Serializer;
use std::cell::RefCell;
use wasm_bindgen::JsCast;
use wasm_bindgen::closure::Closure;
use web_sys::{DedicatedWorkerGlobalScope, MessageEvent};

/// The model that the page runs.
const MODEL: &str = "default";

struct Worker {
    stage: Stage,
    clock: Clock,
    /// Whether a timer will call `wake`.
    is_awaited: bool,
}

thread_local! {
    static WORKER: RefCell<Option<Worker>> = const { RefCell::new(None) };
}

/// Sets the scene, listens, and fetches the policy.
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
    wasm_bindgen_futures::spawn_local(fetch_model());
}

fn begin() -> Result<(), Failure> {
    let stage = Stage::new()?;
    post(&FromWorker::Ready(stage.ready()?));
    post(&FromWorker::Object(stage.object()));
    let worker = Worker { stage, clock: Clock::new(), is_awaited: false };
    worker.show();
    WORKER.with(|cell| *cell.borrow_mut() = Some(worker));
    Ok(())
}

async fn fetch_model() {
    let progress = |done, total| {
        let label = "Fetching the policy".into();
        let finished = done >= total;
        let progress = Progress { label, done, total: Some(total), unit: Amount::Bytes, finished };
        post(&FromWorker::Progress(progress));
    };
    let model = match fetch::model(MODEL, progress).await {
        Ok(Some(files)) => load_model(&files),
        Ok(None) => Ok(without_model("No policy is shipped yet.")),
        Err(failure) => Err(failure),
    };
    let model = model.unwrap_or_else(|failure| {
        post(&FromWorker::Failure(failure));
        without_model("There is no policy.")
    });
    post(&FromWorker::Progress(Progress::end()));
    post(&FromWorker::Model(model));
}

fn load_model(files: &fetch::ModelFiles) -> Result<Model, Failure> {
    let mut loaded = Ok(());
    with_worker(|worker| {
        loaded = worker.stage.load_model(&files.weights, &files.starts, &files.config);
    });
    loaded.map(|()| Model { id: Some(MODEL.into()), words: format!("Policy \"{MODEL}\" acts.") })
}

fn without_model(reason: &str) -> Model {
    let planner = "The planner acts, which knows sugar box and bleach.";
    Model { id: None, words: format!("{reason} {planner}") }
}

impl Worker {
    fn receive(&mut self, message: ToWorker) {
        match message {
            ToWorker::Load { object } => self.load(upload::built_in(&object)),
            ToWorker::Upload { file_name, bytes, .. } if file_name.ends_with(".json") => {
                self.play(&file_name, &bytes);
            }
            ToWorker::Upload { file_name, bytes, unit } => {
                post(&FromWorker::Progress(Progress::begin(format!("Reading {file_name}"))));
                self.load(upload::read(&file_name, &bytes, unit));
                post(&FromWorker::Progress(Progress::end()));
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
            ToWorker::Reset => {
                self.stage.reset();
                self.clock.is_running = true;
            }
            ToWorker::Speed { factor } => {
                if factor.is_finite() && factor > 0.0 {
                    self.clock.factor = factor;
                }
            }
        }
        self.show();
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

    /// Plays a demonstration with the object that it was made for.
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

    /// Ticks that are due, then the next timer.
    fn wake(&mut self) {
        self.is_awaited = false;
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
        if self.is_awaited || !self.clock.is_running || !self.stage.is_busy() {
            return;
        }
        let wake = Closure::once_into_js(|| with_worker(Worker::wake));
        let wait_ms = self.clock.wait_ms() as i32;
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
