//! What strangers may send: whatever the bytes are, the answer is a value or an error, never a panic.
//!
//! `cargo xtask prove` mutates the files in `corpus/` for ten minutes each (libFuzzer); `cargo xtask test` replays them.
//! Bytes that once broke something are kept there.

use axum::Router;
use axum::body::Body;
use axum::http::Request;
use geometry::object::Object;
use robot::Tree;
use rollout::{Tape, Workcell};
use server::AppState;
use server::engine::{Engine, EngineConfig};
use std::sync::OnceLock;
use tempfile::TempDir;
use tokio::runtime::Runtime;
use tower::ServiceExt;

/// A name, and what is done with bytes.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: [Target; 4] =
    [("mesh", mesh), ("weights", weights), ("tape", tape), ("job", job)];

/// A mesh file.
pub fn mesh(bytes: &[u8]) {
    if let Ok(import) = geometry::mesh::import(bytes, None) {
        // What was taken is of use, or it is said why not.
        if let Ok(report) = geometry::mesh::Report::of(&import) {
            assert!(report.extent_m.iter().all(|side| side.is_finite()), "{report:?}");
            assert!(report.volume_m3.is_finite(), "{report:?}");
        }
    }
}

/// The files of a model: weights, starts and configuration.
pub fn weights(bytes: &[u8]) {
    static TREE: OnceLock<Tree> = OnceLock::new();
    const CONFIG: &[u8] = include_bytes!("../../models/default/config.json");
    let tree = TREE.get_or_init(|| Tree::iiwa7_allegro().expect("the robot"));
    // As each of the three; all that counts is that none of them panics.
    let _ = policy::Starts::load(bytes, policy::LATENT, tree);
    let _ = policy::Model::load(bytes, bytes, CONFIG, tree);
    let _ = policy::Model::load(bytes, bytes, bytes, tree);
}

/// A file that plays, with the object that stands there.
pub fn tape(bytes: &[u8]) {
    static STAGE: OnceLock<(Workcell, Object)> = OnceLock::new();
    let (workcell, object) = STAGE.get_or_init(|| {
        let object = Object::built_in("sugar_box").expect("a built-in object");
        (Workcell::new().expect("the scene"), object)
    });
    let Ok(tape) = Tape::read(bytes) else { return };
    let Ok(mut attempt) = tape.begin(workcell, object) else { return };
    for _ in 0..3 {
        attempt.tick(workcell);
    }
}

/// A request for a job: it is answered, and no answer is a failure of the server.
pub fn job(bytes: &[u8]) {
    static SERVER: OnceLock<(Runtime, Router, TempDir)> = OnceLock::new();
    let (runtime, app, _) = SERVER.get_or_init(|| serve().expect("a server that begins no job"));
    let request = Request::post("/api/v1/jobs?dry_run=true").body(Body::from(bytes.to_vec()));
    let answer = runtime.block_on(app.clone().oneshot(request.expect("a request")));
    let status = answer.expect("an answer").status();
    assert!(!status.is_server_error(), "{status}");
}

fn serve() -> std::io::Result<(Runtime, Router, TempDir)> {
    let runtime = Runtime::new()?;
    let folder = tempfile::tempdir()?;
    let config = EngineConfig {
        data: folder.path().join("data"),
        models: folder.path().join("models"),
        program: "ngf".into(),
        places: 0,
        free_bytes: 0,
    };
    let engine = runtime.block_on(Engine::open(config)).map_err(std::io::Error::other)?;
    let (_, running) = tokio::sync::watch::channel(false);
    let state = AppState::new(folder.path(), folder.path()).with_engine(engine, running);
    Ok((runtime, server::app(state), folder))
}
