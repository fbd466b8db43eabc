//! Fuzz targets for untrusted input: every input yields a value or an error, never a panic.
//!
//! `cargo xtask stress fuzz` mutates the files in `corpus/` for ten minutes per target (libFuzzer). `cargo
//! xtask test` replays them. Inputs that once caused a failure are stored there.

use axum::Router;
use axum::body::Body;
use axum::http::Request;
use objects::object::Object;
use robot::KinematicTree;
use rollout::{ReplayFile, RolloutContext};
use server::AppState;
use server::scheduler::{JobScheduler, SchedulerConfig};
use std::sync::OnceLock;
use tempfile::TempDir;
use tokio::runtime::Runtime;
use tower::ServiceExt;

/// Name of a fuzz target (also its corpus folder), and the function that processes the input.
pub type Target = (&'static str, fn(&[u8]));

/// All fuzz targets.
pub const TARGETS: [Target; 4] =
    [("mesh", mesh), ("weights", weights), ("replay_file", replay_file), ("job", job)];

/// Imports a mesh file and checks that its summary is finite.
pub fn mesh(bytes: &[u8]) {
    if let Ok(import) = mesh::import(bytes, &mesh::MeshOptions::default()) {
        // An imported mesh has finite properties, or the summary is an error.
        if let Ok(summary) = mesh::MeshSummary::of(&import) {
            assert!(summary.extent_m.iter().all(|side| side.is_finite()), "{summary:?}");
            assert!(summary.volume_m3.is_finite(), "{summary:?}");
        }
    }
}

/// Loads the input as each file of a model: weights, start configurations and configuration.
pub fn weights(bytes: &[u8]) {
    static TREE: OnceLock<KinematicTree> = OnceLock::new();
    const CONFIG: &[u8] = include_bytes!("../../models/default/config.json");
    let tree = TREE.get_or_init(|| KinematicTree::iiwa7_allegro().expect("built-in robot"));
    // Only the absence of panics is checked.
    let _ = policy::StartModel::load(bytes, policy::LATENT_DIM, tree);
    let _ = policy::Model::load(bytes, bytes, CONFIG, tree);
    let _ = policy::Model::load(bytes, bytes, bytes, tree);
}

/// Parses a replay file and simulates three steps with a built-in object.
pub fn replay_file(bytes: &[u8]) {
    static CONTEXT: OnceLock<(RolloutContext, Object)> = OnceLock::new();
    let (context, object) = CONTEXT.get_or_init(|| {
        let object = Object::from_catalog("sugar_box").expect("built-in object");
        (RolloutContext::new().expect("built-in scene"), object)
    });
    let Ok(file) = ReplayFile::parse(bytes) else { return };
    let Ok(mut attempt) = file.start_replay(context, object) else { return };
    for _ in 0..3 {
        attempt.step(context);
    }
}

/// Sends a job request as a dry run; the response must not be a server error.
pub fn job(bytes: &[u8]) {
    static SERVER: OnceLock<(Runtime, Router, TempDir)> = OnceLock::new();
    let (runtime, app, _) = SERVER.get_or_init(|| serve().expect("server without job slots"));
    let request = Request::post("/api/v1/jobs?dry_run=true").body(Body::from(bytes.to_vec()));
    let response = runtime.block_on(app.clone().oneshot(request.expect("valid request head")));
    let status = response.expect("infallible router").status();
    assert!(!status.is_server_error(), "{status}");
}

fn serve() -> std::io::Result<(Runtime, Router, TempDir)> {
    let runtime = Runtime::new()?;
    let folder = tempfile::tempdir()?;
    let config = SchedulerConfig {
        data_dir: folder.path().join("data"),
        models_dir: folder.path().join("models"),
        program: "ngf".into(),
        waits_for_program: false,
        max_concurrent: 0,
        min_free_bytes: 0,
    };
    let engine = runtime.block_on(JobScheduler::open(config)).map_err(std::io::Error::other)?;
    let (_, running) = tokio::sync::watch::channel(false);
    let state = AppState::new(folder.path(), folder.path()).with_scheduler(engine, running);
    Ok((runtime, server::app(state), folder))
}
