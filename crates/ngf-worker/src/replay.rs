//! `ngf replay`: replays a recording or the attempt of a share link in physics.

use crate::evaluate::load_model;
use crate::object_selection::{self, ObjectOptions};
use crate::share_link::ShareLink;
use anyhow::{Context, Result, bail, ensure};
use objects::catalog::built_in_object;
use objects::import::FIRST_POSE;
use objects::object::Object;
use rollout::{Attempt, AttemptRecording, Controller, Outcome, RolloutContext};
use scene::scene_hash;
use std::path::Path;

/// Recording or share link, and its model and object.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Recording file, or a share link of the page
    #[arg(value_name = "FILE|LINK")]
    source: String,
    /// Model instead of the one of the link: name of a folder in models/, or path of a folder
    #[arg(long, value_name = "MODEL")]
    model: Option<String>,
    /// Object of the recording if it is not built in, or the mesh file of the link.
    #[command(flatten)]
    object: ObjectOptions,
}

/// Replays, and prints outcome and final state hash. A difference from the recording is an error.
pub(crate) fn run(options: &Options) -> Result<()> {
    if ShareLink::looks_like(&options.source) {
        return replay_link(&ShareLink::parse(&options.source)?, options);
    }
    let object = options.object.load_optional()?.map(|selected| selected.object);
    replay_file(&RolloutContext::new()?, Path::new(&options.source), object)
}

/// Replays a recording file, with its built-in object unless another one is given.
pub(crate) fn replay_file(
    context: &RolloutContext,
    file: &Path,
    object: Option<Object>,
) -> Result<()> {
    let bytes = std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
    let recording: AttemptRecording = serde_json::from_slice(&bytes)
        .with_context(|| format!("{} is not a recording", file.display()))?;
    let object = match object {
        Some(given) => given,
        None => built_in_object(&recording.object_name)
            .context("the recording refers to a mesh file; pass it with --mesh and --mass")?,
    };
    let (outcome, hash) = recording.replay(context, &object)?;
    println!("{}", description(outcome));
    println!("{hash}");
    if hash != recording.final_state_hash {
        bail!(
            "the final state differs from the recording, which has {}",
            recording.final_state_hash
        );
    }
    if outcome != recording.outcome {
        bail!("the outcome differs from the recording: {}", description(recording.outcome));
    }
    Ok(())
}

/// Repeats the attempt of a share link.
fn replay_link(link: &ShareLink, options: &Options) -> Result<()> {
    ensure!(
        link.scene_hash == scene_hash(),
        "the link was made with another scene or robot; use the program version that it was made with"
    );
    let mut context = RolloutContext::new()?;
    let model = load_model(&mut context, options.model.as_deref().unwrap_or(&link.model))?;
    ensure!(
        link.model_hash.as_ref().is_none_or(|hash| *hash == model),
        "the model differs from the model of the link; pass that one with --model"
    );
    let name = &link.object;
    let object = match options.object.mesh_only()? {
        Some(file) => object_selection::import_file(file, name, link.options, FIRST_POSE)?.object,
        None => {
            built_in_object(name).context("the link refers to a mesh file; pass it with --mesh")?
        }
    };
    ensure!(
        link.object_hash == object.hash(),
        "the object differs from {name} in the link: shape or mass has changed"
    );
    let (pose, policy) = (Some(link.pose), Controller::Policy);
    let mut attempt = Attempt::new(&context, &object, name, pose, link.seed, policy)?;
    attempt.run(&context);
    let hash = attempt.state_hash();
    println!("{}", attempt.description().unwrap_or_default());
    println!("{hash}");
    ensure!(
        hash == link.final_hash,
        "the final state differs from the link, which has {}",
        link.final_hash
    );
    Ok(())
}

fn description(outcome: Option<Outcome>) -> &'static str {
    outcome.map_or("No outcome.", |outcome| outcome.description())
}
